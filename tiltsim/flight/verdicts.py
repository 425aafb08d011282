"""Judging a flight by the bounds of its scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tiltsim.scenario.expectation import Expectation
    from tiltsim.scenario.scenario import Scenario


@dataclass(frozen=True)
class Verdict:
    """One expectation with the measured value, None where the flight has no such metric."""

    expectation: Expectation
    measured: float | bool | None

    @property
    def holds(self) -> bool:
        """Whether the measured value lies within the bounds."""
        value, wanted = self.measured, self.expectation
        if value is None or isnan(value):
            return False
        if wanted.equals is not None and value is not wanted.equals:
            return False
        if wanted.min is not None and value < wanted.min:
            return False
        return wanted.max is None or value <= wanted.max

    @property
    def bounds(self) -> str:
        """The bounds in words, such as ``-0.4 .. -0.36``."""
        wanted = self.expectation
        if wanted.equals is not None:
            return str(wanted.equals).lower()
        if wanted.min is None:
            return f"<= {wanted.max:g}"
        return f">= {wanted.min:g}" if wanted.max is None else f"{wanted.min:g} .. {wanted.max:g}"


def judge(scenario: Scenario, metrics: Mapping[str, float | bool]) -> list[Verdict]:
    """The verdict on every expectation of a scenario that speaks of its plant, in order."""
    return [
        Verdict(wanted, metrics.get(wanted.metric))
        for wanted in scenario.expect
        if wanted.plant in {None, scenario.simulation.plant}
    ]
