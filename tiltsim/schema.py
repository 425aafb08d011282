"""The JSON Schemas of scenario and sweep files, from the same models that validate them."""

from __future__ import annotations

from typing import Any

from tiltsim.scenario import Scenario, Variant


def scenario_schema() -> dict[str, Any]:
    """The schema of a scenario file: a base, and variants that may change any of its tables.

    A variant names only what differs from the base, so nothing in it is required but its name.
    """
    schema = Scenario.model_json_schema()
    schema["title"] = "tiltsim scenario"
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    variant = Variant.model_json_schema()
    variant["properties"] |= {
        key: value if key in {"title", "source", "expect", "disturbance"} else {"type": "object"}
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
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    return schema
