"""Functions of NumPy arrays that run on numbers, and once on symbolic numbers: a trace.

`xp` is NumPy for both, followed by control flow, look-ups and `traceable`.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from inspect import signature
from typing import Any, Final, TypeVar

import numpy as np

from tiltsim_controllers.code.messages import refuse
from tiltsim_controllers.code.program import InputVector, Program, trace_vectors
from tiltsim_controllers.code.tracing import (
    UFUNCS,
    Array,
    Expr,
    Graph,
    Number,
    apply,
    as_array,
    as_condition,
    as_real,
    current_graph,
    graph_in_use,
    make,
)


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
        is_ufunc = isinstance(function, np.ufunc)

        def call(*args: Any, **options: Any) -> Any:
            if is_ufunc and Expr in map(type, args):
                return apply(UFUNCS[function], *args)
            return as_array(function(*args, **options))

        setattr(self, name, call)  # found at once from now on
        return call

    def where(self, condition: Any, yes: Any, no: Any) -> Any:
        """Entries of one array or of another, by a condition."""
        if not {Expr, Array}.isdisjoint(map(type, (condition, yes, no))):
            return apply("where", condition, yes, no)
        return np.where(condition, yes, no)[()]  # a number where all are numbers

    def clip(self, values: Any, low: Any, high: Any) -> Any:
        """Values within limits; NaN stays NaN."""
        return self.minimum(self.maximum(values, low), high)

    def array(self, values: Any) -> Any:
        """An array of numbers, vectors or matrices."""
        if not isinstance(values, (tuple, list, np.ndarray)):
            values = [*values]  # a part of a program's input
        made = np.array(values)  # finds out faster whether there are symbolic numbers
        if made.dtype == object and Expr in map(type, made.flat):
            return made.view(Array)
        return made if made.dtype in (float, complex) else np.array(values, float)


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


def take(values: Sequence[Number], index: Number) -> Number:
    """The entry of a vector at an index, rounded down and limited to it; NaN for NaN."""
    return take_row(values, index, 1)[0]


def take_row(values: Sequence[Number], index: Number, width: int) -> Any:
    """A row of a table, whose rows of a width follow each other, at an index as in `take`."""
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
    """Entries of a vector from indices (...) on, which are limited to it: shape (size, ...)."""
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
    """A uniform draw from (0, 1) of a seed, a channel and an index.

    See `tiltsim_controllers.code.operations.uniform`.
    """
    return make("uniform", *integers)


def normal(seed: Number, channel: Number, index: Number) -> Number:
    """A draw from the standard normal distribution (Box and Muller, 1958), below 6.7 in magnitude.

    From the channels ``2 channel`` and ``2 channel + 1`` of `uniform`; see there.
    """
    radius = xp.sqrt(-2.0 * xp.log(uniform(seed, 2.0 * channel, index)))
    return radius * xp.cos(2.0 * xp.pi * uniform(seed, 2.0 * channel + 1.0, index))


def branch(condition: Number, then: Callable[[], Any], otherwise: Callable[[], Any]) -> Any:
    """``then()`` where a condition holds, else ``otherwise()``; only that one is evaluated.

    Both return numbers, arrays or tuples of them, of equal shapes.
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
    return build([graph.add("get", [node, i]) for i in range(len(leaves))])


Function = TypeVar("Function", bound=Callable[..., Any])


def traceable(function: Function) -> Function:
    """Let a function of arrays be called with tuples for arrays.

    The function runs as it is on real arrays and on arrays of traced numbers: it uses arithmetic,
    `xp` and the blocks of `tiltsim_controllers.code.arrays`, no ``if`` on a number that may be
    traced, and no assignment to an entry of an array. Given tuples or lists and no array, it
    returns tuples; given an array, it returns arrays. An input of a program arrives as an array,
    but for an argument named ``knots``: look-ups read that by index.
    """
    names = tuple(signature(function).parameters)

    def given(name: str, value: Any) -> Any:
        if isinstance(value, InputVector) and name != "knots":
            return xp.array(value)
        return as_arrays(value)

    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        options = {name: given(name, value) for name, value in options.items()}
        with np.errstate(all="ignore"):  # infinity and NaN, as in a program
            result = function(*map(given, names, args), **options)
        plain = any(map(_is_plain, args)) and not any(isinstance(a, np.ndarray) for a in args)
        return as_tuples(result) if plain else result

    return call  # type: ignore[return-value]


def _is_plain(value: Any) -> bool:
    return isinstance(value, (tuple, list)) and not hasattr(value, "_fields")


def as_arrays(value: Any) -> Any:
    """Tuples and lists of numbers as arrays, also in records; tuples of ints are indices."""
    if not isinstance(value, (tuple, list)):
        return value
    if hasattr(value, "_fields"):
        return type(value)(*map(as_arrays, value))
    if value and isinstance(value[0], int) and all(isinstance(one, int) for one in value):
        return value
    return xp.array(value)


def as_tuples(value: Any) -> Any:
    """Arrays as tuples of numbers, also in tuples and records."""
    if isinstance(value, np.ndarray | np.generic) and value.dtype != object:
        value = value.tolist()  # Python's floats
    elif isinstance(value, np.ndarray):
        return tuple(map(as_tuples, value)) if value.ndim else value
    if isinstance(value, tuple | list):
        entries = map(as_tuples, value)
        return type(value)(*entries) if hasattr(value, "_fields") else tuple(entries)
    return float(value) if isinstance(value, np.floating) else value


USER: Final = "user"
"""An input of programs: parameters and knots, which a function reads by index."""


def program_of(function: Callable[..., Any], **sizes: int) -> Program:
    """Trace a function of arrays, whose operations know no line of code.

    It takes an array for each input of a size, but the input itself for `USER`, and returns
    numbers, arrays and tuples of them.
    """

    def traced(*vectors: InputVector) -> list[Any]:
        inputs = zip(sizes, vectors, strict=True)
        given = [vector if name == USER else xp.array(vector) for name, vector in inputs]
        return flatten(function(*given))[0]

    return trace_vectors(traced, sizes, Graph(locate=lambda: ("", 0)))
