"""Programs as functions of CasADi."""

import math
import operator
from collections.abc import Sequence
from typing import Any, Final

from tiltsim_controllers.code.messages import TraceError
from tiltsim_controllers.code.program import Program, operations_of
from tiltsim_controllers.code.tracing import Block, Expr

_RENAMED: Final = {
    "and": "logic_and",
    "or": "logic_or",
    "not": "logic_not",
    "where": "if_else",
    "abs": "fabs",
    "pow": "power",
}
"""CasADi's names of operations, where they differ."""

_OPERATORS: Final = {
    name: getattr(operator, name)
    for name in ("add", "sub", "mul", "neg", "lt", "le", "gt", "ge", "eq", "ne")
} | {"div": operator.truediv}


def casadi_function(program: Program, name: str, result: str) -> Any:
    """A `casadi.Function` of a column for every input, whose ``result``, by name, is one column.

    Branches are evaluated lazily, loops are unrolled.

    Raises:
        TraceError: If the program needs random numbers, or the count of a loop is not known.
    """
    import casadi as installed

    casadi: Any = installed
    lazy = any(operation.blocks for operation in operations_of(program.block))
    kind = casadi.MX if lazy else casadi.SX
    columns = [kind.sym(item.name, item.size) for item in program.inputs]
    entries = [casadi.vertsplit(c) if c.numel() else [] for c in columns]
    writer = _Writer(casadi, entries)
    writer.block(program.block)
    value = casadi.vertcat(*map(writer.value, program.block.results))
    names = [item.name for item in program.inputs]
    return casadi.Function(name, columns, [value], names, [result])


class _Writer:
    def __init__(self, casadi: Any, entries: list[list[Any]]) -> None:
        self._casadi, self._entries = casadi, entries
        self._values: dict[int, Any] = {}

    def value(self, number: Any) -> Any:
        """CasADi's expression of a number."""
        return self._values[number.number] if isinstance(number, Expr) else number

    def block(self, block: Block) -> None:
        """Evaluate operations."""
        for operation in block.operations:
            if operation.op != "phi":
                self._values[operation.number] = self._operation(operation)

    def _operation(self, operation: Expr) -> Any:
        args, casadi = operation.args, self._casadi
        match operation.op:
            case "in":
                return self._entries[args[0]][args[1]]
            case "get":
                return self._values[args[0].number][args[1]]
            case "take":
                return self._chosen(self.value(args[0]), [*map(self.value, args[1:])])
            case "take_input":
                return self._chosen(self.value(args[0]), self._entries[args[1]][args[2] :])
            case "branch":
                return self._branch(operation)
            case "loop":
                return self._loop(operation)
            case "uniform":
                raise _refused(operation, "random numbers have no symbolic form")
        name = operation.op
        function = _OPERATORS.get(name) or getattr(casadi, _RENAMED.get(name, name))
        return function(*map(self.value, args))

    def _chosen(self, index: Any, entries: Sequence[Any]) -> Any:
        found = entries[0]
        for place, entry in enumerate(entries[1:], start=1):
            found = self._casadi.if_else(index >= place, entry, found)
        return found

    def _branch(self, operation: Expr) -> Any:
        sides = []
        for block in operation.blocks:
            self.block(block)
            sides.append(self._casadi.vertcat(*map(self.value, block.results)))
        condition = self.value(operation.args[0])
        return self._casadi.vertsplit(self._casadi.if_else(condition, *sides, True))

    def _loop(self, operation: Expr) -> Any:
        (test, body), (count, *start) = operation.blocks, operation.args
        if isinstance(count, Expr):
            raise _refused(operation, "the number of turns of a loop has to be known")
        values, over = [*map(self.value, start)], 0.0
        for turn in range(math.ceil(count)):
            for parameter, value in zip(test.parameters, [float(turn), *values]):
                self._values[parameter.number] = value
            self.block(test)
            over = self._casadi.logic_or(over, self.value(test.results[0]))
            self.block(body)
            pairs = zip(values, map(self.value, body.results))
            values = [self._casadi.if_else(over, old, new) for old, new in pairs]
        return values


def _refused(operation: Expr, fault: str) -> TraceError:
    file, line = operation.place
    return TraceError(f"{file}:{line}: {fault}" if file else fault)
