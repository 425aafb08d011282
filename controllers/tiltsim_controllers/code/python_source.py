"""Programs as Python source."""

import linecache
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import count
from types import CodeType
from typing import Any, Final
from weakref import WeakKeyDictionary

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


def python_source(
    program: Program, name: str = "law", *, fixed: Collection[str] = (), careful: bool = False
) -> str:
    """The source of a Python function of the inputs that returns a tuple of floats.

    Args:
        program: The program.
        name: Name of the function.
        fixed: Inputs that do not change: the source defines a function of them, ``bind``, which
            evaluates once all that depends on nothing else and returns the function of the other
            inputs.
        careful: Whether a division by zero returns the result of IEEE 754; else it raises.
    """
    names = [item.name for item in program.inputs]
    lines: list[str] = []
    writer = _Writer(program, lines, careful)
    operations, indent = program.block.operations, "    "
    if fixed:
        known = _depending_only_on([names.index(one) for one in fixed], operations)
        lines.append(f"def bind({', '.join(fixed)}):")
        writer.operations([one for one in operations if one.number in known], indent)
        operations = [one for one in operations if one.number not in known]
        names = [one for one in names if one not in fixed]
    outer = indent * bool(fixed)
    lines.append(f"{outer}def {name}({', '.join(names)}):")
    operations = writer.unpacked(operations, outer + indent)
    writer.operations(operations, outer + indent)
    results = "".join(f"{writer.text(value)}, " for value in program.block.results)
    lines.append(f"{outer}{indent}return ({results})")
    return "\n".join([*lines, *([f"{indent}return {name}"] if fixed else []), ""])


def _depending_only_on(arguments: Sequence[int], operations: Sequence[Expr]) -> set[int]:
    """Numbers of the operations that need no other input; branches and loops are left out."""
    known: set[int] = set()
    for operation in operations:
        if operation.op == "in":
            is_known = operation.args[0] in arguments
        elif operation.op == "take_input":
            is_known = operation.args[1] in arguments and operation.args[0].number in known
        else:
            inputs = [value.number for value in operation.args if isinstance(value, Expr)]
            is_known = not operation.blocks and known.issuperset(inputs)
        if is_known:
            known.add(operation.number)
    return known


_REPEATS: Final = {"abs", "floor", "branch", "loop"}
"""Operations whose text has an argument more than once, or that are statements."""

_LONG: Final = 200
"""Characters of an expression that gets a separate line: Python's parser limits their depth."""


class _Writer:
    """Writes operations as lines; a number that is used once becomes part of that expression."""

    def __init__(self, program: Program, lines: list[str], careful: bool) -> None:
        self._inputs, self._lines, self._careful = program.inputs, lines, careful
        self._uses = Counter(
            value.number
            for values in _arguments(program.block)
            for value in values
            if isinstance(value, Expr)
        )
        self._inner: dict[int, str] = {}  # expressions by the number that they compute

    def text(self, value: Any) -> str:
        """A number in Python's notation."""
        if isinstance(value, Expr):
            if value.op == "get":
                return f"t{value.args[0].number}_{value.args[1]}"
            return self._inner.get(value.number) or f"t{value.number}"
        return repr(value) if value >= 0.0 or isinstance(value, bool) else f"({value!r})"

    def operations(self, operations: Sequence[Expr], indent: str) -> None:
        """Write the lines of operations."""
        users = (one.args for one in operations if one.op not in _REPEATS)
        here = {value.number for args in users for value in args if isinstance(value, Expr)}
        for operation in operations:
            file, line = operation.place
            comment = f"  # {file.rpartition('/')[2]}:{line}" if file else ""
            if operation.op == "branch":
                self._branch(operation, indent, comment)
            elif operation.op == "loop":
                self._loop(operation, indent, comment)
            elif operation.op not in ("get", "phi"):
                value, number = self._value(operation), operation.number
                if self._uses[number] == 1 and number in here and len(value) < _LONG:
                    self._inner[number] = f"({value})"
                else:
                    self._lines.append(f"{indent}t{number} = {value}{comment}")

    def unpacked(self, operations: Sequence[Expr], indent: str) -> list[Expr]:
        """Unpack inputs most of whose entries are used; returns the operations that are left."""
        rest = list(operations)
        for argument, (name, size) in enumerate(self._inputs):
            used = {o.args[1]: o for o in rest if o.op == "in" and o.args[0] == argument}
            if 2 * len(used) > size:
                names = [f"t{used[i].number}" if i in used else "_" for i in range(size)]
                self._lines.append(f"{indent}{', '.join(names)}, = {name}")
                rest = [o for o in rest if o.op != "in" or o.args[0] != argument]
        return rest

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
            self.operations(block.operations, indent + "    ")
            self._assign(names, block.results, indent + "    ")

    def _loop(self, operation: Expr, indent: str, comment: str) -> None:
        (test, body), (count, *start) = operation.blocks, operation.args
        names = [self.text(parameter) for parameter in test.parameters]
        self._assign(names, [0.0, *start], indent)
        self._lines.append(f"{indent}while {names[0]} < {self.text(count)}:{comment}")
        inner = indent + "    "
        self.operations(test.operations, inner)
        if test.results[0] is not False:
            self._lines.append(f"{inner}if {self.text(test.results[0])}: break")
        self.operations(body.operations, inner)
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


def _arguments(block: Block) -> Iterator[Sequence[Any]]:
    """Values that the operations of a block and of its inner blocks use."""
    yield block.results
    for operation in block.operations:
        yield operation.args
        for inner in operation.blocks:
            yield from _arguments(inner)


def python_function(
    program: Program, name: str = "law", *, fixed: Mapping[str, Sequence[float]] | None = None
) -> Callable[..., tuple[float, ...]]:
    """The program on Python's floats, with the results of machine code.

    Where Python raises, as for a division by zero, the program runs again by IEEE's rules.
    ``fixed`` has the numbers of inputs that do not change; the function has the other inputs.
    Debuggers show its name.
    """
    try:
        fast = _compiled(program, name, fixed, careful=False)
    except (ArithmeticError, ValueError):  # constant parts divide by zero
        return _compiled(program, name, fixed, careful=True)
    careful: list[Callable[..., tuple[float, ...]]] = []

    def run(*vectors: Sequence[float]) -> tuple[float, ...]:
        try:
            return fast(*vectors)
        except (ArithmeticError, ValueError):
            if not careful:
                careful.append(_compiled(program, name, fixed, careful=True))
            return careful[0](*vectors)

    return run


def _compiled(
    program: Program, name: str, fixed: Mapping[str, Sequence[float]] | None, *, careful: bool
) -> Callable[..., tuple[float, ...]]:
    fixed = fixed or {}
    space = dict(_CAREFUL if careful else _FAST)
    exec(_code(program, name, tuple(fixed), careful), space)
    function: Callable[..., tuple[float, ...]]
    function = space["bind"](*fixed.values()) if fixed else space[name]
    return function


_codes: Final[WeakKeyDictionary[Block, dict[Any, CodeType]]] = WeakKeyDictionary()


def _code(program: Program, name: str, fixed: tuple[str, ...], careful: bool) -> CodeType:
    """The source of a program as Python's code, compiled once."""
    known = _codes.setdefault(program.block, {})
    key = name, fixed, careful
    if key not in known:
        text = python_source(program, name, fixed=fixed, careful=careful)
        file = f"<traced {name} {next(_files)}>"
        linecache.cache[file] = len(text), None, text.splitlines(True), file  # for debuggers
        known[key] = compile(text, file, "exec")
    return known[key]
