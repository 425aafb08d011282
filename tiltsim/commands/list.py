"""``tiltsim list``: prints the scenario library."""

from __future__ import annotations

import argparse
import json

from tiltsim.commands.options import Subparsers, add_json
from tiltsim.commands.text import fitted
from tiltsim.scenario.library import Entry, library_entries, library_families, library_sweeps
from tiltsim.system.text import printable


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """List the scenario library with titles and sources in the thesis. A line that
    begins with # is a variant of the file above it: tiltsim run 'FILE#VARIANT'."""
    summary = "list the scenario library"
    parser = subparsers.add_parser("list", help=summary, description=description)
    parser.add_argument("--sweeps", action="store_true", help="list only the sweeps")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print one line per file, with one per variant below it; sweeps at the end."""
    if arguments.json:
        entries = library_sweeps() if arguments.sweeps else library_entries()
        keys = ("sweep" if arguments.sweeps else "scenario", "title", "source")
        print(json.dumps([dict(zip(keys, entry)) for entry in entries], indent=2))
        return 0
    if not arguments.sweeps:
        _print_families()
        print("\nsweeps, for tiltsim sweep:")
    for sweep in library_sweeps():
        print(_line(sweep, sweep.address))
    return 0


def _print_families() -> None:
    for family in library_families():
        print(_line(family.entry, family.entry.address))
        width = max((len(member.address) for member in family.members), default=0)
        for member in family.members:
            print(_line(member, f"  {member.address:<{width}}"))


def _line(entry: Entry, address: str) -> str:
    line = f"{address}  {entry.title}" + (f" ({entry.source})" if entry.source else "")
    return fitted(printable(line), len(address) + 2 if address.startswith(" ") else 4)
