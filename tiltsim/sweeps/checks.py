"""Checks of a sweep before any of it is flown."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final

from tiltsim.scenario.metric_names import METRICS
from tiltsim.scenario.scenario import Scenario
from tiltsim.sweeps.definition import VERSIONS
from tiltsim.sweeps.expressions import names
from tiltsim.sweeps.points import SweepPoints

MAX_SEARCH: Final = 1_000_000
"""Maximum steps of a search at one point."""

VALUES_TRIED: Final = 1000
"""Maximum values of an axis that are checked before any is flown."""

RESERVED: Final = ("index", "end", "end_time", "cause", "scenario", "flights")
"""Columns of every dataset, in addition to metrics and versions."""


def check_points(points: SweepPoints) -> list[Scenario]:
    """Check the values of every axis, with the others at their first; return the scenarios.

    An axis with more values is tried at `VALUES_TRIED` of them, spread evenly, both ends included;
    mistakes in others appear in their rows. Raises `InputError` if a scenario is not valid.
    """
    _check_names(points)
    tried = points.along_each_group(VALUES_TRIED)
    for values in tried:
        _check_types(points, tried[0], values)
    bisect = points.sweep.bisect
    start = {} if bisect is None else {bisect.key: bisect.start}
    for values in tried:
        _check_search(points, values)
    return [points.scenario(values | start) for values in tried]


def _check_types(points: SweepPoints, first: Mapping[str, Any], values: Mapping[str, Any]) -> None:
    """Refuse tables as values, and values of another type than the first."""
    for key, value in values.items():
        if isinstance(value, dict):
            allowed = f"{key} is a table; vary its keys one by one"
            raise points.definition.mistake("axis.values", value, allowed)
    for key, value in values.items():
        if type(value) is not type(first[key]):
            both = [first[key], value]
            raise points.definition.mistake("axis.values", both, f"{key} changes its type")


def _check_search(points: SweepPoints, values: Mapping[str, Any]) -> None:
    """Refuse a search of too many steps."""
    bisect = points.sweep.bisect
    if bisect is None:
        return
    stop = points.stop(values)
    steps = abs(stop - bisect.start) / bisect.step
    if steps > MAX_SEARCH:
        allowed = f"{steps:.3g} steps to stop = {stop:g}; at most {MAX_SEARCH}"
        raise points.definition.mistake("bisect.step", bisect.step, allowed)


def _check_names(points: SweepPoints) -> None:
    """Refuse keys that no result could hold, or that nothing reads."""
    sweep, definition = points.sweep, points.definition
    read: set[str] = set()
    for column in (sweep.plot.x, sweep.plot.y, sweep.plot.lines, sweep.plot.panels):
        with suppress(ValueError):  # the name of a metric, or of no column
            read |= _names_in(column)
    rules: dict[str, Any] = {f"derive.{key}": rule for key, rule in sweep.derive.items()}
    rules |= {} if sweep.bisect is None else {"bisect.stop": sweep.bisect.stop}
    for key, rule in rules.items():
        try:
            read |= _names_in(rule)
        except ValueError as error:
            raise definition.mistake(key, rule, str(error)) from None
    targets = [key for axis in sweep.axis for key in axis.targets]
    targets += [sweep.bisect.key] if sweep.bisect is not None else []
    taken = {*RESERVED, *METRICS, *(f"{name}_version" for name in VERSIONS)}
    for key in (*targets, *sweep.derive):
        if key in taken:
            raise definition.mistake("axis.key", key, "is a column of every result; rename it")
    named = {axis.key for axis in points.cases}
    for key in targets:
        if "." not in key and key not in read | named:
            allowed = (
                "a name without a dot must be used in [derive] or [plot]; keys of the scenario "
                "have one, as gait.period"
            )
            raise definition.mistake("axis.key", key, allowed)
    for key in sweep.derive:
        if "." not in key:
            allowed = "must be a key of the scenario, as gait.angles"
            raise definition.mistake("derive", key, allowed)


def _names_in(rule: Any) -> set[str]:
    if isinstance(rule, list | tuple):
        return {name for entry in rule for name in _names_in(entry)}
    return names(rule) if isinstance(rule, str) else set()
