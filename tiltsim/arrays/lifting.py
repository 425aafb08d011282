"""Scalar functions on arrays or symbols: a small compiler that leaves their source as it is.

`Lifting` evaluates the syntax tree of a scalar function on whatever `Arrays` describe, JAX's arrays
or CasADi's symbols. An ``if`` on plain floats, such as the code of a gait, takes one branch, as in
Python. An ``if`` on arrays evaluates both branches and selects, variable by variable; so does an
early ``return`` or ``break``. A loop is unrolled: its length must not depend on arrays.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from types import CodeType, FunctionType
from typing import Any, Final, Protocol

import numpy as np

from tiltsim.errors import TiltsimError
from tiltsim_controllers.mathematics.scalar import scalar_functions

Function = Callable[..., Any]
Ends = dict[str, tuple[Any, Any]]
"""How a block of code may end: by what, under which condition, and with which variables or value."""

NEXT, RETURN, BREAK, CONTINUE = "next", "return", "break", "continue"

DATA_LENGTH: Final = "the length of a loop depends on arrays"

BINARY: Final[dict[type[ast.operator], Function]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.BitAnd: operator.and_,
    ast.BitXor: operator.xor,
    ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
}
COMPARISONS: Final[dict[type[ast.cmpop], Function]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
STRUCTURAL: Final = {range, zip, len, list, tuple, bool, enumerate}
"""Builtins that work on the structure of the values, whatever they are."""


class LiftError(TiltsimError):
    """A function that has no form on arrays; the message names function and line."""


class Arrays(Protocol):
    """The values that scalar functions are lifted to."""

    functions: Mapping[Function, Function]
    """Counterparts of the functions of ``math`` and of builtins."""
    domains: Mapping[Function, float]
    """Of those that are defined on a part of the reals only, a number in that part."""

    def is_array(self, value: Any) -> bool:
        """Whether a value is known only when the lifted function runs."""

    def where(self, condition: Any, yes: Any, no: Any) -> Any:
        """Select by a condition, entry by entry."""

    def take(self, values: Any, index: Any) -> Any:
        """The entry of a vector at an index that is an array."""

    def both(self, first: Any, second: Any) -> Any:
        """Conjunction."""

    def either(self, first: Any, second: Any) -> Any:
        """Disjunction."""

    def negated(self, condition: Any) -> Any:
        """Negation."""


class Borrowed(list[Any]):
    """A list of the caller, which a lifted function may read and copy but not change."""


@cache
def _definitions(file: str) -> dict[int, list[ast.FunctionDef | ast.Lambda]]:
    """The functions of a source file by their first line."""
    with open(file, encoding="utf-8") as source:  # noqa: PTH123  one-liner for a string
        tree = ast.parse(source.read())
    found: dict[int, list[ast.FunctionDef | ast.Lambda]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            decorators = getattr(node, "decorator_list", [])
            found.setdefault(min(n.lineno for n in [node, *decorators]), []).append(node)
    return found


@cache
def _definition(code: CodeType) -> ast.FunctionDef | ast.Lambda:
    try:
        nodes = _definitions(code.co_filename).get(code.co_firstlineno, [])
    except OSError:
        nodes = []
    for node in nodes:
        if getattr(node, "name", "<lambda>") == code.co_name:
            return node
    raise LiftError(f"{code.co_name}: its source is not in {code.co_filename}")


class Lifting:
    """Lifts scalar functions to arrays.

    Args:
        arrays: What the lifted functions work on.
        guarded: Whether a branch that is not selected gets harmless arguments for divisions and
            roots. Values do not need it; gradients do, as zero times infinity is no number.
        planning: Whether any function of tiltsim may be called, not only scalar code.
    """

    def __init__(self, arrays: Arrays, *, guarded: bool = False, planning: bool = False) -> None:
        self.arrays, self.guarded, self.planning = arrays, guarded, planning
        self._known = set(scalar_functions())
        self._active: Any = True  # the condition under which the present code runs

    def __call__(self, function: Function) -> Function:
        """The function on arrays; its other arguments may be floats, tuples and records."""

        def lifted(*args: Any, **keywords: Any) -> Any:
            self._active = True
            return self.run(function, args, keywords)

        lifted.__name__ = getattr(function, "__name__", "lifted")
        return lifted

    def run(self, function: Any, args: Iterable[Any], keywords: Mapping[str, Any]) -> Any:
        """Evaluate a function written in Python."""
        return _Frame(self, function).call(args, keywords)

    def is_scalar(self, function: FunctionType) -> bool:
        """Whether a function may be lifted."""
        if function not in self._known:
            self._known = set(scalar_functions())  # closures are registered when they are made
        ours = function.__module__.partition(".")[0] in ("tiltsim", "tiltsim_controllers")
        return function in self._known or (self.planning and ours)

    def apply(self, function: Function, *args: Any) -> Any:
        """A function of ``math``, a builtin or an operator on floats or arrays."""
        arrays = self.arrays
        if any(map(arrays.is_array, args)):
            if self.guarded and self._active is not True and function in arrays.domains:
                *first, last = args
                args = (*first, arrays.where(self._active, last, arrays.domains[function]))
            return arrays.functions.get(function, function)(*args)
        try:
            return function(*args)
        except (ArithmeticError, ValueError):  # where native code has infinity or NaN
            if function is not operator.truediv:
                return np.nan
            with np.errstate(all="ignore"):
                return float(np.divide(*args))

    @contextmanager
    def under(self, condition: Any) -> Iterator[None]:
        """Code that is selected by a condition."""
        before = self._active
        self._active = self.conjunction(before, condition)
        try:
            yield
        finally:
            self._active = before

    def conjunction(self, first: Any, second: Any) -> Any:
        """Both of two conditions, each an array, True or False."""
        if first is True or second is False:
            return second
        if second is True or first is False:
            return first
        return self.arrays.both(first, second)

    def negation(self, condition: Any) -> Any:
        """The opposite of a condition, an array or a plain value."""
        return self.arrays.negated(condition) if self.arrays.is_array(condition) else not condition

    def select(self, condition: Any, yes: Any, no: Any) -> Any:
        """`Arrays.where` for values of any structure."""
        if yes is no:
            return yes
        if isinstance(yes, dict):
            missing = object()
            pairs = {name: (yes.get(name, missing), no.get(name, missing)) for name in yes | no}
            return {
                name: b if a is missing else a if b is missing else self.select(condition, a, b)
                for name, (a, b) in pairs.items()
            }
        if isinstance(yes, tuple | list) or isinstance(no, tuple | list):
            if len(yes) != len(no):
                raise ValueError(f"{len(yes)} or {len(no)} values, as an array decides")
            return rebuilt(yes, (self.select(condition, a, b) for a, b in zip(yes, no)))
        constant = not (self.arrays.is_array(yes) or self.arrays.is_array(no))
        if constant and type(yes) is type(no) and yes == no:
            return yes
        return self.arrays.where(condition, yes, no)


def rebuilt(like: Any, values: Iterable[Any]) -> Any:
    """A tuple, list or record as another one, with other values."""
    if hasattr(like, "_fields"):
        return type(like)(*values)
    return list(values) if isinstance(like, list) else tuple(values)


class _Frame:
    """The evaluation of one call."""

    def __init__(self, lifting: Lifting, function: FunctionType) -> None:
        self.lifting, self.function = lifting, function
        self.node = _definition(function.__code__)
        cells = zip(function.__code__.co_freevars, function.__closure__ or ())
        self.outer = {
            **vars(builtins),
            **function.__globals__,
            **{name: cell.cell_contents for name, cell in cells},
        }
        self.line = self.node.lineno

    def call(self, args: Iterable[Any], keywords: Mapping[str, Any]) -> Any:
        bound = inspect.signature(self.function).bind(*args, **keywords)
        bound.apply_defaults()
        variables = {
            name: Borrowed(value) if isinstance(value, list) else value
            for name, value in bound.arguments.items()
        }
        if isinstance(self.node, ast.Lambda):
            value = self.value(self.node.body, variables)
        else:
            ends = self.block(self.node.body, variables)
            if set(ends) != {RETURN}:
                raise self.error("may end without a value")
            value = ends[RETURN][1]
        return list(value) if isinstance(value, Borrowed) else value

    def error(self, message: str) -> LiftError:
        name = f"{self.function.__module__}.{self.function.__name__}"
        return LiftError(f"{name}, line {self.line}: {message}")

    # --- statements --------------------------------------------------------------------------

    def block(self, statements: list[ast.stmt], variables: dict[str, Any]) -> Ends:
        ends: Ends = {NEXT: (True, variables)}
        for statement in statements:
            if NEXT not in ends:
                break
            condition, variables = ends.pop(NEXT)
            self.line = statement.lineno
            with self.lifting.under(condition):
                try:
                    later = self.statement(statement, variables)
                    ends = self.follow(ends, condition, later)
                except (ArithmeticError, LookupError, TypeError, ValueError) as error:
                    text = str(error).partition("\n")[0]
                    raise self.error(f"{type(error).__name__}: {text}") from error
        return ends

    def follow(self, ends: Ends, condition: Any, later: Ends) -> Ends:
        """Ends of a block so far, and those of what comes next under a condition."""
        joined = dict(ends)
        for kind, (its_condition, value) in later.items():
            its_condition = self.lifting.conjunction(condition, its_condition)
            if kind in ends:
                before, earlier = ends[kind]
                value = self.lifting.select(before, earlier, value)
                its_condition = self.lifting.arrays.either(before, its_condition)
            joined[kind] = (its_condition, value)
        if len(joined) == 1:
            return {kind: (True, value) for kind, (_, value) in joined.items()}
        return joined

    def statement(self, node: ast.stmt, variables: dict[str, Any]) -> Ends:
        match node:
            case ast.Return(value=value):
                return {RETURN: (True, None if value is None else self.value(value, variables))}
            case ast.Assign(targets=targets, value=value):
                result = self.value(value, variables)
                for target in targets:
                    self.assign(target, result, variables)
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                self.assign(target, self.value(value, variables), variables)
            case ast.AugAssign(target=target, op=op, value=value):
                before = self.value(target, variables)
                after = self.binary(op, before, self.value(value, variables))
                self.assign(target, after, variables)
            case ast.If():
                return self.branches(node, variables)
            case ast.For(orelse=[]):
                items = iter(self.plain(node.iter, variables, DATA_LENGTH))

                def next_item(now: dict[str, Any]) -> bool:
                    for item in items:
                        self.assign(node.target, item, now)
                        return True
                    return False

                return self.loop(node.body, variables, next_item)
            case ast.While(orelse=[]):
                return self.loop(
                    node.body, variables, lambda now: bool(self.plain(node.test, now, DATA_LENGTH))
                )
            case ast.Break():
                return {BREAK: (True, variables)}
            case ast.Continue():
                return {CONTINUE: (True, variables)}
            case ast.Pass() | ast.Assert() | ast.Expr(value=ast.Constant()):
                pass
            case _:
                raise self.error(f"{type(node).__name__} has no form on arrays")
        return {NEXT: (True, variables)}

    def branches(self, node: ast.If, variables: dict[str, Any]) -> Ends:
        condition = self.value(node.test, variables)
        if not self.lifting.arrays.is_array(condition):
            return self.block(node.body if condition else node.orelse, variables)
        opposite = self.lifting.arrays.negated(condition)
        with self.lifting.under(condition):
            yes = self.block(node.body, _copied(variables))
        with self.lifting.under(opposite):
            no = self.block(node.orelse, _copied(variables))
        self.line = node.lineno
        ends: Ends = {}
        for kind in yes | no:
            if kind in yes and kind in no:
                value = self.lifting.select(condition, yes[kind][1], no[kind][1])
                ends[kind] = (self.lifting.select(condition, yes[kind][0], no[kind][0]), value)
            elif kind in yes:
                ends[kind] = (self.lifting.conjunction(condition, yes[kind][0]), yes[kind][1])
            else:
                ends[kind] = (self.lifting.conjunction(opposite, no[kind][0]), no[kind][1])
        return ends

    def loop(
        self,
        body: list[ast.stmt],
        variables: dict[str, Any],
        goes_on: Callable[[dict[str, Any]], bool],
    ) -> Ends:
        """Unroll a loop."""
        ends: Ends = {NEXT: (True, variables)}
        while NEXT in ends and goes_on(ends[NEXT][1]):
            condition, variables = ends.pop(NEXT)
            with self.lifting.under(condition):
                later = self.block(body, variables)
            if CONTINUE in later:
                again = later.pop(CONTINUE)
                later = self.follow(later, True, {NEXT: again})
            ends = self.follow(ends, condition, later)
        if BREAK in ends:
            broken = ends.pop(BREAK)
            ends = self.follow(ends, True, {NEXT: broken})
        return ends

    def assign(self, target: ast.expr, value: Any, variables: dict[str, Any]) -> None:
        match target:
            case ast.Name(id=name):
                variables[name] = value
            case ast.Tuple(elts=targets) | ast.List(elts=targets):
                values = list(value)
                if len(values) != len(targets):
                    raise self.error(f"{len(values)} values for {len(targets)} names")
                for each, item in zip(targets, values):
                    self.assign(each, item, variables)
            case ast.Subscript(value=vector, slice=place):
                into = self.value(vector, variables)
                if not isinstance(into, list) or isinstance(into, Borrowed):
                    raise self.error(f"changes {ast.unparse(vector)}, which it did not make")
                into[self.plain(place, variables, "writes to an index that is an array")] = value
            case _:
                raise self.error(f"assignment to {ast.unparse(target)}")

    # --- expressions -------------------------------------------------------------------------

    def plain(self, node: ast.expr, variables: dict[str, Any], message: str) -> Any:
        """A value that must not be an array, nor arise from one."""
        try:
            value = self.value(node, variables)
        except TypeError:
            raise self.error(message) from None
        if self.lifting.arrays.is_array(value):
            raise self.error(message)
        return value

    def value(self, node: ast.expr, variables: dict[str, Any]) -> Any:
        lifting, arrays = self.lifting, self.lifting.arrays
        match node:
            case ast.Constant(value=value):
                return value
            case ast.Name(id=name):
                return variables[name] if name in variables else self.outer[name]
            case ast.Attribute(value=record, attr=name):
                return getattr(self.value(record, variables), name)
            case ast.BinOp(left=left, op=op, right=right):
                first = self.value(left, variables)
                return self.binary(op, first, self.value(right, variables))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return lifting.negation(self.value(operand, variables))
            case ast.UnaryOp(op=op, operand=operand):
                value = self.value(operand, variables)
                return -value if isinstance(op, ast.USub) else +value
            case ast.Compare():
                return self.comparison(node, variables)
            case ast.BoolOp(op=op, values=values):
                return self.connected(isinstance(op, ast.And), values, variables)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                condition = self.value(test, variables)
                if not arrays.is_array(condition):
                    return self.value(body if condition else orelse, variables)
                with lifting.under(condition):
                    yes = self.value(body, variables)
                with lifting.under(arrays.negated(condition)):
                    no = self.value(orelse, variables)
                return lifting.select(condition, yes, no)
            case ast.Tuple(elts=elements):
                return tuple(self.elements(elements, variables))
            case ast.List(elts=elements):
                return self.elements(elements, variables)
            case ast.Subscript(value=vector, slice=place):
                return self.entry(self.value(vector, variables), place, variables)
            case ast.Call():
                return self.called(node, variables)
            case ast.ListComp(elt=element, generators=[one]) | ast.GeneratorExp(
                elt=element, generators=[one]
            ):
                inner, made = dict(variables), []
                for item in list(self.value(one.iter, variables)):
                    self.assign(one.target, item, inner)
                    made.append(self.value(element, inner))
                return made
        raise self.error(f"{type(node).__name__} has no form on arrays")

    def binary(self, op: ast.operator, left: Any, right: Any) -> Any:
        if isinstance(left, tuple | list):  # joined, or repeated
            return BINARY[type(op)](left, right)
        if type(op) not in BINARY:
            raise self.error(f"{type(op).__name__} has no form on arrays")
        return self.lifting.apply(BINARY[type(op)], left, right)

    def comparison(self, node: ast.Compare, variables: dict[str, Any]) -> Any:
        result, left = True, self.value(node.left, variables)
        for op, right_node in zip(node.ops, node.comparators):
            right = self.value(right_node, variables)
            result = self.lifting.conjunction(result, self.compared(op, left, right))
            if result is False:
                return False
            left = right
        return result

    def compared(self, op: ast.cmpop, left: Any, right: Any) -> Any:
        if isinstance(op, ast.Is | ast.IsNot):
            return (left is right) == isinstance(op, ast.Is)
        if isinstance(left, tuple | list) and isinstance(right, tuple | list):
            equal: Any = True
            for a, b in zip(left, right, strict=True):
                equal = self.lifting.conjunction(equal, self.compared(ast.Eq(), a, b))
            return equal if isinstance(op, ast.Eq) else self.lifting.negation(equal)
        result = self.lifting.apply(COMPARISONS[type(op)], left, right)
        return result if self.lifting.arrays.is_array(result) else bool(result)

    def connected(self, both: bool, nodes: list[ast.expr], variables: dict[str, Any]) -> Any:
        """A chain of ``and``, or of ``or``, which ends where a plain value decides."""
        arrays, result = self.lifting.arrays, None
        for node in nodes:
            value = self.value(node, variables)
            if not arrays.is_array(value):
                if bool(value) != both:
                    return value
                continue
            connect = arrays.both if both else arrays.either
            result = value if result is None else connect(result, value)
        return both if result is None else result

    def elements(self, nodes: Iterable[ast.expr], variables: dict[str, Any]) -> list[Any]:
        made: list[Any] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                made += list(self.value(node.value, variables))
            else:
                made.append(self.value(node, variables))
        return made

    def entry(self, vector: Any, place: ast.expr, variables: dict[str, Any]) -> Any:
        if isinstance(place, ast.Slice):
            lower, upper = (
                None if bound is None else self.plain(bound, variables, "slice by an array")
                for bound in (place.lower, place.upper)
            )
            return vector[lower:upper]
        index = self.value(place, variables)
        if self.lifting.arrays.is_array(index):
            return self.lifting.arrays.take(vector, index)
        return vector[index]

    def called(self, node: ast.Call, variables: dict[str, Any]) -> Any:
        lifting = self.lifting
        function = self.value(node.func, variables)
        args = self.elements(node.args, variables)
        keywords = {k.arg: self.value(k.value, variables) for k in node.keywords if k.arg}
        if isinstance(function, FunctionType) and lifting.is_scalar(function):
            here, value = self.line, lifting.run(function, args, keywords)
            self.line = here
            return value
        if function in STRUCTURAL or isinstance(function, type) and issubclass(function, tuple):
            return function(*args, **keywords)
        if function in lifting.arrays.functions:
            return lifting.apply(function, *args)
        if lifting.planning:
            return function(*args, **keywords)
        raise self.error(f"calls {ast.unparse(node.func)}, which is no scalar code")


def _copied(variables: dict[str, Any]) -> dict[str, Any]:
    """Variables for one of two branches: a list that it changes is its own."""
    return {
        name: type(value)(value) if isinstance(value, list) else value
        for name, value in variables.items()
    }

