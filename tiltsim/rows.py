"""Scalar functions over the samples of a flight, natively once that pays."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from math import nan
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.interrupts import interrupts_kept

if TYPE_CHECKING:
    from tiltsim.loop import ControlSetup, Floats

ROWS_WORTH_COMPILING: Final = 20_000
"""Rows that one process evaluates in Python before it loads or compiles native code for them."""

_evaluated: dict[Callable[..., tuple[float, ...]], int] = {}


def evaluate_rows(
    function: Callable[..., tuple[float, ...]],
    width: int,
    time: Floats,
    states: Floats,
    setup: ControlSetup,
) -> Floats:
    """``function(time, state, parameters, table)``, ``width`` values, for every row: (N, width).

    ``function`` is scalar code. Python and native code give the same floats; but where an operation
    on floats has no result, as beside a state of a lost flight, Python's whole row is NaN.
    """
    evaluated = _evaluated[function] = _evaluated.get(function, 0) + len(time)
    if evaluated >= ROWS_WORTH_COMPILING and len(time):
        from tiltsim.native import evaluate_natively

        with interrupts_kept():
            return evaluate_natively(function, time, states, setup)
    parameters, table = setup.parameters, setup.table
    rows = np.full((len(time), width), nan)
    for row, t, state in zip(rows, time.tolist(), states.tolist()):
        with suppress(ArithmeticError, ValueError):
            row[:] = function(t, state, parameters, table)
    return rows
