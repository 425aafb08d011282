"""Symbolic numbers, and the graph of operations that a function makes of them."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, partial
from typing import Any, Final, NoReturn

import numpy as np

from tiltsim_controllers.code.messages import refuse, user_line
from tiltsim_controllers.code.operations import CONDITIONS, OPERATIONS

Number = Any
"""A float, a bool or an `Expr`."""


class Expr:
    """A number that is unknown while a function is traced."""

    __slots__ = ("args", "blocks", "is_condition", "number", "op", "place")
    __array_ufunc__ = None  # NumPy leaves operators to this class

    def __init__(
        self,
        op: str,
        args: Sequence[Any],
        number: int,
        blocks: Sequence[Block],
        place: tuple[str, int],
    ) -> None:
        self.op, self.args, self.number = op, args, number
        self.blocks, self.place = blocks, place
        self.is_condition = op in CONDITIONS or (op == "where" and is_condition(args[1]))

    def __repr__(self) -> str:
        return f"<{self.op} at {self.place[0]}:{self.place[1]}>"

    def __bool__(self) -> NoReturn:
        refuse(
            "a traced number has no truth value yet",
            "write xp.where(condition, a, b), or branch(condition, f, g)",
        )

    def __float__(self) -> NoReturn:
        refuse("a traced number has no value yet", "use xp.sin for math.sin, xp.array for a[0] = x")

    def __index__(self) -> NoReturn:
        refuse("a traced number is no index", "write take(values, index)")

    def __iter__(self) -> NoReturn:
        refuse("a traced number is no vector", "check the shapes")

    __hash__ = object.__hash__
    __truediv__: Callable[[Expr, Any], Any]
    __rtruediv__: Callable[[Expr, Any], Any]
    __mod__: Callable[[Expr, Any], Any]
    __rmod__: Callable[[Expr, Any], Any]

    def __neg__(self) -> Number:
        return make("neg", self)

    def __pos__(self) -> Number:
        return self

    def __abs__(self) -> Number:
        return make("abs", self)

    def __invert__(self) -> Number:
        return make("not", self)


def _binary(op: str, *, swapped: bool = False) -> Callable[[Expr, Any], Any]:
    def operator(self: Expr, other: Any) -> Any:
        if type(other) not in (float, Expr) and getattr(other, "__array_ufunc__", self) is None:
            return NotImplemented  # a class that has operators with numbers
        return apply(op, other, self) if swapped else apply(op, self, other)

    return operator


for _op in ("add", "sub", "mul", "and", "or", "pow", "div", "remainder"):
    _name = {"div": "truediv", "remainder": "mod"}.get(_op, _op)
    setattr(Expr, f"__{_name}__", _binary(_op))
    setattr(Expr, f"__r{_name}__", _binary(_op, swapped=True))
for _op in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(Expr, f"__{_op}__", _binary(_op))


class Array(np.ndarray):
    """An array with symbolic entries, on which NumPy's functions work."""

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: str, *args: Any, out: Any = None, **options: Any
    ) -> Any:
        op = UFUNCS.get(ufunc)
        if method == "__call__" and op is not None:
            result = apply(op, *args)
        elif ufunc is np.matmul or method == "reduce":
            result = as_array(getattr(ufunc, method)(*map(_plain, args), **options))
        else:
            refuse(f"numpy.{ufunc.__name__} cannot be traced", f"use one of {', '.join(COMPOSED)}")
        if out is None:
            return result
        out[0][...] = result
        return out[0]


def _plain(value: Any) -> Any:
    return value.view(np.ndarray) if isinstance(value, Array) else value


