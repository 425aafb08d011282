"""Mark the functions that must run on plain floats and, unchanged, in native code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

Function = TypeVar("Function", bound=Callable[..., Any])

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Quad = tuple[float, float, float, float]
Octet = tuple[float, float, float, float, float, float, float, float]
Values = tuple[float, ...]
Vector = Sequence[float]
Floats = npt.NDArray[np.float64]

_registry: list[Callable[..., Any]] = []


def scalar(function: Function) -> Function:
    """Register ``function`` as scalar code and return it unchanged.

    Scalar code works on floats, tuples of floats and parameter records; it uses only arithmetic,
    comparisons, the ``math`` module and other scalar functions. Called from Python it is ordinary
    Python; for machine code the same source is traced (`tiltsim_controllers.code`).
    """
    _registry.append(function)
    return function


def affine_in(argument: str) -> Callable[[Function], Function]:
    """Mark a function that plans, whose values are affine in the points of an argument.

    It is not lifted to arrays but evaluated at plain points, which give its matrix.
    """

    def mark(function: Function) -> Function:
        function.affine_in = argument  # type: ignore[attr-defined]
        return function

    return mark


def scalar_functions() -> tuple[Callable[..., Any], ...]:
    """All functions registered so far, callees before their callers."""
    return tuple(_registry)


def is_scalar(function: object) -> bool:
    """Whether a function is registered."""
    return any(function is known for known in _registry)


@scalar
def clipped(value: float, low: float, high: float) -> float:
    """Limit ``value`` to the interval from ``low`` to ``high``; NaN stays NaN."""
    if value < low:
        return low
    return high if value > high else value
