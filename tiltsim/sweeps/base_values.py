"""The values of a sweep's base scenario, which relative axes multiply."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from tiltsim.scenario.loading import parse_scenario
from tiltsim.scenario.messages import show
from tiltsim.scenario.override_keys import split_key
from tiltsim.scenario.vehicle import VehicleTable
from tiltsim.sweeps.definition import SweepDefinition
from tiltsim.system.numbers import is_number


class BaseValues:
    """Looks up and scales values of a sweep's base scenario, those of presets included."""

    def __init__(self, definition: SweepDefinition) -> None:
        self._definition = definition

    @cached_property
    def _known(self) -> dict[str, Any]:
        """The base with the vehicle's preset written out."""
        base = self._definition.base
        scenario = parse_scenario(base)
        if not isinstance(scenario.vehicle, VehicleTable):
            return base
        vehicle = scenario.vehicle.resolve()._asdict()
        inertia = [vehicle.pop(f"inertia_{axis}") for axis in ("xx", "yy", "zz")]
        numbers = {**vehicle, "inertia": inertia}
        return {**base, "vehicle": {**numbers, **base["vehicle"]}}

    def look_up(self, key: str) -> Any:
        """The value of a dotted key, or None."""
        value: Any = self._known
        for step in split_key(key):
            inside = isinstance(value, dict) and step in value
            listed = isinstance(value, list) and isinstance(step, int) and step < len(value)
            if not (inside or listed):
                return None
            value = value[step]
        return value

    def scaled(self, factors: Mapping[str, Any]) -> dict[str, Any]:
        """Base values times factors, by key. Raises `InputError` where either is not numeric."""
        return {key: self._scaled(key, factor) for key, factor in factors.items()}

    def _scaled(self, key: str, factor: Any) -> Any:
        base = self.look_up(key)
        if not is_number(factor):
            raise self._definition.mistake("axis.values", factor, "relative values are numbers")
        if is_number(base):
            return float(base * factor)
        if isinstance(base, list) and all(map(is_number, base)):
            return [float(value * factor) for value in base]
        allowed = f"{key} = {show(base)} in the base scenario is not a number"
        raise self._definition.mistake("axis.relative", True, allowed)
