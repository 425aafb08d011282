"""Traced functions as machine code, compared with Python."""

from __future__ import annotations

import ctypes
from functools import lru_cache

import numpy as np

from tiltsim.closed_loop.assembly import CHOICES
from tiltsim.engines.machine_code import MachineCode
from tiltsim_controllers.code.arrays import as_tuples, program_of
from tiltsim_controllers.code.llvm_text import llvm_functions
from tiltsim_controllers.code.program import trace_vectors

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
        rows = np.array(rows, float)
        padded = np.append(rows, np.repeat(rows[-1:], -len(rows) % lanes, axis=0), axis=0)
        groups = np.ascontiguousarray(padded.reshape(-1, lanes, rows.shape[1]).transpose(0, 2, 1))
        found = np.empty((len(groups), len(program.block.results), lanes))
        for values, results in zip(groups, found, strict=True):
            run(values.ctypes.data, results.ctypes.data)
        return found.transpose(0, 2, 1).reshape(len(padded), -1)[: len(rows)].tolist()

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
    run = _compiled(function, _form(like))
    return lambda *arguments: run(_inputs(arguments))


@lru_cache(maxsize=64)
def _compiled(function, form):
    def traced(values):
        return numbers(as_tuples(function(*_restored(form, iter(values)))))

    return machine_code(program_of(traced, values=_size(form)))


def _form(entry, name=""):
    """The types and constants of an argument, hashable, with None for each input."""
    if isinstance(entry, tuple | list):
        return type(entry), tuple(map(_form, entry, getattr(entry, "_fields", [name] * len(entry))))
    return (type(entry), entry) if _is_constant(entry, name) else None


def _is_constant(entry, name):
    return name in CHOICES or isinstance(entry, bool | int)


def _restored(form, entries):
    if form is None:
        return next(entries)
    kind, inner = form
    if not isinstance(inner, tuple):
        return inner
    parts = [_restored(part, entries) for part in inner]
    return kind(*parts) if hasattr(kind, "_fields") else kind(parts)


def _size(form):
    if form is None:
        return 1
    return sum(map(_size, form[1])) if isinstance(form[1], tuple) else 0


def _inputs(entry, name=""):
    if isinstance(entry, tuple | list):
        names = getattr(entry, "_fields", [name] * len(entry))
        return [value for part, inner in zip(entry, names) for value in _inputs(part, inner)]
    return [] if _is_constant(entry, name) else [entry]


def compiled_law(inputs, size, law):
    """A control law ``inputs(time, state, law)`` on arrays as machine code, ``size`` states."""

    def traced(given):
        time, *state = (given[i] for i in range(1 + size))
        return inputs(time, np.array(state, dtype=object), law)

    run = machine_code(trace_vectors(traced, {"given": 1 + size}))
    return lambda time, state: run([time, *state])


def natively(function, *arguments):
    """The numbers that a function returns at arguments, as machine code computes them."""
    return compiled(function, *arguments)(*arguments)


def numbers(values):
    """The numbers of nested tuples, in order."""
    if isinstance(values, tuple | list):
        return [number for value in values for number in numbers(value)]
    return [values]
