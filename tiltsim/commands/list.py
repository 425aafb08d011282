"""``tiltsim list``: prints the scenario library."""

from __future__ import annotations

import argparse
import json

from tiltsim.commands.options import Subparsers, add_json
from tiltsim.commands.text import fitted
from tiltsim.errors import InputError
from tiltsim.scenario.library import Entry, library_entries, library_families, library_sweeps
from tiltsim.system.text import printable


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """List the scenario library with titles and sources in the thesis. A line that
    begins with # is a variant of the file above it: tiltsim run 'FILE#VARIANT'."""
    summary = "list the scenario library"
    parser = subparsers.add_parser("list", help=summary, description=description)
    parser.add_argument(
        "word",
        nargs="?",
        default="",
        metavar="WORD",
        help="list only what has this text in its address, title or source; case does not matter",
    )
    parser.add_argument("--sweeps", action="store_true", help="list only the sweeps")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print one line per file, with one per variant below it; sweeps at the end."""
    word = arguments.word
    sweeps = [sweep for sweep in library_sweeps() if sweep.contains(word)]
    if arguments.json:
        found = sweeps if arguments.sweeps else library_entries(word)
        keys = ("sweep" if arguments.sweeps else "scenario", "title", "source")
        print(json.dumps([dict(zip(keys, entry)) for entry in found], indent=2))
        return 0
    lines = [] if arguments.sweeps else _family_lines(word)
    if lines and sweeps:
        lines.append("\nsweeps, for tiltsim sweep:")
    lines += [_line(sweep, sweep.address) for sweep in sweeps]
    if not lines:
        raise InputError(f"{word}: in no address, title or source of the library")
    print("\n".join(lines))
    return 0


def _family_lines(word: str) -> list[str]:
    """The files that a word selects, each above its variants."""
    lines = []
    for family in library_families(word):
        width = max((len(member.address) for member in family.members), default=0)
        lines.append(_line(family.entry, family.entry.address))
        lines += [_line(member, f"  {member.address:<{width}}") for member in family.members]
    return lines


def _line(entry: Entry, address: str) -> str:
    line = f"{address}  {entry.title}" + (f" ({entry.source})" if entry.source else "")
    return fitted(printable(line), len(address) + 2 if address.startswith(" ") else 4)
