"""``tiltsim list``: the scenario library."""

from __future__ import annotations

import argparse
import json
from typing import Any

from tiltsim.library import library_entries, library_families


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "list",
        help="list the scenario library",
        description="List the scenario library with titles and sources in the thesis. A line that "
        "begins with # is a variant of the file above it: tiltsim run 'FILE#VARIANT'.",
    )
    parser.add_argument("--json", action="store_true", help="machine-readable")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print a line a file, and one a variant below."""
    if arguments.json:
        entries = library_entries()
        keys = ("scenario", "title", "source")
        print(json.dumps([dict(zip(keys, entry)) for entry in entries], indent=2))
        return 0
    for family in library_families():
        name, title, source = family.entry
        print(f"{name}  {title}" + (f" ({source})" if source else ""))
        width = max((len(member.address) for member in family.members), default=0)
        for member in family.members:
            note = f" ({member.source})" if member.source else ""
            print(f"  {member.address:<{width}}  {member.title}{note}")
    return 0
