"""Programs: functions as straight lines of operations on named vectors."""

from __future__ import annotations

import linecache
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, overload

from tiltsim_controllers.code.messages import TraceError
from tiltsim_controllers.code.tracing import Block, Expr, Graph, Number, as_real, tracing_into


class Input(NamedTuple):
    """A vector that a program reads."""

    name: str
    size: int


class Program(NamedTuple):
    """A traced function."""

    inputs: tuple[Input, ...]  # its arguments
    block: Block  # its operations; their results are the program's, in order

    def __len__(self) -> int:
        """Number of operations."""
        return sum(1 for _ in operations_of(self.block))


def operations_of(block: Block) -> Iterator[Expr]:
    """All operations, blocks within included."""
    for operation in block.operations:
        yield operation
        for inner in operation.blocks:
            yield from operations_of(inner)


class InputVector(Sequence[Number]):
    """An argument of a traced function, or a part of it; entries become inputs when they are read.

    Args:
        graph: The graph that reads them.
        argument: Number of the argument.
        first, size: The part of it.
    """

    def __init__(self, graph: Graph, argument: int, first: int, size: int) -> None:
        self._graph, self.argument, self.first, self._size = graph, argument, first, size

    def __len__(self) -> int:
        return self._size

    @overload
    def __getitem__(self, index: int) -> Number: ...

    @overload
    def __getitem__(self, index: slice) -> InputVector: ...

    def __getitem__(self, index: int | slice) -> Any:
        if isinstance(index, slice):
            first, last, step = index.indices(self._size)
            if step != 1:
                raise IndexError("an input has no slices with a step")
            return InputVector(self._graph, self.argument, self.first + first, max(0, last - first))
        if not -self._size <= index < self._size:
            raise IndexError(f"entry {index} of an input of size {self._size}")
        key = ("in", self.argument, self.first + index % self._size)
        outermost = self._graph.scopes[0]
        found = outermost.known.get(key)
        if found is None:
            found = self._graph.add("in", key[1:])
            if self._graph.scopes[-1] is not outermost:  # an input is equal in every block
                self._graph.scopes[-1].operations.pop()
                outermost.operations.insert(0, found)
            outermost.known[key] = found
        return found


def trace_vectors(
    function: Callable[..., Any], sizes: dict[str, int], graph: Graph | None = None
) -> Program:
    """Trace a function that takes an `InputVector` per size by name, and returns numbers."""
    graph = graph or Graph()
    with tracing_into(graph):
        vectors = [InputVector(graph, k, 0, size) for k, size in enumerate(sizes.values())]
        graph.scopes[0].results = [as_real(value) for value in function(*vectors)]
    block = graph.scopes[0]
    _remove_unused(block)
    _check_scopes(block, set())
    return Program(tuple(Input(*item) for item in sizes.items()), block)


def _remove_unused(block: Block) -> None:
    """Drop operations on which no result depends."""
    needed: set[int] = set()

    def need(values: Sequence[Any]) -> None:
        for value in values:
            if type(value) is Expr:
                needed.add(value.number)

    def visit(block: Block) -> None:
        need(block.results)
        kept = []
        for operation in reversed(block.operations):
            if operation.number not in needed and operation.op != "phi":
                continue
            for inner in reversed(operation.blocks):
                visit(inner)
            need(operation.args)
            kept.append(operation)
        block.operations[:] = reversed(kept)

    visit(block)


def _check_scopes(block: Block, before: set[int]) -> None:
    """Raise `TraceError` where a number is used outside the branch or loop that computes it."""
    known = set(before)

    def check(values: Sequence[Any]) -> None:
        for value in values:
            if type(value) is Expr and value.number not in known:
                file, line = value.place
                text = linecache.getline(file, line).strip()
                raise TraceError(
                    f"{file}:{line}: `{text}`: a number leaves the branch or loop that computes "
                    "it; return it from there"
                )

    for operation in block.operations:
        check(operation.args)
        inside = known
        for inner in operation.blocks:
            _check_scopes(inner, inside)
            if operation.op == "loop":  # the body uses what the test computes
                inside = inside | {made.number for made in inner.operations}
        known.add(operation.number)
    check(block.results)
