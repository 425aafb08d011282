"""Scalar functions over the samples of a flight, natively once that pays."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from math import nan
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.system.interrupts import reraise_swallowed_interrupts

if TYPE_CHECKING:
    from tiltsim.closed_loop.loop import ControlSetup
from functools import cache
from typing import Any

from numba import njit

from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.engines.numba_setup import _OPTIONS, _register_scalar_functions
from tiltsim_controllers.mathematics.records import record_dtype, record_size
from tiltsim_controllers.mathematics.scalar import Floats

MIN_ROWS_TO_COMPILE: Final = 20_000
"""Rows that one process evaluates in Python before it loads or compiles native code for them."""

_evaluated: dict[Callable[..., tuple[float, ...]], int] = {}


def evaluate_over_samples(
    function: Callable[..., tuple[float, ...]],
    width: int,
    time: Floats,
    states: Floats,
    setup: ControlSetup,
) -> Floats:
    """``function(time, state, parameters, knots)``, ``width`` values, for every row: (N, width).

    ``function`` is scalar code. Python and native code give the same floats; but where an operation
    on floats has no result, as beside a state of a lost flight, Python's whole row is NaN.
    """
    evaluated = _evaluated[function] = _evaluated.get(function, 0) + len(time)
    if evaluated >= MIN_ROWS_TO_COMPILE and len(time):
        pass

        with reraise_swallowed_interrupts():
            return evaluate_samples_natively(function, time, states, setup)
    parameters, knots = setup.parameters, setup.knots
    rows = np.full((len(time), width), nan)
    for row, t, state in zip(rows, time.tolist(), states.tolist()):
        with suppress(ArithmeticError, ValueError):
            row[:] = function(t, state, parameters, knots)
    return rows


@cache
def _compile_rows(function: Callable[..., tuple[float, ...]]) -> Any:
    _register_scalar_functions()

    @njit(nogil=True, **_OPTIONS)
    def rows(time, states, parameters, knots):  # type: ignore[no-untyped-def]
        width = len(function(time[0], states[0], parameters, knots))
        values = np.empty((len(time), width))
        for index in range(len(time)):
            row = function(time[index], states[index], parameters, knots)
            for column in range(width):
                values[index, column] = row[column]
        return values

    return rows


def evaluate_samples_natively(
    function: Callable[..., tuple[float, ...]], time: Floats, states: Floats, setup: ControlSetup
) -> Floats:
    """See `tiltsim.engines.rows.evaluate_over_samples`, which takes at least one row to here."""
    record: Any = type(setup.parameters)
    head = record_size(record)
    parameters = setup.userdata[:head].view(record_dtype(record))[0]
    time, states = np.ascontiguousarray(time), np.ascontiguousarray(states)
    knots = np.array(setup.knots)
    values: Floats = _compile_rows(function)(time, states, parameters, knots)
    return values
