"""``tiltsim schema``: the JSON Schema of the scenario or the sweep file, for editors."""

from __future__ import annotations

import argparse
import json
from typing import Any


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "schema",
        help="print the JSON Schema of the scenario file",
        description="Print the JSON Schema of the scenario file; editors complete TOML with it.",
    )
    parser.add_argument("--sweep", action="store_true", help="the schema of the sweep file instead")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the schema."""
    from tiltsim.schema import scenario_schema, sweep_schema

    print(json.dumps(sweep_schema() if arguments.sweep else scenario_schema(), indent=2))
    return 0
