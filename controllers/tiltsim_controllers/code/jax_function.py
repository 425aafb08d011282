"""Programs as functions of JAX: operations on numbers, which XLA joins into few loops."""

import operator
import sys
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from tiltsim_controllers.code.operations import OPERATIONS, WORD, hash_word
from tiltsim_controllers.code.program import Program, operations_of
from tiltsim_controllers.code.tracing import Block, Expr

_OPERATORS: Final[dict[str, Callable[..., Any]]] = {
    name: getattr(operator, name)
    for name in ("add", "sub", "mul", "neg", "lt", "le", "gt", "ge", "eq", "ne")
} | {"div": operator.truediv, "and": operator.and_, "or": operator.or_, "not": operator.invert}

SEGMENT: Final = 60
"""Operations that XLA compiles together where it computes a value again for every use."""


def results_in_jax(
    program: Program, vectors: Sequence[Any], dtype: str, *, in_segments: bool
) -> list[Any]:
    """The results of a program: arrays without dimensions, and floats that no input decides.

    Both sides of a branch, and loops with a known count, have derivatives in both modes.

    Args:
        program: The program.
        vectors: Its inputs: arrays of one dimension, or sequences of arrays without dimensions.
        dtype: "float64" or "float32".
        in_segments: Whether to keep XLA from computing intermediate values once per use.
    """
    run = _Evaluation(vectors, dtype, in_segments=in_segments)
    results = zip(program.block.results, run.block(program.block), strict=True)
    return [run.floating(value) if isinstance(made, Expr) else made for made, value in results]


def _uses(operations: Sequence[Expr]) -> set[int]:
    """Numbers that operations use, blocks within included."""
    used: set[int] = set()
    made: set[int] = set()
    for operation in operations:
        for inner in (operation, *(o for block in operation.blocks for o in operations_of(block))):
            values = [*inner.args, *(value for block in inner.blocks for value in block.results)]
            used.update(value.number for value in values if isinstance(value, Expr))
        made.update(o.number for block in operation.blocks for o in operations_of(block))
    return used - made


