"""``tiltsim list``: the scenario library."""

from __future__ import annotations

import argparse
import json
from typing import Any

from tiltsim.library import library_entries, library_sweeps


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "list",
        help="list the scenario library",
        description="List the scenario library with titles and sources in the thesis.",
    )
    parser.add_argument("--sweeps", action="store_true", help="the sweeps alone")
    parser.add_argument("--json", action="store_true", help="machine-readable")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print one line a scenario or sweep."""
    entries = list(library_sweeps() if arguments.sweeps else library_entries())
    if arguments.json:
        keys = ("sweep" if arguments.sweeps else "scenario", "title", "source")
        print(json.dumps([dict(zip(keys, entry)) for entry in entries], indent=2))
        return 0
    _print(entries)
    if not arguments.sweeps:
        print("\nsweeps, for tiltsim sweep:")
        _print(list(library_sweeps()))
    return 0


def _print(entries: list[tuple[str, str, str]]) -> None:
    width = max((len(address) for address, _, _ in entries), default=0)
    for address, title, source in entries:
        print(f"{address:<{width}}  {title}" + (f" ({source})" if source else ""))
