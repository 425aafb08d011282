"""The measures of claims: functions for the expressions in the files of `tiltsim.report.claims`.

One module per subject. A measure returns a number, several numbers or a bool, computed within about
a second. A flight that terminates early has ``diverged`` true in its metrics and may lack others.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from math import comb
from pkgutil import iter_modules
from typing import Any, Final

import numpy as np

from tiltsim.scenario.metric_names import METRICS
from tiltsim_controllers.analysis import (
    attainable,
    published_gaits,
    singularity,
    two_color_map,
    two_color_planner,
)
from tiltsim_controllers.laws import gains
from tiltsim_controllers.tilt_car import cycles
from tiltsim_controllers.vehicle.parameters import PRESETS

LIBRARY: Final = (
    attainable,
    published_gaits,
    singularity,
    two_color_map,
    two_color_planner,
    gains,
    cycles,
)
"""Modules whose names expressions may use."""


@cache
def measures() -> dict[str, Any]:
    """All measures, and constants of their modules, by name. Raises `ValueError` if two differ."""
    found: dict[str, Any] = {}
    for info in iter_modules(__path__):
        module = import_module(f"{__name__}.{info.name}")
        for name, value in vars(module).items():
            own = getattr(value, "__module__", "") == module.__name__ and callable(value)
            shared = name.isupper() and not name.startswith("_")
            if (own or shared) and found.setdefault(name, value) is not value:
                raise ValueError(f"two measures have the name {name!r}")
    return found


def evaluate(expression: str, flown: Sequence[Mapping[str, float | bool]] = ()) -> Any:
    """The value of an expression of a claim, or of the text of a finding.

    Its names are metrics, arrays with a value per flight; ``flights``, a list of all their metrics;
    measures; vehicles by their presets; functions of Python and NumPy; and all of `LIBRARY`.
    Raises `KeyError` if a flight lacks a metric.

    Args:
        expression: Such as ``all(diff(duration) > 0)``.
        flown: Metrics of the flights, in the order of the row.
    """
    tree = ast.parse(expression, mode="eval")
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    own: dict[str, Any] = {"flights": flown, "comb": comb, **PRESETS, **measures()}
    places = (own, vars(np), *map(vars, LIBRARY))
    known = {name: place[name] for place in reversed(places) for name in names if name in place}
    for name in names & METRICS.keys():
        known[name] = np.array([metrics[name] for metrics in flown])
    with np.errstate(divide="ignore", invalid="ignore"):
        return eval(compile(tree, expression, "eval"), known)
