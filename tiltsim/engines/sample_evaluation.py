"""Scalar functions over the samples of a flight, compiled once that pays off."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from itertools import pairwise
from math import nan
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.choices import Choices, choices_of
from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.engines.glue import ROWS, filled
from tiltsim.system.locks import one_thread_at_a_time
from tiltsim_controllers.mathematics.records import leaves, record_size, unflatten
from tiltsim_controllers.mathematics.scalar import Floats, Values

MIN_ROWS_TO_COMPILE: Final = 20_000
"""Rows that one process evaluates in Python before it loads or compiles native code for them."""

_evaluated: dict[Callable[..., Values], int] = {}


def flights_in(time: Floats) -> int:
    """How many flights, with the same times (s), follow one another in samples."""
    return max(1, int(np.count_nonzero(time == time[:1])))


def evaluate_over_samples(
    function: Callable[..., Values], width: int, time: Floats, states: Floats, setup: ControlSetup
) -> Floats:
    """Evaluate a scalar function for every sample.

    Args:
        function: Scalar function ``(time, state, parameters, knots) -> values``.
        width: How many values it returns.
        time: Times of the samples (N,), s.
        states: The fields of the samples that the function reads, shape (N, fields).
        setup: Parameters and knots; parameters may be arrays (N,), for samples of several flights.

    Returns:
        The values, shape (N, width), equal for Python and native code. Where an operation on floats
        has no result, as beside the state of a diverged flight, Python's whole row is NaN.
    """
    evaluated = _evaluated[function] = _evaluated.get(function, 0) + len(time)
    natively = evaluated >= MIN_ROWS_TO_COMPILE
    rows = np.full((len(time), width), nan)
    for part, own in _flights(setup, len(time)):
        if natively:
            rows[part] = _evaluate_natively(function, width, time[part], states[part], own)
            continue
        for row, t, state in zip(rows[part], time[part].tolist(), states[part].tolist()):
            with suppress(ArithmeticError, ValueError):
                row[:] = function(t, state, own.parameters, own.knots)
    return rows


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


def _evaluate_natively(
    function: Callable[..., Values], width: int, time: Floats, states: Floats, setup: ControlSetup
) -> Floats:
    """`evaluate_over_samples` for at least one row."""
    record: Any = type(setup.parameters)
    choices = choices_of(setup.parameters)
    rows = _compile_rows(function, record, choices, states.shape[1], width, len(setup.knots))
    values = np.empty((len(time), width))
    arrays = [np.ascontiguousarray(array) for array in (time, states, setup.userdata)]
    rows(len(time), *(array.ctypes.data for array in (*arrays, values)))
    return values


@one_thread_at_a_time
@cache
def _compile_rows(
    function: Callable[..., Values],
    record: type[tuple[Any, ...]],
    choices: Choices,
    state: int,
    width: int,
    knots: int,
) -> Any:
    from tiltsim.engines.machine_code import MachineCode
    from tiltsim.engines.programs import row_program
    from tiltsim_controllers.code.llvm_text import llvm_functions

    sizes = {"time": 1, "state": state, "user": record_size(record) + knots}
    text = llvm_functions({"row": row_program(function, record, choices, sizes)})
    code = MachineCode(text + filled(ROWS, state=state, width=width))
    return code.function("rows", None, ctypes.c_int64, *[ctypes.c_void_p] * 4)
