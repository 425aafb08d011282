"""Functions of NumPy arrays: called with tuples, and traced."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any, Final, TypeVar

import numpy as np

from tiltsim_controllers.code.arrays import flatten, xp
from tiltsim_controllers.code.program import InputVector, Program, trace_vectors
from tiltsim_controllers.code.tracing import Graph

Function = TypeVar("Function", bound=Callable[..., Any])


def traceable(function: Function) -> Function:
    """Let a function of arrays be called with tuples for arrays.

    The function runs as it is on real arrays and on arrays of traced numbers: it uses arithmetic,
    `xp` and the blocks of `tiltsim_controllers.code.blocks`, no ``if`` on a number that may be
    traced, and no assignment to an entry of an array. Given tuples or lists and no array, it
    returns tuples; given an array, it returns arrays. An input of a program arrives as an array,
    but for an argument named ``knots``: look-ups read that by index.
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
        plain = any(map(_is_plain, args)) and not any(isinstance(a, np.ndarray) for a in args)
        return as_tuples(result) if plain else result

    return call  # type: ignore[return-value]


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
    elif isinstance(value, np.ndarray):
        return tuple(map(as_tuples, value)) if value.ndim else value
    if isinstance(value, tuple | list):
        entries = map(as_tuples, value)
        return type(value)(*entries) if hasattr(value, "_fields") else tuple(entries)
    return float(value) if isinstance(value, np.floating) else value


USER: Final = "user"
"""An input of programs: parameters and knots, which a function reads by index."""


def program_of(function: Callable[..., Any], **sizes: int) -> Program:
    """Trace a function of arrays, whose operations know no line of code.

    Args:
        function: Takes an array for each input, but the input itself for `USER`; returns numbers,
            arrays and tuples of them.
        sizes: Sizes of the inputs, by name.
    """

    def traced(*vectors: InputVector) -> list[Any]:
        inputs = zip(sizes, vectors, strict=True)
        given = [vector if name == USER else xp.array(vector) for name, vector in inputs]
        return flatten(function(*given))[0]

    return trace_vectors(traced, sizes, Graph(locate=lambda: ("", 0)))
