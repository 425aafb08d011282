"""`xp`: NumPy for laws that are traced, run on real arrays, or run on arrays of JAX."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final

import numpy as np

from tiltsim_controllers.code.tracing import UFUNCS, Array, Expr, apply, as_array


def is_jax(value: Any) -> bool:
    """Whether JAX computes a value."""
    return "jax" in sys.modules and isinstance(value, sys.modules["jax"].Array)


def is_known(value: Any) -> bool:
    """Whether a number is no symbolic one, so that it can be checked."""
    return not isinstance(value, Expr)


def as_number(value: Any) -> Any:
    """A number as a float; a symbolic one as it is."""
    return float(value) if is_known(value) else value


def numbers_in(values: Any) -> Iterator[Any]:
    """The numbers and arrays of nested tuples and lists."""
    if isinstance(values, tuple | list):
        for value in values:
            yield from numbers_in(value)
    else:
        yield values


class _Namespace:
    """NumPy, or `jax.numpy` where an argument is an array of JAX.

    It has NumPy's functions of numbers, matrix products, and functions that arrange entries.
    """

    __name__ = "xp"
    pi, nan, inf = math.pi, math.nan, math.inf

    def __getattr__(self, name: str) -> Callable[..., Any]:
        function = getattr(np, name)

        def call(*args: Any, **options: Any) -> Any:
            if any(map(is_jax, numbers_in(args))):
                import jax.numpy

                return getattr(jax.numpy, name)(*args, **options)
            if isinstance(function, np.ufunc) and any(isinstance(a, Expr) for a in args):
                return apply(UFUNCS[function], *args)
            return as_array(function(*args, **options))

        return call

    def where(self, condition: Any, yes: Any, no: Any) -> Any:
        """Entries of one array or of another, by a condition."""
        return self._selected("where", np.where, condition, yes, no)

    def clip(self, values: Any, low: Any, high: Any) -> Any:
        """Values within limits; NaN stays NaN."""
        return self.minimum(self.maximum(values, low), high)

    def array(self, values: Any) -> Any:
        """An array of numbers, vectors or matrices; one of JAX stays as it is."""
        if is_jax(values):
            return values
        if not isinstance(values, tuple | list | np.ndarray):
            values = [*values]  # a part of a program's input
        if "jax" in sys.modules and any(map(is_jax, numbers_in(values))):
            import jax.numpy

            return jax.numpy.array([*values])  # it takes no other sequences
        made = np.array(values)  # finds out faster whether there are symbolic numbers
        if made.dtype == object and any(isinstance(value, Expr) for value in made.flat):
            return made.view(Array)
        return made if made.dtype == float else np.array(values, float)

    def _selected(self, op: str, function: Callable[..., Any], *args: Any) -> Any:
        if any(map(is_jax, args)):
            import jax.numpy

            return getattr(jax.numpy, op)(*args)
        if any(isinstance(value, Expr | Array) for value in args):
            return apply(op, *args)
        return function(*args)[()]  # a number where all are numbers


xp: Final = _Namespace()

for _ufunc, _op in UFUNCS.items():
    if not hasattr(Expr, _ufunc.__name__):  # NumPy calls methods of the entries of plain arrays
        setattr(Expr, _ufunc.__name__, lambda *args, op=_op: apply(op, *args))


def flatten(value: Any) -> tuple[list[Any], Callable[[Iterable[Any]], Any]]:
    """The numbers of nested tuples, lists and arrays, and how to build the same from others."""
    if isinstance(value, tuple | list):
        parts = [flatten(entry) for entry in value]

        def build(leaves: Iterable[Any]) -> Any:
            rest = iter(leaves)
            built = [make([next(rest) for _ in own]) for own, make in parts]
            return type(value)(*built) if hasattr(value, "_fields") else type(value)(built)

        return [leaf for own, _ in parts for leaf in own], build
    if isinstance(value, np.ndarray):

        def build_array(leaves: Iterable[Any]) -> Any:
            return xp.array([*leaves]).reshape(value.shape)

        return list(value.ravel()), build_array
    return [value], lambda leaves: next(iter(leaves))
