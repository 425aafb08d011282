"""Control flow and look-ups for traced functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from tiltsim_controllers.code.arrays import flatten, xp
from tiltsim_controllers.code.messages import refuse
from tiltsim_controllers.code.program import InputVector
from tiltsim_controllers.code.tracing import (
    Expr,
    Number,
    as_condition,
    as_real,
    current_graph,
    graph_in_use,
    make,
)


def take(values: Sequence[Number], index: Number) -> Number:
    """The entry of a vector at an index, which is rounded down and limited to the vector.

    Args:
        values: Numbers, shape (N,).
        index: From 0 on; NaN for a result of NaN.
    """
    return take_row(values, index, 1)[0]


def take_row(values: Sequence[Number], index: Number, width: int) -> Any:
    """A row of a table at an index as in `take`, shape (width,).

    Args:
        values: The rows, one after the other.
        index: From 0 on; NaN for a result of NaN.
        width: Length of a row.
    """
    last = float(len(values) // width - 1)
    place = make("where", make("gt", index, 0.0), index, 0.0)  # NaN becomes 0
    place = make("floor", make("where", make("lt", place, last), place, last))
    first, nan = make("mul", place, float(width)), float("nan")
    if not isinstance(first, Expr):
        row = xp.array(values[int(first) : int(first) + width])
        return row if index == index else nan * row
    entries = (_entry(values, first, column) for column in range(width))
    return xp.array([make("where", make("eq", index, index), entry, nan) for entry in entries])


def take_span(values: Sequence[Number], start: Any, size: int) -> Any:
    """Entries of a vector from an index on, which is limited to where they exist.

    Args:
        values: Numbers, shape (N,).
        start: From 0 on, shape (...).
        size: Number of entries.

    Returns:
        The entries, shape (size, ...).
    """
    last = len(values) - size
    if isinstance(start, Expr):
        place = xp.floor(xp.clip(start, 0.0, float(last)))
        return xp.array([_entry(values, place, k) for k in range(size)])
    first = np.clip(np.asarray(start), 0, last).astype(int)
    offsets = np.arange(size).reshape(-1, *[1] * first.ndim)
    if isinstance(values, np.ndarray):
        return values[first + offsets]
    return xp.array([values[int(first) + k] for k in range(size)])


def _entry(values: Sequence[Number], first: Expr, column: int) -> Number:
    """The entry of a column of the row that begins at a traced place."""
    graph = graph_in_use()
    if isinstance(values, InputVector):
        return graph.known("take_input", [first, values.argument, values.first + column])
    return graph.known("take", [first, *map(as_real, values[column:])])


def uniform(*integers: Number) -> Number:
    """A uniform draw from (0, 1); see `tiltsim_controllers.code.noise.uniform`.

    Args:
        integers: Seed, channel and index.
    """
    return make("uniform", *integers)


def normal(seed: Number, channel: Number, index: Number) -> Number:
    """A draw from the standard normal distribution (Box and Muller, 1958), below 6.7 in magnitude.

    Args:
        seed, channel, index: Integers, of which the lowest 32 bits are used. It uses the channels
            ``2 channel`` and ``2 channel + 1`` of `uniform`.
    """
    radius = xp.sqrt(-2.0 * xp.log(uniform(seed, 2.0 * channel, index)))
    return radius * xp.cos(2.0 * xp.pi * uniform(seed, 2.0 * channel + 1.0, index))


def branch(condition: Number, then: Callable[[], Any], otherwise: Callable[[], Any]) -> Any:
    """``then()`` where a condition holds, else ``otherwise()``; only that one is evaluated.

    Args:
        condition: True or false.
        then, otherwise: Return numbers, arrays or tuples of them, both of the same shape.
    """
    condition = as_condition(condition)
    if not isinstance(condition, Expr):
        return then() if condition else otherwise()
    graph, blocks, sizes = graph_in_use(), [], []
    for function in (then, otherwise):
        with graph.block() as block:
            leaves, build = flatten(function())
            block.results = [as_real(leaf) for leaf in leaves]
        blocks.append(block)
        sizes.append(len(leaves))
    if sizes[0] != sizes[1]:
        refuse("the two sides return results of different shapes", "return the same from both")
    node = graph.add("branch", [condition], blocks)
    return build([graph.add("get", [node, index]) for index in range(sizes[0])])


def repeat(
    count: Number,
    body: Callable[..., tuple[Any, ...]],
    *state: Any,
    until: Callable[..., Number] | None = None,
) -> tuple[Any, ...]:
    """Repeat ``state = body(i, *state)`` for i = 0, 1, ... below a count.

    Args:
        count: Number of turns.
        body: Returns numbers and arrays of the shapes of ``state``.
        state: Numbers and arrays.
        until: ``(*state)``: whether to stop before the next turn.
    """
    leaves, build = flatten(state)
    graph = current_graph()
    plain = until is None and not any(isinstance(value, Expr) for value in (count, *leaves))
    if graph is None or plain:
        turn = 0.0
        while turn < count and not (until is not None and until(*state)):
            state, turn = body(turn, *state), turn + 1.0
        return state
    with graph.block() as test:  # its parameters are there, as the body may use what it computes
        test.parameters = [graph.add("phi", []) for _ in range(1 + len(leaves))]
        now = build(test.parameters[1:])
        test.results = [False if until is None else as_condition(until(*now))]
        with graph.block() as inner:
            results, _ = flatten(tuple(body(test.parameters[0], *now)))
            inner.results = [as_real(value) for value in results]
    node = graph.add("loop", [as_real(count), *map(as_real, leaves)], (test, inner))
    made: tuple[Any, ...] = build([graph.add("get", [node, i]) for i in range(len(leaves))])
    return made
