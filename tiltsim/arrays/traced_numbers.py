"""Traced numbers for lifted functions: they become programs."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from functools import partial, reduce
from typing import Any, Final

from tiltsim.arrays.lifting import Lifting
from tiltsim.arrays.values import Function
from tiltsim_controllers.code.blocks import take
from tiltsim_controllers.code.messages import TraceError
from tiltsim_controllers.code.program import InputVector, Program, trace_vectors
from tiltsim_controllers.code.tracing import (
    COMPOSED,
    Block,
    Expr,
    Graph,
    Number,
    as_real,
    graph_in_use,
    make,
)


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
}


LAZY_FROM: Final = 50
"""Operations that are skipped, rather than evaluated and dropped: a branch costs a few of them."""


class TracedNumbers:
    """Symbolic numbers as `tiltsim.arrays.values.Arrays`."""

    domains: Final[Mapping[Function, float]] = {}
    refusals = (TraceError,)
    functions = FUNCTIONS
    is_lazy = True
    both = staticmethod(partial(make, "and"))
    either = staticmethod(partial(make, "or"))
    negated = staticmethod(partial(make, "not"))
    take = staticmethod(take)

    def is_array(self, value: Any) -> bool:
        """Whether a value is known only when the program runs."""
        return isinstance(value, Expr)

    def __init__(self) -> None:
        self._joining: list[tuple[Number, Expr]] = []

    def where(self, condition: Number, yes: Number, no: Number) -> Number:
        """Select by a condition."""
        if self._joining and self._joining[-1][0] is condition:
            branch = self._joining[-1][1]
            for block, value in zip(branch.blocks, (yes, no)):
                block.results.append(as_real(value))
            return graph_in_use().add("get", [branch, len(branch.blocks[0].results) - 1])
        return make("where", condition, yes, no)

    def side(self) -> AbstractContextManager[Block]:
        """Collect operations in a block."""
        return graph_in_use().block()

    @contextmanager
    def joined(self, condition: Number, side: Block) -> Iterator[None]:
        """Make a branch of a block that is long enough."""
        if len(side.operations) < LAZY_FROM:
            self.keep(side)
            yield
            return
        self._joining.append(
            (condition, graph_in_use().add("branch", [condition], (side, Block())))
        )
        yield
        self._joining.pop()

    def keep(self, side: Block) -> None:
        """Append a block to the one around it."""
        graph_in_use().extend(side)

    def vector(self, values: Any) -> Any:
        """Numbers as they are."""
        return values


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
