"""Checking a flight against the expectations of its scenario."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan

from tiltsim.scenario.expectation import Expectation
from tiltsim.scenario.scenario import Scenario


@dataclass(frozen=True)
class Verdict:
    """One expectation with the measured value, None where the flight does not have the metric."""

    expectation: Expectation
    measured: float | bool | None

    @property
    def holds(self) -> bool:
        """Whether the measured value lies within the bounds."""
        value, expected = self.measured, self.expectation
        if value is None or isnan(value):
            return False
        if expected.equals is not None and value is not expected.equals:
            return False
        if expected.min is not None and value < expected.min:
            return False
        return expected.max is None or value <= expected.max

    @property
    def bounds(self) -> str:
        """The bounds as text, such as ``-0.4 .. -0.36``."""
        low, high, equals = self.expectation.min, self.expectation.max, self.expectation.equals
        if equals is not None:
            return str(equals).lower()
        if low is None:
            return f"<= {high:g}"
        return f">= {low:g}" if high is None else f"{low:g} .. {high:g}"


def check_expectations(scenario: Scenario, metrics: Mapping[str, float | bool]) -> list[Verdict]:
    """The verdict on every expectation of a scenario that applies to its plant, in order."""
    return [
        Verdict(expected, metrics.get(expected.metric))
        for expected in scenario.expect
        if expected.plant in {None, scenario.simulation.plant}
    ]
