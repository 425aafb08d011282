"""Programs as Python source."""

from __future__ import annotations

import linecache
import math
from collections.abc import Callable, Sequence
from itertools import count
from typing import Any, Final

from tiltsim_controllers.code.operations import OPERATIONS
from tiltsim_controllers.code.program import Program
from tiltsim_controllers.code.tracing import Block, Expr

_VALUES: Final = {name: operation.value for name, operation in OPERATIONS.items()}

_FAST: Final = {name: getattr(math, name) for name in _VALUES if hasattr(math, name)}
_FAST.update(fabs=abs, uniform=_VALUES["uniform"], nan=math.nan, inf=math.inf)
del _FAST["floor"]

_CAREFUL: Final = {**_FAST, **{name: _VALUES[name] for name in _FAST if name in _VALUES}}
_CAREFUL["div"] = _VALUES["div"]

_files = count()


def python_source(program: Program, name: str = "law", *, careful: bool = False) -> str:
    """The source of a Python function of the inputs that returns a tuple of floats.

    Args:
        program: The program.
        name: Of the function.
        careful: Whether a division by zero returns what IEEE 754 defines; else it raises.
    """
    arguments = ", ".join(item.name for item in program.inputs)
    lines = [f"def {name}({arguments}):"]
    writer = _Writer(program, lines, careful)
    writer.block(program.block, "    ")
    results = "".join(f"{writer.text(value)}, " for value in program.block.results)
    return "\n".join([*lines, f"    return ({results})", ""])


class _Writer:
    def __init__(self, program: Program, lines: list[str], careful: bool) -> None:
        self._inputs, self._lines, self._careful = program.inputs, lines, careful

    def text(self, value: Any) -> str:
        if isinstance(value, Expr):
            if value.op == "get":
                return f"t{value.args[0].number}_{value.args[1]}"
            return f"t{value.number}"
        return repr(value) if value >= 0.0 or isinstance(value, bool) else f"({value!r})"

    def block(self, block: Block, indent: str) -> None:
        """Write the lines of a block."""
        for operation in block.operations:
            file, line = operation.place
            comment = f"  # {file.rpartition('/')[2]}:{line}" if file else ""
            if operation.op == "branch":
                self._branch(operation, indent, comment)
            elif operation.op == "loop":
                self._loop(operation, indent, comment)
            elif operation.op not in ("get", "phi"):
                value = self._value(operation)
                self._lines.append(f"{indent}t{operation.number} = {value}{comment}")

    def _assign(self, names: Sequence[str], values: Sequence[Any], indent: str) -> None:
        if names:
            texts = (self.text(value) for value in values)
            self._lines.append(f"{indent}{', '.join(names)} = {', '.join(texts)}")

    def _branch(self, operation: Expr, indent: str, comment: str) -> None:
        (condition,) = operation.args
        heads = f"if {self.text(condition)}:{comment}", "else:"
        names = [f"t{operation.number}_{i}" for i in range(len(operation.blocks[0].results))]
        for head, block in zip(heads, operation.blocks):
            self._lines += [indent + head, indent + "    pass"]
            self.block(block, indent + "    ")
            self._assign(names, block.results, indent + "    ")

    def _loop(self, operation: Expr, indent: str, comment: str) -> None:
        (test, body), (count, *start) = operation.blocks, operation.args
        names = [self.text(parameter) for parameter in test.parameters]
        self._assign(names, [0.0, *start], indent)
        self._lines.append(f"{indent}while {names[0]} < {self.text(count)}:{comment}")
        inner = indent + "    "
        self.block(test, inner)
        if test.results[0] is not False:
            self._lines.append(f"{inner}if {self.text(test.results[0])}: break")
        self.block(body, inner)
        turn = f"{names[0]} + 1.0"
        values = ", ".join([turn, *map(self.text, body.results)])
        self._lines.append(f"{inner}{', '.join(names)} = {values}")
        results = [f"t{operation.number}_{i}" for i in range(len(start))]
        self._assign(results, test.parameters[1:], indent)

    def _value(self, operation: Expr) -> str:
        args: Sequence[Any] = operation.args
        match operation.op:
            case "in":
                return f"{self._inputs[args[0]].name}[{args[1]}]"
            case "take_input":
                return f"{self._inputs[args[1]].name}[{args[2]} + int({self.text(args[0])})]"
            case "take":
                table = "".join(f"{self.text(value)}, " for value in args[1:])
                return f"({table})[int({self.text(args[0])})]"
            case "div" if self._careful:
                return f"div({self.text(args[0])}, {self.text(args[1])})"
        return OPERATIONS[operation.op].python.format(*map(self.text, args))


def python_function(program: Program, name: str = "law") -> Callable[..., tuple[float, ...]]:
    """The program on Python's floats, with the results of machine code.

    Where Python raises, as for a division by zero, the program runs again by IEEE's rules.
    """
    functions = []
    for careful, names in ((False, _FAST), (True, _CAREFUL)):
        text = python_source(program, name, careful=careful)
        file = f"<traced {name} {next(_files)}>"
        linecache.cache[file] = len(text), None, text.splitlines(True), file  # for debuggers
        space: dict[str, Any] = dict(names)
        exec(compile(text, file, "exec"), space)
        functions.append(space[name])
    fast, careful_one = functions

    def run(*vectors: Sequence[float]) -> tuple[float, ...]:
        try:
            return fast(*vectors)  # type: ignore[no-any-return]
        except (ArithmeticError, ValueError):
            return careful_one(*vectors)  # type: ignore[no-any-return]

    return run
