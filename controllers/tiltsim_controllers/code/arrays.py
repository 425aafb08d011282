"""`xp`: NumPy for functions that are traced or run on real arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, Final

import numpy as np

from tiltsim_controllers.code.tracing import UFUNCS, Array, Expr, apply, as_array


def is_known(value: Any) -> bool:
    """Whether a number is no symbolic one, so that it can be checked."""
    return not isinstance(value, Expr)


def as_number(value: Any) -> Any:
    """A number as a float; a symbolic one as it is."""
    return float(value) if is_known(value) else value


class _Namespace:
    """NumPy, also for symbolic numbers.

    It has NumPy's functions of numbers, matrix products, and functions that arrange entries.
    """

    __name__ = "xp"
    pi, nan, inf = math.pi, math.nan, math.inf

    def __getattr__(self, name: str) -> Callable[..., Any]:
        function = getattr(np, name)

        def call(*args: Any, **options: Any) -> Any:
            if isinstance(function, np.ufunc) and any(isinstance(a, Expr) for a in args):
                return apply(UFUNCS[function], *args)
            return as_array(function(*args, **options))

        return call

    def where(self, condition: Any, yes: Any, no: Any) -> Any:
        """Entries of one array or of another, by a condition."""
        if any(isinstance(value, Expr | Array) for value in (condition, yes, no)):
            return apply("where", condition, yes, no)
        return np.where(condition, yes, no)[()]  # a number where all are numbers

    def clip(self, values: Any, low: Any, high: Any) -> Any:
        """Values within limits; NaN stays NaN."""
        return self.minimum(self.maximum(values, low), high)

    def array(self, values: Any) -> Any:
        """An array of numbers, vectors or matrices."""
        if not isinstance(values, tuple | list | np.ndarray):
            values = [*values]  # a part of a program's input
        made = np.array(values)  # finds out faster whether there are symbolic numbers
        if made.dtype == object and any(isinstance(value, Expr) for value in made.flat):
            return made.view(Array)
        return made if made.dtype == float else np.array(values, float)


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
