"""Traced functions as machine code, compared with Python."""

from __future__ import annotations

import ctypes

import numpy as np

from tiltsim.closed_loop.choices import CHOICES
from tiltsim.engines.machine_code import MachineCode
from tiltsim_controllers.code.llvm_text import llvm_functions
from tiltsim_controllers.code.traceable import as_tuples, program_of

RUN = """
define void @run(ptr %values, ptr %results) nounwind {
  call void @traced(ptr %values, ptr %results)
  ret void
}
"""


def machine_code_in_lanes(program, lanes, **options):
    """A program of one vector as a function of rows, each in a lane."""
    text, pointers = (
        llvm_functions({"traced": program}, lanes, **options) + RUN,
        [ctypes.c_void_p] * 2,
    )
    run = MachineCode(text).function("run", None, *pointers)

    def call(rows):
        results = []
        for first in range(0, len(rows), lanes):
            own = [rows[min(first + lane, len(rows) - 1)] for lane in range(lanes)]
            values = np.ascontiguousarray(np.transpose(np.array(own, float)))
            found = np.empty((len(program.block.results), lanes))
            run(values.ctypes.data, found.ctypes.data)
            results += np.transpose(found).tolist()[: len(rows) - first]
        return results

    return call


def machine_code(program):
    """A program of one vector as a function of sequences."""
    pointers = [ctypes.c_void_p] * 2
    run = MachineCode(llvm_functions({"traced": program}) + RUN).function("run", None, *pointers)

    def call(values):
        values, results = np.array(values, float), np.empty(len(program.block.results))
        run(values.ctypes.data, results.ctypes.data)
        return results.tolist()

    return call


def compiled(function, *like):
    """A function as machine code: of arguments as these, it returns a list of numbers.

    Choices are constants, as in flights; all other numbers are inputs.
    """

    def restored(entry, name, entries):
        if isinstance(entry, tuple | list):
            names = getattr(entry, "_fields", [name] * len(entry))
            parts = [restored(part, inner, entries) for part, inner in zip(entry, names)]
            return type(entry)(*parts) if hasattr(entry, "_fields") else type(entry)(parts)
        return entry if name in CHOICES or isinstance(entry, bool | int) else next(entries)

    def inputs(entry, name=""):
        if isinstance(entry, tuple | list):
            names = getattr(entry, "_fields", [name] * len(entry))
            return [value for part, inner in zip(entry, names) for value in inputs(part, inner)]
        return [] if name in CHOICES or isinstance(entry, bool | int) else [entry]

    def traced(values):
        entries = iter(values)
        return numbers(as_tuples(function(*(restored(entry, "", entries) for entry in like))))

    size = sum(len(inputs(entry)) for entry in like)
    run = machine_code(program_of(traced, values=size))
    return lambda *arguments: run([value for entry in arguments for value in inputs(entry)])


def natively(function, *arguments):
    """The numbers that a function returns at arguments, as machine code computes them."""
    return compiled(function, *arguments)(*arguments)


def numbers(values):
    """The numbers of nested tuples, in order."""
    if isinstance(values, tuple | list):
        return [number for value in values for number in numbers(value)]
    return [values]
