"""Programs as LLVM text, without fast-math: machine code has the results of Python, bit by bit."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final

from tiltsim_controllers.code.operations import OPERATIONS
from tiltsim_controllers.code.program import Program, operations_of
from tiltsim_controllers.code.tracing import Block, Expr, is_condition

UNIFORM: Final = """
define internal i64 @hash_word(i64 %w) alwaysinline {
  %a = lshr i64 %w, 16
  %b = xor i64 %w, %a
  %c = mul i64 %b, 2146121005
  %d = and i64 %c, 4294967295
  %e = lshr i64 %d, 15
  %f = xor i64 %d, %e
  %g = mul i64 %f, 2221713035
  %h = and i64 %g, 4294967295
  %i = lshr i64 %h, 16
  %j = xor i64 %h, %i
  ret i64 %j
}
define internal i64 @word(double %x) alwaysinline {
  %size = call double @llvm.fabs.f64(double %x)
  %fits = fcmp olt double %size, 0x43E0000000000000
  %y = select i1 %fits, double %x, double 0.0
  %i = fptosi double %y to i64
  %w = and i64 %i, 4294967295
  ret i64 %w
}
define internal double @uniform(double %seed, double %channel, double %index) {
  %a = call i64 @word(double %seed)
  %b = call i64 @word(double %channel)
  %c = call i64 @word(double %index)
  %d = call i64 @hash_word(i64 %a)
  %e = add i64 %d, %b
  %f = and i64 %e, 4294967295
  %g = call i64 @hash_word(i64 %f)
  %h = add i64 %g, %c
  %i = and i64 %h, 4294967295
  %j = call i64 @hash_word(i64 %i)
  %k = uitofp i64 %j to double
  %l = fadd double %k, 5.000000e-01
  %m = fdiv double %l, 0x41F0000000000000
  ret double %m
}
"""
"""`tiltsim_controllers.mathematics.noise.uniform`."""

_PURE: Final = "nounwind willreturn memory(none)"


def llvm_functions(programs: Mapping[str, Program]) -> str:
    """The text of ``void name(double *argument, ..., double *results)`` for every program."""
    declared: dict[str, str] = {}
    tables: list[str] = []
    bodies = [_function(name, program, declared, tables) for name, program in programs.items()]
    noise = [UNIFORM] if any(map(_uses_noise, programs.values())) else []
    if noise:
        declared.setdefault("llvm.fabs.f64", f"declare double @llvm.fabs.f64(double) {_PURE}")
    return "\n".join([*tables, *noise, *declared.values(), *bodies])


def _function(name: str, program: Program, declared: dict[str, str], tables: list[str]) -> str:
    writer = _Writer(name, declared, tables)
    writer.block(program.block)
    for index, result in enumerate(program.block.results):
        writer.store(result, writer.place("%out", index))
    arguments = ", ".join([*(f"ptr noalias %a{k}" for k in range(len(program.inputs)))])
    head = f"define internal void @{name}({arguments}, ptr noalias %out) nounwind {{"
    return "\n".join([head, "entry:", *writer.start, *writer.lines, "  ret void", "}", ""])


class _Writer:
    """Writes the body of one function."""

    def __init__(self, name: str, declared: dict[str, str], tables: list[str]) -> None:
        self._name, self._declared, self._tables = name, declared, tables
        self.start: list[str] = []
        self.lines: list[str] = []
        self._count = 0
        self._label = "entry"

    def _new(self, text: str) -> str:
        self._count += 1
        self.lines.append(f"  %v{self._count} = {text}")
        return f"%v{self._count}"

    def place(self, vector: str, index: int | str) -> str:
        """The address of an entry of a vector."""
        return self._new(f"getelementptr double, ptr {vector}, i64 {index}")

    def store(self, value: Any, place: str) -> None:
        """Write a number to memory."""
        self.lines.append(f"  store double {self.text(value)}, ptr {place}")

    def text(self, value: Any) -> str:
        """A number in LLVM's notation."""
        if isinstance(value, Expr):
            if value.op != "get":
                return f"%t{value.number}"
            node, index = value.args
            if node.op == "loop":  # its parameters, as they are when it ends
                return self.text(node.blocks[0].parameters[1 + index])
            return f"%t{node.number}.{index}"
        if isinstance(value, bool):
            return str(value).lower()
        (bits,) = struct.unpack("Q", struct.pack("d", value))
        return f"0x{bits:016X}"

    def block(self, block: Block) -> None:
        """Write operations."""
        for operation in block.operations:
            target, args = f"%t{operation.number}", operation.args
            if operation.op == "in":
                place = self.place(f"%a{args[0]}", args[1])
                self.lines.append(f"  {target} = load double, ptr {place}")
            elif operation.op == "take_input":
                self._load(target, args[0], self.place(f"%a{args[1]}", args[2]))
            elif operation.op == "take":
                self._load(target, args[0], self._table(args[1:]))
            elif operation.op == "branch":
                self._branch(operation)
            elif operation.op == "loop":
                self._loop(operation)
            elif operation.op not in ("get", "phi"):
                self.lines.append(f"  {target} = {self._operation(operation)}")

    def _begin(self, label: str) -> None:
        self._label = label
        self.lines.append(f"{label}:")

    def _branch(self, operation: Expr) -> None:
        k, ends = operation.number, []
        condition = self.text(operation.args[0])
        self.lines.append(f"  br i1 {condition}, label %then{k}, label %else{k}")
        for side, block in zip(("then", "else"), operation.blocks):
            self._begin(f"{side}{k}")
            self.block(block)
            ends.append(self._label)
            self.lines.append(f"  br label %join{k}")
        self._begin(f"join{k}")
        pairs = zip(*(block.results for block in operation.blocks))
        for index, (yes, no) in enumerate(pairs):
            values = f"[{self.text(yes)}, %{ends[0]}], [{self.text(no)}, %{ends[1]}]"
            self.lines.append(f"  %t{k}.{index} = phi double {values}")

    def _loop(self, operation: Expr) -> None:
        (test, body), (count, *start) = operation.blocks, operation.args
        k, before = operation.number, self._label
        self.lines.append(f"  br label %head{k}")
        self._begin(f"head{k}")
        place = len(self.lines)  # of the parameters, whose later values are not known yet
        self.block(test)
        turn = self.text(test.parameters[0])
        more = self._new(f"fcmp olt double {turn}, {self.text(count)}")
        if test.results[0] is not False:
            more = self._new(f"select i1 {self.text(test.results[0])}, i1 false, i1 {more}")
        self.lines.append(f"  br i1 {more}, label %body{k}, label %exit{k}")
        self._begin(f"body{k}")
        self.block(body)
        later = [self._new(f"fadd double {turn}, {self.text(1.0)}"), *map(self.text, body.results)]
        self.lines.append(f"  br label %head{k}")
        first = [self.text(value) for value in (0.0, *start)]
        self.lines[place:place] = [
            f"  {self.text(p)} = phi double [{a}, %{before}], [{b}, %{self._label}]"
            for p, a, b in zip(test.parameters, first, later)
        ]
        self._begin(f"exit{k}")

    def _load(self, target: str, index: Any, table: str) -> None:
        whole = self._new(f"fptosi double {self.text(index)} to i64")
        self.lines.append(f"  {target} = load double, ptr {self.place(table, whole)}")

    def _table(self, values: Sequence[Any]) -> str:
        """Where numbers lie that an index chooses from: a constant, or the stack."""
        texts = [self.text(value) for value in values]
        size = len(values)
        if not any(isinstance(value, Expr) for value in values):
            table = f"@{self._name}.table{len(self._tables)}"
            entries = ", ".join(f"double {text}" for text in texts)
            self._tables.append(f"{table} = private constant [{size} x double] [{entries}]")
            return table
        table = f"%s{len(self.start)}"
        self.start.append(f"  {table} = alloca double, i64 {size}")
        for index, value in enumerate(values):
            self.store(value, self.place(table, index))
        return table

    def _operation(self, operation: Expr) -> str:
        code, args = OPERATIONS[operation.op].llvm, [self.text(a) for a in operation.args]
        if " " in code:
            numbers = "i1" if operation.op == "where" and is_condition(operation) else "double"
            return code.format(*args, T=numbers, B="i1", true="true")
        if code.startswith("llvm."):
            code += ".f64"
        if code != "uniform":
            types = ", ".join(["double"] * len(args))
            self._declared[code] = f"declare double @{code}({types}) {_PURE}"
        return f"call double @{code}({', '.join(f'double {a}' for a in args)})"


def _uses_noise(program: Program) -> bool:
    return any(operation.op == "uniform" for operation in operations_of(program.block))
