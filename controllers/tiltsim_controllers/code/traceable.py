"""Mark functions of NumPy arrays that scalar code may call and that are traced as they are."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any, TypeVar

import numpy as np

from tiltsim_controllers.code.arrays import is_jax, xp
from tiltsim_controllers.code.program import InputVector

Function = TypeVar("Function", bound=Callable[..., Any])


def traceable(function: Function) -> Function:
    """Let scalar code call a function of arrays, with tuples for arrays.

    The function runs as it is on real arrays, on arrays of traced numbers and on arrays of JAX: it
    uses arithmetic, `xp` and the blocks of `tiltsim_controllers.code.blocks`, no ``if`` on a number
    that may be traced, and no assignment to an entry of an array. Given a tuple or a list, it
    returns tuples, as scalar code expects; given arrays, it returns arrays. An input of a program
    arrives as an array, but for an argument named ``knots``: look-ups read that by index.
    """
    names = tuple(signature(function).parameters)

    def given(name: str, value: Any) -> Any:
        if isinstance(value, InputVector) and name != "knots":
            return xp.array(value)
        return as_arrays(value)

    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        options = {name: given(name, value) for name, value in options.items()}
        with np.errstate(all="ignore"):  # infinity and NaN, as in a program
            result = function(*map(given, names, args), **options)
        return as_tuples(result) if any(map(_is_plain, args)) else result

    call.is_traceable = True  # type: ignore[attr-defined]
    return call  # type: ignore[return-value]


def is_traceable(function: object) -> bool:
    """Whether `traceable` marked a function."""
    return getattr(function, "is_traceable", False)


def _is_plain(value: Any) -> bool:
    return isinstance(value, tuple | list) and not hasattr(value, "_fields")


def as_arrays(value: Any) -> Any:
    """Tuples and lists of numbers as arrays, also in records; tuples of ints are indices."""
    if not isinstance(value, tuple | list):
        return value
    if hasattr(value, "_fields"):
        return type(value)(*map(as_arrays, value))
    if value and all(isinstance(entry, int) for entry in value):
        return value
    return xp.array(value)


def as_tuples(value: Any) -> Any:
    """Arrays as tuples of numbers, also in tuples and records."""
    if isinstance(value, np.ndarray | np.generic) and value.dtype != object:
        value = value.tolist()  # Python's floats
    elif isinstance(value, np.ndarray) or is_jax(value):
        return tuple(map(as_tuples, value)) if value.ndim else value
    if isinstance(value, tuple | list):
        entries = map(as_tuples, value)
        return type(value)(*entries) if hasattr(value, "_fields") else tuple(entries)
    return float(value) if isinstance(value, np.floating) else value
