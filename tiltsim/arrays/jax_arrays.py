"""JAX's arrays for lifted functions."""

import math
import operator
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final

import numpy as np

from tiltsim.arrays.xla_flags import merges_loops
from tiltsim.system.public import optional_package

Function = Callable[..., Any]


def require_jax(purpose: str) -> Any:
    """JAX. Raises `InputError`, which begins with the purpose, unless it is installed."""
    return optional_package("jax", purpose, "'tiltsim[jax]'")


def recomputes() -> bool:
    """Whether XLA computes an intermediate value again wherever it is used."""
    import jax

    return jax.default_backend() == "cpu" and not merges_loops()


class JaxArrays:
    """Arrays of JAX as `tiltsim.arrays.lifting.Arrays`.

    Args:
        dtype: "float64" or "float32".
    """

    domains: Final[Mapping[Function, float]] = {
        operator.truediv: 1.0,
        math.sqrt: 1.0,
        math.log: 1.0,
        math.asin: 0.0,
        math.acos: 0.0,
    }

    is_lazy = False  # a batch needs both sides

    def __init__(self, dtype: str) -> None:
        import jax
        import jax.numpy as jnp

        self.dtype = dtype
        # By the tuple's identity, which another one could get if the tuple were not kept.
        self._tables: dict[int, tuple[tuple[float, ...], Any]] = {}
        self._array, self._numpy = jax.Array, jnp
        self.where, self.both = jnp.where, jnp.logical_and
        self.either, self.negated = jnp.logical_or, jnp.logical_not
        self.functions = _functions()
        self.refusals = jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError

    def is_array(self, value: Any) -> bool:
        """Whether JAX computes a value."""
        return isinstance(value, self._array)

    def take(self, values: Any, index: Any) -> Any:
        """The entry of a vector at an index that is an array.

        All look-ups in a tuple of numbers are in one constant.
        """
        table = self._tables.get(id(values))
        if table is None and isinstance(values, tuple) and not any(map(self.is_array, values)):
            table = self._tables[id(values)] = values, np.asarray(values, self.dtype)
        return (self.vector(values) if table is None else self._numpy.asarray(table[1]))[index]

    def vector(self, values: Any) -> Any:
        """Numbers as an array of one dimension."""
        numpy = self._numpy
        if self.is_array(values):
            return values
        if not any(map(self.is_array, values)):
            return numpy.asarray(values, self.dtype)
        return numpy.stack([numpy.asarray(value, self.dtype) for value in values])


@cache
def _functions() -> dict[Function, Function]:
    import jax
    import jax.numpy as jnp

    def smallest(*values: Any) -> Any:
        """Python's ``min``, which prefers the first of equal values and of values with NaN."""
        first, *others = values if len(values) > 1 else values[0]
        for other in others:
            first = jnp.where(other < first, other, first)
        return first

    def largest(*values: Any) -> Any:
        first, *others = values if len(values) > 1 else values[0]
        for other in others:
            first = jnp.where(other > first, other, first)
        return first

    def whole(value: Any) -> Any:
        """A whole number, of which the lowest 32 bits count."""
        return jnp.asarray(value).astype(jnp.int64 if jax.config.jax_enable_x64 else jnp.uint32)

    names = ("sin", "cos", "tan", "atan2", "sqrt", "floor", "hypot", "copysign", "exp", "log")
    tests = ("isfinite", "isnan", "isinf", "fmod", "fabs")
    same = {getattr(math, name): getattr(jnp, name.replace("atan", "arctan")) for name in names}
    same |= {getattr(math, name): getattr(jnp, name) for name in tests}
    return same | {
        math.asin: jnp.arcsin,
        math.acos: jnp.arccos,
        math.atan: jnp.arctan,
        abs: jnp.abs,
        min: smallest,
        max: largest,
        round: jnp.round,
        int: whole,
        float: lambda value: jnp.asarray(value) * 1.0,
    }
