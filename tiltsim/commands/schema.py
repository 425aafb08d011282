"""``tiltsim schema``: the JSON Schema of the scenario file, for editors."""

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
    parser.set_defaults(run=run)


def run(_arguments: argparse.Namespace) -> int:
    """Print the schema."""
    from tiltsim.schema import scenario_schema

    print(json.dumps(scenario_schema(), indent=2))
    return 0