def as_array(value: Any) -> Any:
    """An array of objects as an `Array`; anything else as it is."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        return value.view(Array)
    return value


def apply(op: str, *args: Any) -> Any:
    """An operation of `OPERATIONS` or `COMPOSED` on numbers, or on arrays that broadcast."""
    for value in args:
        if type(value) not in (float, Expr) and isinstance(value, (np.ndarray, list, tuple)):
            break
    else:
        return COMPOSED[op](*args) if op in COMPOSED else make(op, *args)
    boxed = [np.array(a, object) if isinstance(a, Expr) else _plain(a) for a in args]
    return as_array(_on_arrays(op, len(args))(*boxed))


@cache
def _on_arrays(op: str, arguments: int) -> np.ufunc:
    return np.frompyfunc(COMPOSED.get(op) or partial(make, op), arguments, 1)


class Block:
    """Operations in order.

    Attributes:
        operations: In the order of evaluation.
        known: Operations by operator and arguments, so that an equal one is found.
        parameters: Numbers that change with every turn of a loop.
        results: Numbers that leave the block.
    """

    def __init__(self) -> None:
        self.operations: list[Expr] = []
        self.known: dict[tuple[Any, ...], Expr] = {}
        self.parameters: list[Expr] = []
        self.results: list[Number] = []


class Graph:
    """A program while it is traced.

    Attributes:
        scopes: Open blocks, outermost first.
        locate: Returns file and line of the user's code.
    """

    def __init__(self, locate: Callable[[], tuple[str, int]] | None = None) -> None:
        self.scopes = [Block()]
        self.locate = locate or user_line
        self._count = 0

    def add(
        self,
        op: str,
        args: Sequence[Any],
        blocks: Sequence[Block] = (),
        key: tuple[Any, ...] | None = None,
    ) -> Expr:
        """Append an operation to the innermost block.

        Args:
            op: Its name.
            args: Its arguments.
            blocks: Operations within it.
            key: By which an equal operation is found, or None.
        """
        made = Expr(op, args, self._count, blocks, self.locate())
        self._count += 1
        self.scopes[-1].operations.append(made)
        if key:
            self.scopes[-1].known[key] = made
        return made

    def known(self, op: str, args: Sequence[Any]) -> Expr:
        """The equal operation before it, or a new one."""
        key = (op, *[a.number if type(a) is Expr else _PACK(a) for a in args])
        for scope in reversed(self.scopes):
            found = scope.known.get(key)
            if found is not None:
                return found
        return self.add(op, args, key=key)

    @contextmanager
    def block(self) -> Iterator[Block]:
        """Collect operations in a separate block."""
        self.scopes.append(Block())
        try:
            yield self.scopes[-1]
        finally:
            self.scopes.pop()


_PACK: Final = struct.Struct("d").pack
"""Equal for equal numbers; 0.0 is not -0.0."""


_current: ContextVar[Graph | None] = ContextVar("graph", default=None)


@contextmanager
def tracing_into(graph: Graph) -> Iterator[Graph]:
    """Let operations on symbolic numbers extend a graph."""
    token = _current.set(graph)
    try:
        yield graph
    finally:
        _current.reset(token)


def current_graph() -> Graph | None:
    """The graph that is being traced, if any."""
    return _current.get()


def graph_in_use() -> Graph:
    """The graph that is being traced; raises `TraceError` without one."""
    graph = _current.get()
    if graph is None:
        refuse("a traced number outside its trace", "return it from the function instead")
    return graph


def make(op: str, *args: Any) -> Number:
    """An operation of `OPERATIONS` on numbers, which is part of the graph if it cannot be folded.

    It is folded if all numbers are known or one is neutral.
    """
    if Expr not in map(type, args):
        return OPERATIONS[op].value(*map(_number, args))
    graph = _current.get() or graph_in_use()
    if op == "where":
        return _where(graph, *args)
    if op in _LOGICAL:
        return _logical(graph, op, *map(as_condition, args))
    values = [a if type(a) is Expr and not a.is_condition else as_real(a) for a in args]
    folded = _folded(op, *values) if op in _FOLDED else None
    return graph.known(op, values) if folded is None else folded


def _number(value: Any) -> float | bool:
    if type(value) is float:
        return value
    if isinstance(value, bool | np.bool_):
        return bool(value)
    try:
        return float(value)
    except (TypeError, ValueError):
        refuse(f"{type(value).__name__} is no number", "use arrays of equal shapes")


def is_condition(value: Any) -> bool:
    """Whether a number is true or false."""
    return value.is_condition if type(value) is Expr else isinstance(value, bool | np.bool_)


def as_condition(value: Any) -> Number:
    """A number as a condition: whether it differs from zero."""
    return value if is_condition(value) else make("ne", value, 0.0)


def as_real(value: Any) -> Number:
    """A condition as 1.0 or 0.0; other numbers as they are."""
    if type(value) is Expr:
        return make("where", value, 1.0, 0.0) if value.is_condition else value
    return value if type(value) is float else float(_number(value))


def _where(graph: Graph, condition: Any, yes: Any, no: Any) -> Number:
    condition = as_condition(condition)
    if not isinstance(condition, Expr):
        return yes if condition else no
    if not (is_condition(yes) and is_condition(no)):
        yes, no = as_real(yes), as_real(no)
    if yes is no or (Expr not in (type(yes), type(no)) and _PACK(yes) == _PACK(no)):
        return yes
    return graph.known("where", [condition, yes, no])


def _logical(graph: Graph, op: str, *args: Number) -> Number:
    """A conjunction, disjunction or negation; a known condition decides or drops out."""
    if op == "not":
        (inner,) = args
        return inner.args[0] if inner.op == "not" else graph.known(op, args)
    for one, other in (args, args[::-1]):
        if not isinstance(one, Expr):
            return other if one == (op == "and") else one
    return args[0] if args[0] is args[1] else graph.known(op, args)


def _is_negative(value: Number) -> bool:
    return type(value) is Expr and value.op == "neg"


_LOGICAL: Final = frozenset({"and", "or", "not"})
_FOLDED: Final = frozenset({"add", "sub", "mul", "div", "neg", "pow"})


def _folded(op: str, x: Number, y: Number = None) -> Number | None:
    """The result of an operation with a neutral number, None without one.

    A zero in a matrix means that there is nothing: 0 x = 0 / x = 0, 0 + x = x and 0 - x = -x are
    the only rules that are not IEEE's.
    """
    if op == "neg":
        return x.args[0] if _is_negative(x) else None
    a, b = None if type(x) is Expr else x, None if type(y) is Expr else y
    if a is b is None and "neg" not in (x.op, y.op):
        return None
    if op == "add" and 0.0 in (a, b):
        return y if a == 0.0 else x
    if op in ("add", "sub") and _is_negative(y):
        return make("sub" if op == "add" else "add", x, y.args[0])
    if op == "add" and _is_negative(x):
        return make("sub", y, x.args[0])
    if op == "sub" and b == 0.0:
        return x
    if op == "sub" and a == 0.0:
        return make("neg", y)
    if (op == "mul" and 0.0 in (a, b)) or (op == "div" and a == 0.0):
        return 0.0
    if op in ("mul", "div") and b == 1.0:
        return x
    if op == "mul" and a == 1.0:
        return y
    if op == "mul" and -1.0 in (a, b):
        return make("neg", y if a == -1.0 else x)
    if op in ("mul", "div") and (_is_negative(x) or _is_negative(y)):  # the sign goes on to a sum
        return make("neg", make(op, x.args[0], y) if _is_negative(x) else make(op, x, y.args[0]))
    return make("mul", x, x) if op == "pow" and b == 2.0 else None


def remainder(a: Number, b: Number) -> Number:
    """Python's ``a % b``, which has the sign of b."""
    rest = make("fmod", a, b)
    other_side = make("ne", make("lt", rest, 0.0), make("lt", b, 0.0))
    moved = make("where", other_side, make("add", rest, b), rest)
    return make("where", make("eq", rest, 0.0), make("copysign", 0.0, b), moved)


def _smaller(a: Number, b: Number) -> Number:
    """Python's ``min``, which prefers the first of equal values."""
    return make("where", make("lt", b, a), b, a)


def _larger(a: Number, b: Number) -> Number:
    return make("where", make("gt", b, a), b, a)


COMPOSED: Final[dict[str, Callable[..., Number]]] = {
    "minimum": _smaller,
    "maximum": _larger,
    "remainder": remainder,
    "hypot": lambda a, b: make("sqrt", a * a + b * b),
    "square": lambda a: make("mul", a, a),
    "positive": lambda a: a,
    "isnan": lambda a: make("ne", a, a),
    "isfinite": lambda a: make("lt", make("abs", a), math.inf),
    "isinf": lambda a: make("eq", make("abs", a), math.inf),
}
"""Functions of NumPy's that are several operations, by name."""

UFUNCS: Final[dict[np.ufunc, str]] = {
    **{operation.ufunc: name for name, operation in OPERATIONS.items() if operation.ufunc},
    **{getattr(np, name): name for name in COMPOSED},
    np.bitwise_and: "and",
    np.bitwise_or: "or",
    np.invert: "not",
}
"""Names of the operations of NumPy's functions."""
