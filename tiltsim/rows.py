"""Scalar functions over the samples of a flight, natively once that pays."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.interrupts import interrupts_kept

if TYPE_CHECKING:
    from tiltsim.loop import ControlSetup, Floats

ROWS_WORTH_COMPILING: Final = 20_000
"""Rows that one process evaluates in Python before it loads or compiles native code for them."""

_evaluated: dict[Callable[..., tuple[float, ...]], int] = {}


def evaluate_rows(
    function: Callable[..., tuple[float, ...]], time: Floats, states: Floats, setup: ControlSetup
) -> Floats:
    """``function(time, state, parameters, table)`` for every row, shape (N, number of values).

    ``function`` is scalar code. Python and native code give the same floats.
    """
    evaluated = _evaluated[function] = _evaluated.get(function, 0) + len(time)
    if evaluated >= ROWS_WORTH_COMPILING:
        from tiltsim.native import evaluate_natively

        with interrupts_kept():
            return evaluate_natively(function, time, states, setup)
    parameters, table = setup.parameters, setup.table
    rows = [function(t, s, parameters, table) for t, s in zip(time.tolist(), states.tolist())]
    return np.array(rows)
