"""``tiltsim schema``: the keys of the scenario or the sweep file, for editors and for people."""

import json
from typing import Any, Final

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"


def run(address: str | None = None, *, sweep: bool = False, markdown: bool = False) -> int:
    """Print the JSON Schema of the scenario file, with which editors complete TOML.

    With a table or key, print its keys for people.

    Args:
        address (TABLE): a table or key such as gait, gait.walk or simulation.duration, to read
        sweep: print the keys of the sweep file instead
        markdown: print all keys as a page, docs/scenario.md
    """
    from tiltsim.commands.key_tables import description, key_tables, page

    schema = sweep_schema() if sweep else scenario_schema()
    if address is not None:
        print(description(key_tables(schema), address))
    elif markdown:
        print(page(key_tables(schema)), end="")
    else:
        print(json.dumps(schema, indent=2))
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
    for key, value in schema["properties"].items():
        partial = {"type": "object", "description": value["description"]}
        whole = key in DESCRIPTIVE or value.get("type") == "array"
        variant["properties"][key] = value if whole else partial
    variant["additionalProperties"] = False
    schema["$defs"]["Variant"] = variant
    schema["properties"]["variant"] = {
        "type": "array",
        "items": {"$ref": "#/$defs/Variant"},
        "description": "a family of flights: each lists only what differs from the file's base",
    }
    return schema


def sweep_schema() -> dict[str, Any]:
    """The schema of a sweep file."""
    from tiltsim.sweeps.tables import Sweep

    schema = Sweep.model_json_schema()
    schema["title"] = "tiltsim sweep"
    schema["$schema"] = DIALECT
    return schema
