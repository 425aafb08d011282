"""The multipliers of a gait over its period, or over any other number."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from math import log
from typing import Any, Final

from tiltsim.errors import InputError
from tiltsim.linear.stability import Stability, stability
from tiltsim.scenario.scenario import Scenario

ON_AXIS: Final = 1e-6
"""Multipliers with a smaller imaginary part are real."""


@dataclass(frozen=True)
class Point:
    """A value of the key and its result."""

    value: float
    found: Stability | None  # None where there is no orbit
    reason: str = ""  # why there is none

    @property
    def largest(self) -> float | None:
        """The size of the largest multiplier; of a rest point, in one second."""
        return None if self.found is None else self.found.growth

    def report(self) -> dict[str, Any]:
        """As JSON."""
        report: dict[str, Any] = {"value": self.value, "largest": self.largest}
        if self.found is None:
            return {**report, "stable": None, "multipliers": None, "reason": self.reason}
        of_it = self.found.report()
        return {**report, **{key: of_it.get(key) for key in ("stable", "multipliers", "poles")}}


@dataclass(frozen=True)
class Crossing:
    """A value at which the largest multiplier leaves or enters the unit circle."""

    value: float
    leaves: bool  # for larger values, else it enters
    how: str

    def report(self) -> dict[str, Any]:
        """As JSON."""
        return dict(vars(self))


def sweep_stability(
    scenario: Scenario,
    key: str,
    values: Iterable[float],
    seen: Callable[[Point], None] = lambda _point: None,
) -> list[Point]:
    """The stability for each value of a key.

    An orbit is followed from value to value: where several exist, it is the same one as long as it
    changes steadily, also where it has become unstable and no flight approaches it.

    Args:
        scenario: The scenario.
        key: Dotted, of a number.
        values: For the key.
        seen: Called with each point when it is found.
    """
    points: list[Point] = []
    last: Stability | None = None
    every = [(value, scenario.replace({key: value})) for value in values]  # refused: a mistake
    for value, changed in every:
        try:
            last = stability(changed, near=last)
            point = Point(value, last)
        except InputError as error:
            point = Point(value, None, str(error))
        points.append(point)
        seen(point)
    return points


def crossings(points: Iterable[Point]) -> list[Crossing]:
    """Where the largest multiplier crosses the unit circle, between points of a sweep."""
    found = []
    for before, after in pairwise(points):
        low, high = before.largest, after.largest
        if low is None or high is None or (low > 1.0) == (high > 1.0):
            continue
        share = log(low) / (log(low) - log(high))
        outside = before if low > 1.0 else after
        assert outside.found is not None  # it has a largest multiplier
        value = before.value + share * (after.value - before.value)
        found.append(Crossing(value, high > 1.0, _how(outside.found)))
    return found


def _how(found: Stability) -> str:
    if found.multipliers is None:
        pole = max(found.poles, key=lambda value: value.real) if found.poles is not None else 0.0
        return "at a rest point, with a swing" if abs(pole.imag) > ON_AXIS else "at a rest point"
    largest = complex(found.multipliers[0])
    if abs(largest.imag) > ON_AXIS:
        return "as a pair: a slow swing about the orbit"
    if largest.real < 0.0:
        return "at -1: the orbit's period doubles"
    return "at +1: it leaves the orbit to one side"
