"""The measures of claims: functions for the expressions in the files of `tiltsim.report.claims`.

One module per subject. A measure returns a number, several numbers or a bool, computed within about
a second. A flight that terminates early has ``diverged`` true in its metrics and may lack others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

import numpy as np

from tiltsim.scenario.metric_names import METRICS


@cache
def measures() -> dict[str, Callable[..., Any]]:
    """All measures by name. Raises `ValueError` if two have the same."""
    found: dict[str, Callable[..., Any]] = {}
    for info in iter_modules(__path__):
        module = import_module(f"{__name__}.{info.name}")
        for name, value in vars(module).items():
            own = callable(value) and getattr(value, "__module__", "") == module.__name__
            if own and found.setdefault(name, value) is not value:
                raise ValueError(f"two measures have the name {name!r}")
    return found


def evaluate(expression: str, flown: Sequence[Mapping[str, float | bool]] = ()) -> Any:
    """The value of an expression of a claim, or of the text of a finding.

    Its names are metrics, arrays with a value per flight; ``flights``, a list of all their metrics;
    measures; and functions of NumPy. Raises `KeyError` if a flight lacks a metric.

    Args:
        expression: Such as ``all(diff(duration) > 0)``.
        flown: Metrics of the flights, in the order of the row.
    """

    def meaning(name: str) -> Any:
        if name in METRICS:
            return np.array([metrics[name] for metrics in flown])
        return flown if name == "flights" else measures().get(name) or getattr(np, name)

    code = compile(expression, expression, "eval")
    with np.errstate(divide="ignore", invalid="ignore"):
        return eval(code, {name: meaning(name) for name in code.co_names})
