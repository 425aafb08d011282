"""Programs as LLVM text, without fast-math: machine code has the results of Python, bit by bit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from tiltsim_controllers.code.lane_functions import LANE_FUNCTIONS, PROGRAMS, functions_text
from tiltsim_controllers.code.lanes import PURE, LaneMath, Lanes
from tiltsim_controllers.code.operations import OPERATIONS
from tiltsim_controllers.code.program import Program, operations_of
from tiltsim_controllers.code.tracing import Block, Expr, is_condition

UNIFORM: Final = """
define internal <I> @hash_word(<I> %w) alwaysinline {
  %a = lshr <I> %w, <16>
  %b = xor <I> %w, %a
  %c = mul <I> %b, <2146121005>
  %d = and <I> %c, <4294967295>
  %e = lshr <I> %d, <15>
  %f = xor <I> %d, %e
  %g = mul <I> %f, <2221713035>
  %h = and <I> %g, <4294967295>
  %i = lshr <I> %h, <16>
  %j = xor <I> %h, %i
  ret <I> %j
}
define internal <I> @word(<D> %x) alwaysinline {
  %size = call <D> @llvm.fabs.<f64>(<D> %x)
  %fits = fcmp olt <D> %size, <0x43E0000000000000>
  %y = select <B> %fits, <D> %x, <D> zeroinitializer
  %i = fptosi <D> %y to <I>
  %w = and <I> %i, <4294967295>
  ret <I> %w
}
define internal <D> @uniform(<D> %seed, <D> %channel, <D> %index) {
  %a = call <I> @word(<D> %seed)
  %b = call <I> @word(<D> %channel)
  %c = call <I> @word(<D> %index)
  %d = call <I> @hash_word(<I> %a)
  %e = add <I> %d, %b
  %f = and <I> %e, <4294967295>
  %g = call <I> @hash_word(<I> %f)
  %h = add <I> %g, %c
  %i = and <I> %h, <4294967295>
  %j = call <I> @hash_word(<I> %i)
  %k = uitofp <I> %j to <D>
  %l = fadd <D> %k, <0x3FE0000000000000>
  %m = fdiv <D> %l, <0x41F0000000000000>
  ret <D> %m
}
"""
"""`tiltsim_controllers.code.operations.uniform`."""

ANY: Final = {
    False: """
define internal i1 @any(i1 %condition) alwaysinline nounwind {
  ret i1 %condition
}
""",
    True: """
