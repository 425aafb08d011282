"""Traced functions as machine code, beside the same in Python."""

from __future__ import annotations

import ctypes

import numpy as np

from tiltsim.arrays.traced_numbers import trace_scalar_code
from tiltsim.closed_loop.choices import CHOICES
from tiltsim.engines.machine_code import MachineCode
from tiltsim_controllers.code.llvm_text import llvm_functions

RUN = """
define void @run(ptr %values, ptr %results) nounwind {
  call void @traced(ptr %values, ptr %results)
  ret void
}
"""


def machine_code(program):
    """A program of one vector as a function of sequences."""
    pointers = [ctypes.c_void_p] * 2
    run = MachineCode(llvm_functions({"traced": program}) + RUN).function("run", None, *pointers)

    def call(values):
        values, results = np.array(values, float), np.empty(len(program.block.results))
        run(values.ctypes.data, results.ctypes.data)
        return results.tolist()

    return call


def natively(function, *arguments):
    """The numbers that a scalar function returns at arguments, as machine code computes them.

    Choices are constants, as in flights; all other numbers are inputs.
    """
    values = []

    def collect(value, name=""):
        if isinstance(value, tuple | list):
            names = getattr(value, "_fields", [name] * len(value))
            return [collect(entry, inner) for entry, inner in zip(value, names)]
        if name in CHOICES or isinstance(value, bool | int):
            return value
        values.append(value)
        return len(values) - 1, "input"

    def restored(place, like, vector):
        if not isinstance(like, tuple | list):
            return vector[place[0]] if isinstance(place, tuple) else place
        entries = [restored(one, inner, vector) for one, inner in zip(place, like)]
        return type(like)(*entries) if hasattr(like, "_fields") else type(like)(entries)

    places = [collect(argument) for argument in arguments]

    def traced(lifting, given):
        (vector,) = given
        return numbers(
            lifting(function)(*(restored(p, a, vector) for p, a in zip(places, arguments)))
        )

    return machine_code(trace_scalar_code(traced, values=len(values)))(values)


def numbers(values):
    """The numbers of nested tuples, in order."""
    if isinstance(values, tuple | list):
        return [number for value in values for number in numbers(value)]
    return [values]
