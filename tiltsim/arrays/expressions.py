"""The values of the expressions of a function on arrays; see `tiltsim.arrays.lifting`."""

import ast
import builtins
import linecache
import operator
from collections.abc import Iterable, Iterator, Mapping
from functools import cache, reduce
from types import FunctionType
from typing import Any, Final

import numpy as np

from tiltsim.arrays.values import Function, LiftError, PlainNumberError

DATA_LENGTH: Final = "the length of a loop depends on arrays"

BINARY: Final[dict[type[ast.operator], Function]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.MatMult: operator.matmul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
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


class Borrowed(list[Any]):
    """A list of the caller, which a lifted function may read and copy but not change."""


@cache
def _definitions(file: str) -> dict[int, list[ast.FunctionDef | ast.Lambda]]:
    """The functions of a source file by their first line."""
    tree = ast.parse("".join(linecache.getlines(file)))  # of a file, or a cell of a notebook
    found: dict[int, list[ast.FunctionDef | ast.Lambda]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            decorators = getattr(node, "decorator_list", [])
            found.setdefault(min(n.lineno for n in [node, *decorators]), []).append(node)
    return found


@cache
def _definition(function: FunctionType) -> ast.FunctionDef | ast.Lambda:
    code, text = function.__code__, getattr(function, "__source__", None)
    if text is not None:  # written by `tiltsim_controllers.mathematics.vectors`
        (node,) = ast.parse(text).body
        assert isinstance(node, ast.FunctionDef)
        return node
    for node in _definitions(code.co_filename).get(code.co_firstlineno, []):
        if getattr(node, "name", "<lambda>") == code.co_name:
            return node
    raise LiftError(
        f"{code.co_name}: its source is not in {code.co_filename}; scalar code is compiled from "
        "its text, in a file or a cell of a notebook"
    )


class Expressions:
    """The call of a function that is being evaluated: its names, and values of expressions.

    Args:
        lifting: A `tiltsim.arrays.lifting.Lifting`.
        function: Written in Python, in a file.
    """

    def __init__(self, lifting: Any, function: FunctionType) -> None:
        self.lifting, self.function = lifting, function
        self.node = _definition(function)
        cells = zip(function.__code__.co_freevars, function.__closure__ or ())
        self.outer = {
            **vars(builtins),
            **function.__globals__,
            **{name: cell.cell_contents for name, cell in cells},
        }
        self.line = self.node.lineno

    def error(self, message: str, kind: type[LiftError] = LiftError) -> LiftError:
        """An error that names function and line."""
        name = f"{self.function.__module__}.{self.function.__name__}"
        return kind(f"{name}, line {self.line}: {message}")

    def plain(self, node: ast.expr, variables: dict[str, Any], message: str) -> Any:
        """A value that must not be an array, nor arise from one."""
        try:
            value = self.value(node, variables)
        except TypeError:
            raise self.error(message, PlainNumberError) from None
        if self.lifting.arrays.is_array(value):
            raise self.error(message, PlainNumberError)
        return value

    def value(self, node: ast.expr, variables: dict[str, Any]) -> Any:
        """The value of an expression."""
        lifting, arrays = self.lifting, self.lifting.arrays
        match node:
            case ast.Constant(value=value):
                return value
            case ast.Name(id=name):
                return variables[name] if name in variables else self.outer[name]
            case ast.Attribute(value=record, attr=name):
                return lifting.attribute(self.value(record, variables), name)
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
            case ast.Set(elts=elements):
                return set(self.elements(elements, variables))
            case ast.Dict(keys=keys, values=values) if None not in keys:
                return {
                    self.value(key, variables): self.value(value, variables)
                    for key, value in zip(keys, values)
                    if key is not None
                }
            case ast.Subscript(value=vector, slice=place):
                return self.entry(self.value(vector, variables), place, variables)
            case ast.Call():
                return self.called(node, variables)
            case ast.JoinedStr(values=parts):  # of a name or a message
                return "".join(str(self.value(part, variables)) for part in parts)
            case ast.FormattedValue(value=value):
                return self.value(value, variables)
            case ast.ListComp(elt=element) | ast.GeneratorExp(elt=element):
                rounds = self.items(node.generators, variables)
                return [self.value(element, inner) for inner in rounds]
            case ast.DictComp(key=key, value=value):
                rounds = self.items(node.generators, variables)
                return {self.value(key, inner): self.value(value, inner) for inner in rounds}
        kind = PlainNumberError if isinstance(node, ast.Slice) else LiftError  # NumPy's [:, 1:]
        raise self.error(f"{type(node).__name__} has no form on arrays", kind)

    def items(
        self, loops: list[ast.comprehension], variables: dict[str, Any]
    ) -> Iterator[dict[str, Any]]:
        """The variables of each round of a comprehension with one loop or several."""
        if not loops:
            yield variables
            return
        one, *others = loops
        for item in list(self.value(one.iter, variables)):
            inner = dict(variables)
            self.assign(one.target, item, inner)
            if all(self.plain(test, inner, DATA_LENGTH) for test in one.ifs):
                yield from self.items(others, inner)

    def binary(self, op: ast.operator, left: Any, right: Any) -> Any:
        """Two values joined by an operator."""
        if isinstance(left, tuple | list):  # joined, or repeated
            return BINARY[type(op)](left, right)
        if type(op) not in BINARY:
            raise self.error(f"{type(op).__name__} has no form on arrays")
        return self.lifting.apply(BINARY[type(op)], left, right)

    def comparison(self, node: ast.Compare, variables: dict[str, Any]) -> Any:
        """A chain of comparisons."""
        result, left = True, self.value(node.left, variables)
        for op, right_node in zip(node.ops, node.comparators):
            right = self.value(right_node, variables)
            result = self.lifting.conjunction(result, self.compared(op, left, right))
            if result is False:
                return False
            left = right
        return result

    def compared(self, op: ast.cmpop, left: Any, right: Any) -> Any:
        """Two values compared; tuples are equal if their entries are."""
        if isinstance(op, ast.Is | ast.IsNot):
            return (left is right) == isinstance(op, ast.Is)
        if isinstance(op, ast.In | ast.NotIn):
            return (left in right) == isinstance(op, ast.In)
        if isinstance(left, tuple | list) and isinstance(right, tuple | list):
            equal: Any = len(left) == len(right)
            for a, b in zip(left, right):
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
        """Values of a tuple or list, or of arguments."""
        made: list[Any] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                made += list(self.value(node.value, variables))
            else:
                made.append(self.value(node, variables))
        return made

    def entry(self, vector: Any, place: ast.expr, variables: dict[str, Any]) -> Any:
        """An entry or a slice of a vector."""
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
        """The value of a call."""
        function = self.value(node.func, variables)
        args = self.elements(node.args, variables)
        keywords: dict[str, Any] = {}
        for keyword in node.keywords:
            value = self.value(keyword.value, variables)
            keywords |= {keyword.arg: value} if keyword.arg else dict(value)
        return self.invoked(function, args, keywords)

    def invoked(self, function: Any, args: list[Any], keywords: Mapping[str, Any]) -> Any:
        """The value of a function at arguments."""
        lifting = self.lifting
        if isinstance(function, FunctionType) and lifting.is_scalar(function):
            if function in lifting.arrays.functions:
                return lifting.apply(function, *args)
            return lifting.run(function, args, keywords)
        if function in STRUCTURAL or (isinstance(function, type) and issubclass(function, tuple)):
            return function(*args, **keywords)
        if function is map:
            return [self.invoked(args[0], [item], {}) for item in list(args[1])]
        if function in (any, all) and any(map(lifting.arrays.is_array, args[0])):
            return reduce(
                lifting.arrays.either if function is any else lifting.arrays.both, args[0]
            )
        if function in lifting.arrays.functions:
            return lifting.apply(function, *args)
        if lifting.planning:
            return lifting.plan(function, args, keywords)
        raise self.error(f"calls {function.__name__}, which is no scalar code")

    def assign(self, target: ast.expr, value: Any, variables: dict[str, Any]) -> None:
        """Give a value to a name, to several, or to an entry of a list made here."""
        match target:
            case ast.Name(id=name):
                variables[name] = value
            case ast.Tuple(elts=targets) | ast.List(elts=targets):
                values = list(value)
                starred = [i for i, each in enumerate(targets) if isinstance(each, ast.Starred)]
                for place in starred:
                    rest = len(values) - len(targets) + 1
                    values[place : place + rest] = [values[place : place + rest]]
                    targets = [
                        each.value if isinstance(each, ast.Starred) else each for each in targets
                    ]
                if len(values) != len(targets):
                    raise self.error(f"{len(values)} values for {len(targets)} names")
                for each, item in zip(targets, values):
                    self.assign(each, item, variables)
            case ast.Subscript(value=vector, slice=place):
                into = self.value(vector, variables)
                if not isinstance(into, list) or isinstance(into, Borrowed):
                    kind = PlainNumberError if isinstance(into, np.ndarray) else LiftError
                    raise self.error(f"changes {ast.unparse(vector)}, which it did not make", kind)
                into[self.plain(place, variables, "writes to an index that is an array")] = value
            case _:
                raise self.error(f"assignment to {ast.unparse(target)}")
