"""Functions over the samples of a flight, compiled once that pays off."""

import ctypes
from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import pairwise
from typing import Any, Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from tiltsim.closed_loop.assembly import Assembly, Choices, ProgramKey, choices_of, program_key
from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.engines.glue import ROWS, filled
from tiltsim.engines.machine_code import MachineCode
from tiltsim.engines.programs import KEPT, LoopPrograms, record_with_choices
from tiltsim.system.files import one_thread_at_a_time
from tiltsim_controllers.code.arrays import program_of
from tiltsim_controllers.code.llvm_text import llvm_functions
from tiltsim_controllers.code.program import InputVector, Program
from tiltsim_controllers.code.python_source import python_function
from tiltsim_controllers.mathematics.records import leaves, record_size, unflatten
from tiltsim_controllers.mathematics.scalar import Floats, Values

MIN_ROWS_TO_COMPILE: Final = 5_000
"""Rows that one process evaluates in Python, in some 3 us each, before it loads or compiles native
code for them, which takes 2 or 17 ms."""

_evaluated: Final[WeakKeyDictionary[Callable[..., Values], int]] = WeakKeyDictionary()


def flights_in(time: Floats) -> int:
    """Number of flights, with equal times (s), that follow one another in samples."""
    return max(1, int(np.count_nonzero(time == time[:1])))


def evaluate_over_samples(
    function: Callable[..., Values], width: int, time: Floats, states: Floats, setup: ControlSetup
) -> Floats:
    """Evaluate a function for every sample.

    Args:
        function: Function ``(time, state, parameters, knots) -> values``.
        width: Number of values that it returns.
        time: Times of the samples (N,), s.
        states: The fields of the samples that the function reads, shape (N, fields).
        setup: Parameters and knots; parameters may be arrays (N,), for samples of several flights.

    Returns:
        The values, shape (N, width), equal for Python and machine code.
    """
    evaluated = _evaluated[function] = _evaluated.get(function, 0) + len(time)
    evaluate = _natively if evaluated >= MIN_ROWS_TO_COMPILE else _in_python
    rows = np.empty((len(time), width))
    for part, own in _flights(setup, len(time)):
        record: Any = type(own.parameters)
        sizes = states.shape[1], record_size(record) + len(own.knots)
        row = Row(function, record, choices_of(own.parameters), *sizes)
        rows[part] = evaluate(row, width, time[part], states[part], own.userdata)
    return rows


def termination_checks(assembly: Assembly) -> Callable[[float, Values], Values]:
    """A function of a time (s) and the other fields of a sample, traced once for equal loops.

    Returns:
        The code of the limit that the sample exceeds, and the numbers whose signs are checked.
    """
    head = (float(assembly.follows_position), *leaves(assembly.reference))
    fixed = {"head": head, "user": assembly.setup.userdata.tolist()}
    checks = python_function(_checks_program(program_key(assembly)), "checks", fixed=fixed)
    return lambda time, values: checks((time,), values)


@one_thread_at_a_time
@lru_cache(maxsize=KEPT)
def _checks_program(key: ProgramKey) -> Program:
    return LoopPrograms(key).checks()


class Row(NamedTuple):
    """A function ``(time, state, parameters, knots) -> values`` and its tracing arguments."""

    function: Callable[..., Values]
    record: type[tuple[Any, ...]]  # type of the parameters
    choices: Choices  # parameters that are constants
    state: int  # number of states
    user: int  # number of parameters and knots


def _flights(setup: ControlSetup, samples: int) -> Iterator[tuple[slice, ControlSetup]]:
    """Runs of samples with equal parameters, and these as floats."""
    values = [*leaves(setup.parameters)]
    if not any(isinstance(value, np.ndarray) for value in values):
        if samples:
            yield slice(samples), setup
        return
    table = np.stack([np.broadcast_to(value, samples) for value in values], axis=-1).astype(float)
    bits = table.view(np.int64)  # as NaN differs from itself
    starts = 1 + np.flatnonzero((bits[1:] != bits[:-1]).any(axis=-1))
    for first, end in pairwise([0, *starts.tolist(), samples]):
        parameters = unflatten(type(setup.parameters), table[first].tolist())
        yield slice(first, end), ControlSetup(parameters, setup.knots)


@one_thread_at_a_time
@lru_cache(maxsize=KEPT)
def _program(row: Row) -> Program:
    def traced(time: Any, state: Any, user: InputVector) -> Any:
        parameters = record_with_choices(row.record, user, row.choices)
        return row.function(time[0], state, parameters, user[record_size(row.record) :])

    return program_of(traced, time=1, state=row.state, user=row.user)


def _in_python(row: Row, _width: int, time: Floats, states: Floats, user: Floats) -> Floats:
    function = python_function(_program(row), "row", fixed={"user": user.tolist()})
    rows = [function((t,), state) for t, state in zip(time.tolist(), states.tolist())]
    return np.array(rows)


def _natively(row: Row, width: int, time: Floats, states: Floats, user: Floats) -> Floats:
    values = np.empty((len(time), width))
    arrays = [np.ascontiguousarray(array) for array in (time, states, user)]
    _compiled(row, width)(len(time), *(array.ctypes.data for array in (*arrays, values)))
    return values


@one_thread_at_a_time
@lru_cache(maxsize=KEPT)
def _compiled(row: Row, width: int) -> Any:
    glue = filled(ROWS, state=row.state, width=width)
    code = MachineCode(llvm_functions({"row": _program(row)}) + glue)
    return code.function("rows", None, ctypes.c_int64, *[ctypes.c_void_p] * 4)
