"""Small semantic changes of a module, one at a time, as edits of its syntax tree.

They are the mistakes that one makes while typing a formula: an operator, a sign, a constant, an
index, a bound, a dropped term, two exchanged arguments, the other branch. Docstrings, annotations,
decorators and the texts of errors are left alone.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
ARITHMETIC |= {ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.Pow: ast.Mult}
COMPARISONS = {  # the boundary case and the opposite
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
PAIRS = (("sin", "cos"), ("min", "max"), ("all", "any"), ("argmin", "argmax"), ("floor", "ceil"))
FUNCTIONS = {name: other for pair in PAIRS for name, other in (pair, pair[::-1])}
SYMMETRIC = {
    "min",
    "max",
    "hypot",
    "isclose",
    "gcd",
    "dot",
    "isinstance",
    "issubclass",
    "NamedTuple",
}
LEFT_ALONE = {"annotation", "returns", "decorator_list", "bases"}
Sequence = ast.JoinedStr | ast.List | ast.ListComp | ast.Tuple  # whose "+" is not a sum


@dataclass(frozen=True)
class Mutant:
    """One edit: ``field`` (at ``index``, if a list) of ``parent`` becomes ``replacement``."""

    key: str  # module, function, expression before and after; unique
    lines: range  # of the expression
    parent: ast.AST
    field: str
    index: int | None
    replacement: ast.AST

    def apply(self) -> ast.AST:
        """Edit the tree that the mutant was found in; return the original."""
        fields = self.parent.__dict__
        if self.index is None:
            fields[self.field], original = self.replacement, fields[self.field]
        else:
            items = fields[self.field]
            items[self.index], original = self.replacement, items[self.index]
        return original


def find_mutants(module: str, tree: ast.Module) -> list[Mutant]:
    """All mutants of a module, whose keys begin with its name."""
    count: Counter[str] = Counter()
    mutants = []
    for scope, parent, field, index, original, replacement in _edits(tree, "", ""):
        ast.fix_missing_locations(ast.copy_location(replacement, original))
        lines = range(original.lineno, (original.end_lineno or original.lineno) + 1)
        mutant = Mutant("", lines, parent, field, index, replacement)
        before = _shown(parent, original)
        restore = mutant.apply()
        after = _shown(parent, replacement)
        Mutant("", lines, parent, field, index, restore).apply()
        key = f"{module}:{scope}: {before} => {after}"
        count[key] += 1
        numbered = key if count[key] == 1 else f"{key} ({count[key]})"
        mutants.append(Mutant(numbered, lines, parent, field, index, replacement))
    return mutants


def _shown(parent: ast.AST, node: ast.AST) -> str:
    """The edited expression in its parent; alone where the parent is a statement of many lines."""
    compound = ast.FunctionDef | ast.ClassDef | ast.If | ast.While | ast.For | ast.Module
    return " ".join(ast.unparse(node if isinstance(parent, compound) else parent).split())


def _edits(node: ast.AST, scope: str, returns: str) -> Iterator[tuple]:
    for field, value in ast.iter_fields(node):
        if field in LEFT_ALONE:
            continue
        for index, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.Raise | ast.JoinedStr):
                continue
            replacements = [*_replacements(child, node), *_opposites(child, node, field, returns)]
            for replacement in replacements:
                yield scope, node, field, index, child, replacement
            if isinstance(child, ast.FunctionDef):
                result = ast.unparse(child.returns) if child.returns else ""
                yield from _edits(child, f"{scope}.{child.name}".lstrip("."), result)
            elif isinstance(child, ast.ClassDef):
                yield from _edits(child, f"{scope}.{child.name}".lstrip("."), "")
            else:
                yield from _edits(child, scope, returns)


def _replacements(node: ast.AST, parent: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.BinOp(left, operator, right) if type(operator) in ARITHMETIC:
            if isinstance(left, Sequence) or isinstance(right, Sequence):
                return
            yield ast.BinOp(left, ARITHMETIC[type(operator)](), right)
            if isinstance(operator, ast.Add | ast.Sub | ast.Mult | ast.Div):
                yield left
            if isinstance(operator, ast.Add | ast.Sub | ast.Mult):
                yield right
        case ast.AugAssign(target, operator, value) if type(operator) in ARITHMETIC:
            yield ast.AugAssign(target, ARITHMETIC[type(operator)](), value)
        case ast.UnaryOp(ast.USub() | ast.Not(), operand):
            yield operand
        case ast.Compare(left, [operator], right):
            for other in COMPARISONS[type(operator)]:
                yield ast.Compare(left, [other()], right)
        case ast.Compare(left, [first, second], right):  # a <= b < c: each boundary
            yield ast.Compare(left, [COMPARISONS[type(first)][0](), second], right)
            yield ast.Compare(left, [first, COMPARISONS[type(second)][0]()], right)
        case ast.BoolOp(operator, values):
            yield ast.BoolOp(ast.And() if isinstance(operator, ast.Or) else ast.Or(), values)
            yield from values
        case ast.IfExp(test, body, other):
            yield ast.IfExp(test, other, body)
        case ast.Constant(bool() as value):
            yield ast.Constant(not value)
        case ast.Constant(int() as value):
            yield ast.Constant(value + 1)
            yield ast.Constant(value - 1)
        case ast.Constant(float() as value):
            yield ast.Constant(1.1 * value if value else 1.0)
            if value and not isinstance(parent, ast.UnaryOp):
                yield ast.UnaryOp(ast.USub(), ast.Constant(value))
        case ast.Call(function, arguments, keywords):
            name = getattr(function, "id", getattr(function, "attr", ""))
            if name == "abs":
                yield arguments[0]
            if name in FUNCTIONS:
                yield ast.Call(_renamed(function), arguments, keywords)
            if name not in SYMMETRIC:
                for swapped in _swaps(arguments):
                    yield ast.Call(function, swapped, keywords)
        case ast.Tuple(elements, ast.Load()) if isinstance(parent, ast.Return):
            for swapped in _swaps(elements):
                yield ast.Tuple(swapped, ast.Load())


def _opposites(node: ast.AST, parent: ast.AST, field: str, returns: str) -> Iterator[ast.AST]:
    """A condition or a returned value turned over, where no other mutant does it."""
    named = isinstance(node, ast.Name | ast.Call | ast.Attribute | ast.BinOp)
    if named and (field == "test" or (isinstance(parent, ast.Return) and returns == "bool")):
        yield ast.UnaryOp(ast.Not(), node)
    if named and isinstance(parent, ast.Return) and returns == "float":
        yield ast.UnaryOp(ast.USub(), node)


def _renamed(function: ast.expr) -> ast.expr:
    if isinstance(function, ast.Attribute):
        return ast.Attribute(function.value, FUNCTIONS[function.attr], ast.Load())
    return ast.Name(FUNCTIONS[function.id], ast.Load())


def _swaps(items: list[ast.expr]) -> Iterator[list[ast.expr]]:
    """The list with two neighbors exchanged, for every two that differ."""
    for index in range(len(items) - 1):
        first, second = items[index : index + 2]
        starred = isinstance(first, ast.Starred) or isinstance(second, ast.Starred)
        if not starred and ast.dump(first) != ast.dump(second):
            yield [*items[:index], second, first, *items[index + 2 :]]
