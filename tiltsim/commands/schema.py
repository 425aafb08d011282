"""``tiltsim schema``: prints the JSON Schema of the scenario or the sweep file, for editors."""

from __future__ import annotations

import argparse
import json
from typing import Any, Final

from tiltsim.commands.options import Subparsers

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "schema",
        help="print the JSON Schema of the scenario file",
        description="Print the JSON Schema of the scenario file, with which editors complete TOML.",
    )
    parser.add_argument("--sweep", action="store_true", help="the schema of the sweep file instead")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the schema."""
    print(json.dumps(sweep_schema() if arguments.sweep else scenario_schema(), indent=2))
    return 0


def scenario_schema() -> dict[str, Any]:
    """The schema of a scenario file: a base, and variants that may change any of its tables.

    A variant lists only the differences from the base, so that only its name is required.
    """
    from tiltsim.scenario.scenario import Scenario, Variant
    from tiltsim.scenario.scenario_tables import DESCRIPTIVE

    schema = Scenario.model_json_schema()
    schema["title"] = "tiltsim scenario"
    schema["$schema"] = DIALECT
    variant = Variant.model_json_schema()
    variant["properties"] |= {
        key: value if key in {*DESCRIPTIVE, "disturbance"} else {"type": "object"}
        for key, value in schema["properties"].items()
    }
    variant["additionalProperties"] = False
    schema["$defs"]["Variant"] = variant
    schema["properties"]["variant"] = {"type": "array", "items": {"$ref": "#/$defs/Variant"}}
    return schema


def sweep_schema() -> dict[str, Any]:
    """The schema of a sweep file."""
    from tiltsim.sweeps.tables import Sweep

    schema = Sweep.model_json_schema()
    schema["title"] = "tiltsim sweep"
    schema["$schema"] = DIALECT
    return schema
