"""Gaits through keyframes: periodic and linear in between.

Keyframes are as many as a gait needs, so they travel in a table beside the parameter record: rows
of ``(phase, alpha_1, alpha_2, alpha_3, alpha_4)`` one after the other, with the phase (time over
period) running from 0 in the first row to 1 in the last. Angles are in rad. A gait that closes has
the same angles in both; two rows of equal phase make a jump.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import floor
from typing import Final

from tiltsim_controllers.gaits.trot import TiltsAndRates
from tiltsim_controllers.mathematics.scalar import scalar

ROW: Final = 5
"""Floats in a row of the table."""

NO_KNOTS: Final = (0.0, 0.0)
"""The table of gaits without keyframes; not empty, so that native code can give it a type."""


@scalar
def keyframe_row(phase: float, rows: int, table: Sequence[float]) -> int:
    """Index of the last of the ``rows - 1`` segments that starts at or before ``phase``."""
    low, high = 0, rows - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table[ROW * middle] <= phase:
            low = middle
        else:
            high = middle
    return low


@scalar
def keyframe_gait(time: float, period: float, rows: float, table: Sequence[float]) -> TiltsAndRates:
    """Tilt angles (rad) and rates (rad/s) of a keyframe table at a time (s).

    ``rows`` is the number of rows in use; the table may be longer.
    """
    turns = time / period
    phase = turns - floor(turns)
    start = ROW * keyframe_row(phase, int(rows), table)
    stop = start + ROW
    span = table[stop] - table[start]
    part = (phase - table[start]) / span
    per_second = 1.0 / (span * period)
    step_1 = table[stop + 1] - table[start + 1]
    step_2 = table[stop + 2] - table[start + 2]
    step_3 = table[stop + 3] - table[start + 3]
    step_4 = table[stop + 4] - table[start + 4]
    return (
        table[start + 1] + part * step_1,
        table[start + 2] + part * step_2,
        table[start + 3] + part * step_3,
        table[start + 4] + part * step_4,
        per_second * step_1,
        per_second * step_2,
        per_second * step_3,
        per_second * step_4,
    )
