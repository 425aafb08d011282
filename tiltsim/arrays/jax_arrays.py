"""JAX's arrays for lifted functions."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final

import numpy as np

from tiltsim.arrays.xla_flags import merges_loops
from tiltsim.system.optional import optional_package

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

        self.dtype, self._jax = dtype, jax
        self._separate: dict[Any, tuple[Function, list[Any]]] = {}
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

    def separately(self, function: Function, args: Any, key: Any) -> Any:
        """A call that XLA compiles on its own and does not merge into its caller.

        Where XLA `recomputes`, operations multiply over the stages of a solver: in a step of ode3
        to seven times the operations of one stage.

        Args:
            function: Depends on nothing but its arguments.
            args: Its arguments: arrays and other values, which may be nested.
            key: Equal for the same function.
        """
        from jax.experimental.xla_metadata import set_xla_metadata

        jax = self._jax
        leaves, tree = jax.tree.flatten(args)
        fixed = tuple(None if self.is_array(leaf) else leaf for leaf in leaves)
        key = key, tree, fixed
        if key not in self._separate:
            self._separate[key] = self._compiled_alone(function, tree, fixed)
        call, results = self._separate[key]
        with set_xla_metadata(inlineable="false"):
            made = iter(call(*filter(self.is_array, leaves)))
        values, tree = results[0]
        return jax.tree.unflatten(tree, [next(made) if v is None else v for v in values])

    def _compiled_alone(
        self, function: Function, tree: Any, fixed: tuple[Any, ...]
    ) -> tuple[Function, list[Any]]:
        """A function of the arrays among arguments, and how its results are arranged."""
        from jax.experimental.xla_metadata import set_xla_metadata

        results: list[Any] = []

        def call(*arrays: Any) -> list[Any]:
            following = iter(arrays)
            args = [next(following) if value is None else value for value in fixed]
            with set_xla_metadata(inlineable=None):  # calls within are merged
                found, shape = self._jax.tree.flatten(
                    function(*self._jax.tree.unflatten(tree, args))
                )
            results[:] = [([None if self.is_array(value) else value for value in found], shape)]
            return list(filter(self.is_array, found))

        return self._jax.jit(call), results

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
        """Python's ``min``, which keeps the first value if two are equal or one is NaN."""
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
