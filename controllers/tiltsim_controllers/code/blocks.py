"""Control flow, look-ups and names for traced functions."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any

from tiltsim_controllers.code.arrays import flatten, is_jax, numbers_in, xp
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


def signal(name: str, value: Any) -> Any:
    """Name a value of a law for recordings and messages; returns the value."""
    graph = current_graph()
    if graph is not None:
        graph.signals[name] = value
    return value


def take(values: Sequence[Number], index: Number) -> Number:
    """The entry of a vector at an index, which is rounded down and limited to the vector.

    Args:
        values: Numbers, shape (N,).
        index: From 0 on; NaN for a result of NaN.
    """
    if is_jax(index) or is_jax(values):
        jnp = sys.modules["jax"].numpy
        place = jnp.clip(jnp.floor(jnp.where(index == index, index, 0.0)), 0, len(values) - 1)
        return jnp.where(index == index, jnp.asarray(values)[place.astype(int)], jnp.nan)
    last = float(len(values) - 1)
    place = make("where", make("gt", index, 0.0), index, 0.0)  # NaN becomes 0
    place = make("floor", make("where", make("lt", place, last), place, last))
    found = _entry(values, place) if isinstance(place, Expr) else values[int(place)]
    return make("where", make("eq", index, index), found, float("nan"))


def _entry(values: Sequence[Number], place: Expr) -> Number:
    graph = graph_in_use()
    if isinstance(values, InputVector):
        return graph.known("take_input", [place, values.argument, values.first])
    table: list[Any] = [as_real(value) for value in values]
    return graph.known("take", [place, *table])


def branch(condition: Number, then: Callable[[], Any], otherwise: Callable[[], Any]) -> Any:
    """``then()`` where a condition holds, else ``otherwise()``; only that one is evaluated.

    Args:
        condition: True or false.
        then, otherwise: Return numbers, arrays or tuples of them, both of the same shape.
    """
    if is_jax(condition):
        return sys.modules["jax"].lax.cond(condition, then, otherwise)
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
    if any(map(is_jax, numbers_in(state))):
        return _repeat_in_jax(count, body, state, until)
    leaves, build = flatten(state)
    graph = current_graph()
    if graph is None or not any(isinstance(value, Expr) for value in (count, *leaves)):
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


def _repeat_in_jax(
    count: Number,
    body: Callable[..., tuple[Any, ...]],
    state: tuple[Any, ...],
    until: Callable[..., Number] | None,
) -> tuple[Any, ...]:
    lax = sys.modules["jax"].lax

    def turn(index: Any, now: Any) -> Any:
        return tuple(map(xp.array, body(1.0 * index, *now)))

    if until is None:
        looped: tuple[Any, ...] = lax.fori_loop(0, count, turn, state)
        return looped
    stopped: tuple[Any, ...] = lax.while_loop(
        lambda carried: (carried[0] < count) & ~until(*carried[1]),
        lambda carried: (carried[0] + 1, turn(*carried)),
        (0, state),
    )[1]
    return stopped
