"""Traced numbers for lifted functions: they become programs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import partial, reduce
from typing import Any, Final

from tiltsim.arrays.lifting import Lifting
from tiltsim.arrays.values import Function
from tiltsim_controllers.code.blocks import take
from tiltsim_controllers.code.messages import TraceError
from tiltsim_controllers.code.program import InputVector, Program, trace_vectors
from tiltsim_controllers.code.tracing import COMPOSED, Expr, Graph, Number, make
from tiltsim_controllers.mathematics.noise import uniform


def _whole(value: Number) -> Number:
    """``int``, toward zero."""
    size = make("floor", make("abs", value))
    return make("where", make("lt", value, 0.0), make("neg", size), size)


def _smallest(*values: Any) -> Number:
    return reduce(COMPOSED["minimum"], values if len(values) > 1 else values[0])


def _largest(*values: Any) -> Number:
    return reduce(COMPOSED["maximum"], values if len(values) > 1 else values[0])


_NAMED: Final = (
    *(math.sin, math.cos, math.tan, math.asin, math.acos, math.atan, math.atan2),
    *(math.sqrt, math.exp, math.log, math.copysign, math.floor, math.fmod),
)

FUNCTIONS: Final[Mapping[Function, Function]] = {
    **{function: partial(make, function.__name__) for function in _NAMED},
    **{getattr(math, name): COMPOSED[name] for name in ("hypot", "isfinite", "isnan", "isinf")},
    math.fabs: partial(make, "abs"),
    abs: partial(make, "abs"),
    min: _smallest,
    max: _largest,
    int: _whole,
    float: lambda value: value,
    uniform: partial(make, "uniform"),
}


class TracedNumbers:
    """Symbolic numbers as `tiltsim.arrays.values.Arrays`."""

    domains: Final[Mapping[Function, float]] = {}
    refusals = (TraceError,)
    functions = FUNCTIONS
    where = staticmethod(partial(make, "where"))
    both = staticmethod(partial(make, "and"))
    either = staticmethod(partial(make, "or"))
    negated = staticmethod(partial(make, "not"))
    take = staticmethod(take)

    def is_array(self, value: Any) -> bool:
        """Whether a value is known only when the program runs."""
        return isinstance(value, Expr)

    def vector(self, values: Any) -> Any:
        """Numbers as they are."""
        return values

    def separately(self, function: Function, args: Any, key: Any) -> Any:
        """Call a function; an operation that occurs twice is evaluated once."""
        return function(*args)


def trace_scalar_code(
    function: Callable[[Lifting, tuple[InputVector, ...]], Iterable[Number]], **sizes: int
) -> Program:
    """Trace scalar functions.

    Args:
        function: ``(lifting, vectors) -> results``: lifts and calls them.
        sizes: Sizes of the input vectors, by name.
    """
    lifting = Lifting(TracedNumbers())
    return trace_vectors(
        lambda *vectors: function(lifting, vectors), sizes, Graph(locate=lambda: ("", 0))
    )