declare i1 @llvm.vector.reduce.or.v<lanes>i1(<B>)
define internal i1 @any(<B> %condition) alwaysinline nounwind {
  %some = call i1 @llvm.vector.reduce.or.v<lanes>i1(<B> %condition)
  ret i1 %some
}
""",
}
"""Whether a condition holds in any lane, by whether there are several."""

FMA: Final = "llvm.fma"
"""Only the programs of `tiltsim_controllers.code.lane_functions` have it."""

ALIGNED: Final = "align 8"
"""Vectors begin where a number may begin."""


def llvm_functions(
    programs: Mapping[str, Program], lanes: int = 1, functions: LaneMath = "library"
) -> str:
    """The text of ``void name(double *argument, ..., double *results)`` for every program by name.

    Entry i of vehicle k, of those side by side in ``lanes``, lies at i * lanes + k; see `Lanes`.
    """
    side_by_side = Lanes(lanes, functions)
    declared: dict[str, str] = {}
    tables: list[str] = []
    needed: set[str] = set()

    def written(name: str, program: Program) -> str:
        writer = _Writer(name, side_by_side, declared, tables)
        text = _function(name, program, writer)
        needed.update(writer.functions)
        return text

    bodies = [written(name, program) for name, program in programs.items()]
    bodies.append(functions_text(sorted(needed), side_by_side, written))
    noise = []
    if any(map(_uses_noise, programs.values())):
        noise.append(side_by_side.filled(UNIFORM))
        _declare(declared, f"llvm.fabs.{side_by_side.suffix}", side_by_side.number, 1)
    some = side_by_side.filled(ANY[lanes > 1])
    return "\n".join([some, *tables, *noise, *declared.values(), *bodies])


def _declare(declared: dict[str, str], name: str, kind: str, arguments: int) -> None:
    declared[name] = f"declare {kind} @{name}({', '.join([kind] * arguments)}) {PURE}"


def _function(name: str, program: Program, writer: _Writer) -> str:
    writer.block(program.block)
    for index, result in enumerate(program.block.results):
        writer.store(result, writer.place("%out", index))
    arguments = ", ".join([*(f"ptr %a{k}" for k in range(len(program.inputs))), "ptr %out"])
    head = f"define internal void @{name}({arguments}) nounwind {{"
    return "\n".join([head, "entry:", *writer.start, *writer.lines, "  ret void", "}", ""])


class _Writer:
    """Writes the body of one function.

    With several lanes, a side of a branch is evaluated if any vehicle needs it, a loop goes on as
    long as any vehicle is in it, and each vehicle keeps its own results.
    """

    def __init__(
        self, name: str, lanes: Lanes, declared: dict[str, str], tables: list[str]
    ) -> None:
        self._name, self._lanes = name, lanes
        self._declared, self._tables = declared, tables
        self._number, self._condition = lanes.number, lanes.condition
        self.functions: set[str] = set()  # of `PROGRAMS`
        self.start: list[str] = []
        self.lines: list[str] = []
        self._count = 0
        self._label = "entry"
        self._mask = lanes.constant(True)  # vehicles that need the operations being written

    def _put(self, text: str) -> None:
        self.lines.append(f"  {text}")

    def _new(self, text: str) -> str:
        self._count += 1
        self._put(f"%v{self._count} = {text}")
        return f"%v{self._count}"

    def place(self, vector: str, index: int | str) -> str:
        """The address of an entry of a vector."""
        return self._new(f"getelementptr {self._number}, ptr {vector}, i64 {index}")

    def store(self, value: Any, place: str) -> None:
        """Write a number to memory."""
        self._put(f"store {self._number} {self.text(value)}, ptr {place}, {ALIGNED}")

    def text(self, value: Any) -> str:
        """A number in LLVM's notation."""
        if not isinstance(value, Expr):
            return self._lanes.constant(value)
        if value.op != "get":
            return f"%t{value.number}"
        node, index = value.args
        if node.op == "loop":  # its parameters, as they are when it ends
            return self.text(node.blocks[0].parameters[1 + index])
        return f"%t{node.number}.{index}"

    def block(self, block: Block) -> None:
        """Write operations."""
        for operation in block.operations:
            target, args = f"%t{operation.number}", operation.args
            if operation.op == "in":
                place = self.place(f"%a{args[0]}", args[1])
                self._put(f"{target} = load {self._number}, ptr {place}, {ALIGNED}")
            elif operation.op == "take_input":
                self._load(target, args[0], self.place(f"%a{args[1]}", args[2]))
            elif operation.op == "take":
                self._take(target, args[0], args[1:])
            elif operation.op == "branch":
                self._branch(operation)
            elif operation.op == "loop":
                self._loop(operation)
            elif operation.op not in ("get", "phi"):
                self._put(f"{target} = {self._operation(operation)}")

    def _begin(self, label: str) -> None:
        self._label = label
        self.lines.append(f"{label}:")

    def _any(self, condition: str) -> str:
        return self._new(f"call i1 @any({self._condition} {condition})")

    def _both(self, one: str, other: str) -> str:
        return self._new(
            f"select {self._condition} {one}, {self._condition} {other}, "
            f"{self._condition} {self._lanes.constant(False)}"
        )

    def _not(self, condition: str) -> str:
        return self._new(f"xor {self._condition} {condition}, {self._lanes.constant(True)}")

    def _branch(self, operation: Expr) -> None:
        k, mask = operation.number, self._mask
        condition = self.text(operation.args[0])
        sides = condition, self._not(condition)
        for name, needs, block in zip(("then", "else"), sides, operation.blocks):
            self._mask = self._both(mask, needs)
            before, any_ = self._label, self._any(self._mask)
            self._put(f"br i1 {any_}, label %{name}{k}, label %{name}{k}.end")
            self._begin(f"{name}{k}")
            self.block(block)
            end = self._label
            self._put(f"br label %{name}{k}.end")
            self._begin(f"{name}{k}.end")
            for index, result in enumerate(block.results):
                values = f"[{self.text(result)}, %{end}], [zeroinitializer, %{before}]"
                self._put(f"%{name}{k}.{index} = phi {self._number} {values}")
        self._mask = mask
        for index in range(len(operation.blocks[0].results)):
            values = ", ".join(f"{self._number} %{side}{k}.{index}" for side in ("then", "else"))
            self._put(f"%t{k}.{index} = select {self._condition} {condition}, {values}")

    def _loop(self, operation: Expr) -> None:
        (test, body), (count, *start) = operation.blocks, operation.args
        k, before, mask = operation.number, self._label, self._mask
        self._put(f"br label %head{k}")
        self._begin(f"head{k}")
        place = len(self.lines)  # of the parameters, whose later values are not known yet
        within = f"%within{k}"
        self._mask = within
        self.block(test)
        turn = self.text(test.parameters[0])
        more = self._new(f"fcmp olt {self._number} {turn}, {self.text(count)}")
        if test.results[0] is not False:
            more = self._both(self._not(self.text(test.results[0])), more)
        more = self._mask = self._both(within, more)
        self._put(f"br i1 {self._any(more)}, label %body{k}, label %exit{k}")
        self._begin(f"body{k}")
        self.block(body)
        one = self.text(1.0)
        later = [self._new(f"fadd {self._number} {turn}, {one}")]
        for parameter, result in zip(test.parameters[1:], body.results):
            values = f"{self._number} {self.text(result)}, {self._number} {self.text(parameter)}"
            later.append(self._new(f"select {self._condition} {more}, {values}"))
        self._put(f"br label %head{k}")
        first = [self.text(value) for value in (0.0, *start)]
        number, condition = self._number, self._condition
        self.lines[place:place] = [
            f"  {within} = phi {condition} [{mask}, %{before}], [{more}, %{self._label}]",
            *(
                f"  {self.text(p)} = phi {number} [{a}, %{before}], [{b}, %{self._label}]"
                for p, a, b in zip(test.parameters, first, later)
            ),
        ]
        self._mask = mask
        self._begin(f"exit{k}")

    def _load(self, target: str, index: Any, table: str) -> None:
        """Take the entry of an input at an index."""
        whole = self._new(f"fptosi {self._number} {self.text(index)} to {self._lanes.integer}")
        if self._lanes.count > 1:
            whole = self._new(self._lanes.filled(f"mul <I> {whole}, <{self._lanes.count}>"))
            lanes = ", ".join(f"i64 {lane}" for lane in range(self._lanes.count))
            whole = self._new(f"add {self._lanes.integer} {whole}, <{lanes}>")
        self._gather(target, table, whole)

    def _gather(self, target: str, table: str, index: str) -> None:
        """Load a number per lane; an index counts numbers."""
        lanes = self._lanes
        places = f"getelementptr double, ptr {table}, {lanes.integer} {index}"
        if lanes.count == 1:
            self._put(f"{target} = load double, ptr {self._new(places)}, {ALIGNED}")
            return
        count = lanes.count
        name = f"llvm.masked.gather.v{count}f64.v{count}p0"
        self._declared[name] = (
            f"declare {self._number} @{name}(<{count} x ptr>, i32, {self._condition}, "
            f"{self._number})"
        )
        self._put(
            f"{target} = call {self._number} @{name}(<{count} x ptr> {self._new(places)}, i32 8, "
            f"{self._condition} {lanes.constant(True)}, {self._number} poison)"
        )

    def _take(self, target: str, index: Any, values: Sequence[Any]) -> None:
        """Take one of several numbers: from a constant table, or from the stack."""
        size = len(values)
        if any(isinstance(value, Expr) for value in values):
            table = f"%s{len(self.start)}"
            self.start.append(f"  {table} = alloca {self._number}, i64 {size}, {ALIGNED}")
            for place, value in enumerate(values):
                self.store(value, self.place(table, place))
            self._load(target, index, table)
            return
        table = f"@{self._name}.table{len(self._tables)}"
        entries = ", ".join(f"double {Lanes().constant(value)}" for value in values)
        self._tables.append(f"{table} = private constant [{size} x double] [{entries}]")
        whole = self._new(f"fptosi {self._number} {self.text(index)} to {self._lanes.integer}")
        self._gather(target, table, whole)

    def _operation(self, operation: Expr) -> str:
        args = [self.text(a) for a in operation.args]
        code = FMA if operation.op == "fma" else OPERATIONS[operation.op].llvm
        number, condition = self._number, self._condition
        if " " in code:
            kind = condition if operation.op == "where" and is_condition(operation) else number
            return code.format(*args, T=kind, B=condition, true=self._lanes.constant(True))
        if code.startswith("llvm."):
            code += f".{self._lanes.suffix}"
            _declare(self._declared, code, number, len(args))
        elif code != "uniform":
            _declare(self._declared, code, "double", len(args))
            if self._lanes.count > 1:
                return self._in_lanes(code, args)
        return f"call {number} @{code}({', '.join(f'{number} {a}' for a in args)})"

    def _in_lanes(self, code: str, args: Sequence[str]) -> str:
        """A function of the C library for all lanes."""
        number = self._number
        given = ", ".join(f"{number} {arg}" for arg in args)
        found = LANE_FUNCTIONS.get(code) if self._lanes.functions != "library" else None
        if found is None:
            own = f"{code}.lanes"
            self._declared.setdefault(own, self._lanes.one_by_one(code, len(args)))
            return f"call {number} @{own}({given})"
        program, place = found
        self.functions.add(program)
        names = PROGRAMS[program].names
        for name in names:
            _declare(self._declared, name, "double", len(args))
        kind = "{ " + ", ".join([number] * len(names)) + " }"
        both = self._new(f"call {kind} @{program}.lanes({given})")
        return f"extractvalue {kind} {both}, {place}"


def _uses_noise(program: Program) -> bool:
    return any(operation.op == "uniform" for operation in operations_of(program.block))
