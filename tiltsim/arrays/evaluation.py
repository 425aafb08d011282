"""Evaluation of the statements of a function on arrays; see `tiltsim.arrays.lifting`."""

import ast
import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Any, cast

from tiltsim.arrays.expressions import DATA_LENGTH, Borrowed, Expressions
from tiltsim.arrays.values import LiftError, PlainNumberError

Ends = dict[str, tuple[Any, Any]]
"""Ends of a block of code by kind: the condition of each, and its variables or value."""

NEXT, RETURN, BREAK, CONTINUE = "next", "return", "break", "continue"


class Frame(Expressions):
    """The evaluation of one call."""

    def call(self, args: Iterable[Any], keywords: Mapping[str, Any]) -> Any:
        """The value of the function."""
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
                # A plan that raises an error whatever the arrays are needs plain numbers.
                kind = LiftError if ends else PlainNumberError
                raise self.error("may end without a value", kind)
            value = ends[RETURN][1]
        return list(value) if isinstance(value, Borrowed) else value

    def block(self, statements: list[ast.stmt], variables: dict[str, Any]) -> Ends:
        """Evaluate statements one after the other."""
        ends: Ends = {NEXT: (True, variables)}
        for place, statement in enumerate(statements):
            if NEXT not in ends:
                break
            condition, variables = ends.pop(NEXT)
            if self.lifting.arrays.is_lazy and condition is not True and set(ends) == {RETURN}:
                return self.otherwise(ends, condition, statements[place:], variables)
            self.line = statement.lineno
            with self.lifting.under(condition):
                try:
                    later = self.statement(statement, variables)
                    ends = self.follow(ends, condition, later)
                except (ArithmeticError, LookupError, TypeError, ValueError) as error:
                    text = f"{type(error).__name__}: {error}".partition("\n")[0]
                    refused = isinstance(error, self.lifting.arrays.refusals)
                    kind = PlainNumberError if refused else LiftError
                    raise self.error(text, kind) from error
        return ends

    def otherwise(
        self, ends: Ends, condition: Any, statements: list[ast.stmt], variables: dict[str, Any]
    ) -> Ends:
        """Evaluate statements after an early return only where they are reached.

        Args:
            ends: The early return.
            condition: Whether there was none.
            statements: The statements that follow it.
            variables: Their values without it.
        """
        lifting, arrays = self.lifting, cast(Any, self.lifting.arrays)
        with arrays.side() as side, lifting.under(condition):
            later = self.block(statements, variables)
        if set(later) == {RETURN} and later[RETURN][0] is True:
            with arrays.joined(condition, side):
                value = lifting.select(condition, later[RETURN][1], ends[RETURN][1])
            return {RETURN: (True, value)}
        arrays.keep(side)
        return self.follow(ends, condition, later)

    def follow(self, ends: Ends, condition: Any, later: Ends) -> Ends:
        """Ends of a block so far, joined with later ends under a condition."""
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
        """Evaluate one statement."""
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
            case ast.Raise() if self.lifting.planning:
                return {}
            case ast.Try(finalbody=[]) if self.lifting.planning:  # to name an error by its key
                return self.block([*node.body, *node.orelse], variables)
            case ast.Expr(value=ast.Call()) if self.lifting.planning:  # appends to a list
                self.value(node.value, variables)
            case ast.Break():
                return {BREAK: (True, variables)}
            case ast.Continue():
                return {CONTINUE: (True, variables)}
            case ast.Pass() | ast.Assert() | ast.Expr(value=ast.Constant()):
                pass
            case ast.ImportFrom():  # of a package that computes with plain numbers
                raise self.error(f"{ast.unparse(node)} has no form on arrays", PlainNumberError)
            case _:
                raise self.error(f"{type(node).__name__} has no form on arrays")
        return {NEXT: (True, variables)}

    def branches(self, node: ast.If, variables: dict[str, Any]) -> Ends:
        """Evaluate one branch of an ``if``, or both."""
        condition = self.value(node.test, variables)
        if not self.lifting.arrays.is_array(condition):
            return self.block(node.body if condition else node.orelse, variables)
        opposite = self.lifting.arrays.negated(condition)
        with self.lifting.under(condition):
            yes = self.block(node.body, _copied(variables))
        with self.lifting.under(opposite):
            no = self.block(node.orelse, _copied(variables))
        self.line = node.lineno
        if not yes or not no:  # one of them raises an error
            return yes or no
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


def _copied(variables: dict[str, Any]) -> dict[str, Any]:
    """Variables for one of two branches: a list that it changes is its own."""
    return {
        name: type(value)(value) if isinstance(value, list) else value
        for name, value in variables.items()
    }
