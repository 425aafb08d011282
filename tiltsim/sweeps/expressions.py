"""Arithmetic in sweep files: only a few operators and functions over named numbers."""

import ast
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any, Final

from tiltsim.scenario.messages import did_you_mean
from tiltsim.system.arguments import is_number

_BINARY: Final[dict[type[ast.operator], Callable[[Any, Any], Any]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_UNARY: Final[dict[type[ast.unaryop], Callable[[Any], Any]]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
FUNCTIONS: Final[dict[str, Callable[..., Any]]] = {
    "abs": abs,
    "atan": math.atan,
    "cos": math.cos,
    "max": max,
    "min": min,
    "sin": math.sin,
    "sqrt": math.sqrt,
    "tan": math.tan,
}
MAX_DEPTH: Final = 200  # operations in one another in an expression
CONSTANTS: Final = {"pi": math.pi}


def evaluate(expression: str, values: Mapping[str, Any]) -> float:
    """The value of an expression over named numbers.

    It has ``+ - * / **``, parentheses, numbers, `FUNCTIONS`, pi, and the names in ``values``, dots
    and positions included, as in ``2 * gait.period``. Raises ValueError, whose message is a
    predicate of the expression, if it cannot be parsed or has no value.
    """
    try:
        value = _value(_parse(expression), values)
    except ZeroDivisionError:
        raise ValueError("divides by zero") from None
    except OverflowError:
        raise ValueError("is too large") from None
    except ArithmeticError as error:
        raise ValueError(f"has no value: {error}") from None
    except TypeError:
        raise ValueError("has an operator or a function with the wrong type of argument") from None
    if not (is_number(value) and math.isfinite(value)):
        raise ValueError("is not a real number")
    return float(value)


def names(expression: str) -> set[str]:
    """The names in an expression. Raises ValueError if it cannot be parsed."""
    return set(_names(_parse(expression)))


@lru_cache(maxsize=1024)
def _parse(expression: str) -> ast.expr:
    try:
        parsed = ast.parse(expression.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ValueError("is not an arithmetic expression") from None
    level: list[ast.AST] = [parsed]
    for _ in range(MAX_DEPTH):
        level = [child for node in level for child in ast.iter_child_nodes(node)]
        if not level:
            return parsed
    raise ValueError(f"nests more than {MAX_DEPTH} deep; a + b + c nests 2 deep")


def _is_name(node: ast.expr) -> bool:
    return isinstance(node, ast.Name | ast.Attribute | ast.Subscript)


def _names(node: ast.expr) -> Iterator[str]:
    if _is_name(node):
        name = ast.unparse(node)
        if name not in CONSTANTS:
            yield name
    elif isinstance(node, ast.Call):
        for argument in node.args:
            yield from _names(argument)
    else:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                yield from _names(child)


def _value(node: ast.expr, values: Mapping[str, Any]) -> Any:
    if isinstance(node, ast.Constant) and is_number(node.value):
        return float(node.value)
    if _is_name(node):
        name = ast.unparse(node)
        known = {**CONSTANTS, **values}
        if name not in known:
            hint = did_you_mean(name, known)
            raise ValueError(f"{name} is unknown; {hint}known: {', '.join(sorted(known))}")
        return known[name]
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        return _BINARY[type(node.op)](_value(node.left, values), _value(node.right, values))
    if isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
        return _UNARY[type(node.op)](_value(node.operand, values))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        function = FUNCTIONS.get(node.func.id)
        if function is not None:
            arguments = [_value(argument, values) for argument in node.args]
            try:
                return function(*arguments)
            except ValueError:
                shown = ", ".join(f"{argument:.6g}" for argument in arguments)
                raise ValueError(f"has no value: {node.func.id}({shown}) is not defined") from None
        raise ValueError(f"{node.func.id}() is unknown; known: {', '.join(FUNCTIONS)}")
    raise ValueError(f"{ast.unparse(node)} is not allowed, only arithmetic")
