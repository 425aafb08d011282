"""Scalar functions over the samples of a flight, compiled once that pays off."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from math import nan
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.system.interrupts import reraise_swallowed_interrupts
from tiltsim.system.locks import one_thread_at_a_time
from tiltsim_controllers.mathematics.records import record_dtype, record_size
from tiltsim_controllers.mathematics.scalar import Floats, Values

MIN_ROWS_TO_COMPILE: Final = 20_000
"""Rows that one process evaluates in Python before it loads or compiles native code for them."""

_evaluated: dict[Callable[..., Values], int] = {}


def evaluate_over_samples(
    function: Callable[..., Values], width: int, time: Floats, states: Floats, setup: ControlSetup
) -> Floats:
    """Evaluate a scalar function for every sample.

    Args:
        function: Scalar function ``(time, state, parameters, knots) -> values``.
        width: How many values it returns.
        time: Times of the samples (N,), s.
        states: The fields of the samples that the function reads, shape (N, fields).
        setup: Parameters and knots.

    Returns:
        The values, shape (N, width), equal for Python and native code. Where an operation on floats
        has no result, as beside the state of a diverged flight, Python's whole row is NaN.
    """
    evaluated = _evaluated[function] = _evaluated.get(function, 0) + len(time)
    if evaluated >= MIN_ROWS_TO_COMPILE and len(time):
        with reraise_swallowed_interrupts():
            return _evaluate_natively(function, time, states, setup)
    parameters, knots = setup.parameters, setup.knots
    rows = np.full((len(time), width), nan)
    for row, t, state in zip(rows, time.tolist(), states.tolist()):
        with suppress(ArithmeticError, ValueError):
            row[:] = function(t, state, parameters, knots)
    return rows


def _evaluate_natively(
    function: Callable[..., Values], time: Floats, states: Floats, setup: ControlSetup
) -> Floats:
    """`evaluate_over_samples` for at least one row."""
    record: Any = type(setup.parameters)
    parameters = setup.userdata[: record_size(record)].view(record_dtype(record))[0]
    time, states = np.ascontiguousarray(time), np.ascontiguousarray(states)
    values: Floats = _compile_rows(function)(time, states, parameters, np.array(setup.knots))
    return values


@one_thread_at_a_time
@cache
def _compile_rows(function: Callable[..., Values]) -> Any:
    from tiltsim.engines.compiling import compiled, register_scalar_functions

    register_scalar_functions()

    @compiled
    def rows(time, states, parameters, knots):  # type: ignore[no-untyped-def]
        width = len(function(time[0], states[0], parameters, knots))
        values = np.empty((len(time), width))
        for index in range(len(time)):
            row = function(time[index], states[index], parameters, knots)
            for column in range(width):
                values[index, column] = row[column]
        return values

    return rows