class _Evaluation:
    def __init__(self, vectors: Sequence[Any], dtype: str, *, in_segments: bool) -> None:
        self._jax, self._vectors, self._dtype = sys.modules["jax"], vectors, dtype
        self._numpy = self._jax.numpy
        self._values: dict[int, Any] = {}
        self._tables: list[Any] = []
        self._in_segments = in_segments

    def floating(self, value: Any) -> Any:
        """A number as an array of the precision."""
        return self._numpy.asarray(value, self._dtype)

    def value(self, number: Any) -> Any:
        """JAX's value of a number."""
        return self._values[number.number] if isinstance(number, Expr) else number

    def block(self, block: Block) -> list[Any]:
        """The results of a block, whose operations are evaluated."""
        operations = [operation for operation in block.operations if operation.op != "phi"]
        size = SEGMENT if self._in_segments else max(1, len(operations))
        segments = [operations[i : i + size] for i in range(0, len(operations), size)]
        if len(segments) == 1:
            self._evaluate(operations)
            segments = []
        needed = {result.number for result in block.results if isinstance(result, Expr)}
        live: list[list[Expr]] = []
        for segment in reversed(segments):
            live.append([made for made in segment if made.number in needed])
            needed |= _uses(segment)
        for segment, later in zip(segments, reversed(live), strict=True):
            self._separately(segment, later)
        return [self.value(result) for result in block.results]

    def _evaluate(self, operations: Sequence[Expr]) -> None:
        for operation in operations:
            self._values[operation.number] = self._operation(operation)

    def _separately(self, operations: Sequence[Expr], live: Sequence[Expr]) -> None:
        """Evaluate operations in a call, which XLA compiles on its own and does not merge."""
        from jax.experimental.xla_metadata import set_xla_metadata

        made = {operation.number for operation in operations}
        known = {use: self._values[use] for use in _uses(operations) - made}
        arrays = {use: value for use, value in known.items() if isinstance(value, self._jax.Array)}
        vectors = self._vectors

        def call(vectors: Sequence[Any], arrays: dict[int, Any]) -> list[Any]:
            self._vectors = vectors
            self._values |= arrays
            with set_xla_metadata(inlineable=None):  # calls within are merged
                self._evaluate(operations)
                return [self.value(operation) for operation in live]

        with set_xla_metadata(inlineable="false"):
            results = self._jax.jit(call)(vectors, arrays)
        self._vectors = vectors
        self._values |= arrays
        self._values |= {one.number: value for one, value in zip(live, results, strict=True)}

    def _operation(self, operation: Expr) -> Any:
        op, args = operation.op, operation.args
        if op == "in":
            return self._vectors[args[0]][args[1]]
        if op == "get":
            return self._values[args[0].number][args[1]]
        if op == "take_input":
            place, argument, first = args
            return self._entry(self._vector(self._vectors[argument]), self.value(place), first)
        if op == "take":
            return self._entry(*self._table(args[1:], self.value(args[0])))
        if op == "branch":
            return self._branch(operation)
        if op == "loop":
            return self._loop(operation)
        values = [self.value(argument) for argument in args]
        if op == "where":
            return self._numpy.where(*values)
        if op == "uniform":
            return self._uniform(values)
        if op in _OPERATORS:
            return _OPERATORS[op](*values)
        ufunc = OPERATIONS[op].ufunc
        assert ufunc is not None  # all others are above
        return getattr(self._numpy, ufunc.__name__)(*values)

    def _uniform(self, integers: Sequence[Any]) -> Any:
        """A draw of `tiltsim_controllers.code.operations.uniform`."""
        whole = self._numpy.int64 if self._jax.config.jax_enable_x64 else self._numpy.uint32
        word = whole(0)
        for integer in integers:
            number = self._numpy.asarray(integer).astype(whole)
            word = hash_word((word + number) & whole(WORD), whole)
        return (word + 0.5) / 4294967296.0

    def _vector(self, values: Any) -> Any:
        """Numbers as an array of one dimension."""
        if isinstance(values, self._jax.Array):
            return values
        return self._numpy.stack([self.floating(value) for value in values])

    def _entry(self, vector: Any, place: Any, first: int = 0) -> Any:
        return vector[self._numpy.asarray(place).astype("int32") + first]

    def _table(self, entries: Sequence[Any], place: Any) -> tuple[Any, Any, int]:
        """A table of numbers, of which columns that begin later are parts."""
        values = [self.value(entry) for entry in entries]
        if any(isinstance(value, self._jax.Array) for value in values):
            return self._vector(values), place, 0
        made = np.array(values, self._dtype)
        for table in self._tables:
            first = len(table) - len(made)
            if first >= 0 and np.array_equal(table[first:], made, equal_nan=True):
                return self._numpy.asarray(table), place, first
        self._tables.append(made)
        return self._numpy.asarray(made), place, 0

    def _branch(self, operation: Expr) -> Any:
        def side(block: Block) -> Callable[[], list[Any]]:
            return lambda: [self.floating(value) for value in self.block(block)]

        condition = self._numpy.asarray(self.value(operation.args[0]), bool)
        return self._jax.lax.cond(condition, *map(side, operation.blocks))

    def _loop(self, operation: Expr) -> Any:
        """A loop of a known count makes all turns, so that it has derivatives in reverse mode."""
        lax, (test, inner) = self._jax.lax, operation.blocks
        count, *start = (self.value(argument) for argument in operation.args)

        def stops(turn: Any, now: Sequence[Any]) -> Any:
            parameters = zip(test.parameters, [self.floating(turn), *now], strict=True)
            self._values |= {made.number: value for made, value in parameters}
            (stopped,) = self.block(test)
            return self._numpy.asarray(stopped, bool)

        def body() -> list[Any]:
            return [self.floating(value) for value in self.block(inner)]

        first = [self.floating(value) for value in start]
        if isinstance(count, float):

            def one(turn: Any, now: list[Any]) -> list[Any]:
                return lax.cond(stops(turn, now), lambda: now, body)

            return lax.fori_loop(0, int(np.ceil(count)), one, first)
        return lax.while_loop(
            lambda carried: (carried[0] < count) & ~stops(*carried),
            lambda carried: (stops(*carried), (carried[0] + 1.0, body()))[1],
            (self.floating(0.0), first),
        )[1]
