"""A scenario with all defaults filled in, as a TOML document."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import tomli_w

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario


def scenario_toml(scenario: Scenario) -> str:
    """A scenario with all defaults filled in, as TOML that reads back to the same scenario."""
    document = without_none(scenario.model_dump(mode="json"))
    return tomli_w.dumps(document)


def without_none(value: Any) -> Any:
    """A document without the keys whose value is None, which TOML cannot express."""
    if isinstance(value, dict):
        return {key: without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [without_none(item) for item in value]
    return value
