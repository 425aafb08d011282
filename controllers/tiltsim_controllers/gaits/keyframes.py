"""Gaits through keyframes: periodic and linear in between.

The number of keyframes varies, so they are passed as ``knots`` beside the parameter record: rows of
``(phase, alpha_1, alpha_2, alpha_3, alpha_4)`` one after the other, with the phase (time over
period) from 0 in the first row to 1 in the last. Angles are in rad. A closed gait has the same
angles in both; two rows of equal phase make a jump.
"""

from __future__ import annotations

from math import floor
from typing import Final

from tiltsim_controllers.gaits.parameters import TiltsAndRates
from tiltsim_controllers.mathematics.scalar import Vector, scalar
from tiltsim_controllers.mathematics.splines import row_at

ROW: Final = 5
"""Floats per keyframe."""


@scalar
def keyframe_segment(
    time: float, period: float, rows: float, size: int, knots: Vector
) -> tuple[int, float, float]:
    """Where a gait is between two keyframes: the first one's index, the part passed, and 1/s.

    Args:
        time, period: s
        rows: number of keyframes
        size: floats per keyframe
        knots: the keyframes; further floats may follow
    """
    turns = time / period
    phase = turns - floor(turns)
    start = size * row_at(phase, int(rows) - 1, 0, size, knots)
    span = knots[start + size] - knots[start]
    return start, (phase - knots[start]) / span, 1.0 / (span * period)


@scalar
def keyframe_gait(time: float, period: float, rows: float, knots: Vector) -> TiltsAndRates:
    """Tilt angles (rad) and rates (rad/s) of a gait through keyframes of four tilts.

    Args:
        time, period, rows, knots: as for `keyframe_segment`
    """
    start, part, per_second = keyframe_segment(time, period, rows, ROW, knots)
    stop = start + ROW
    step_1 = knots[stop + 1] - knots[start + 1]
    step_2 = knots[stop + 2] - knots[start + 2]
    step_3 = knots[stop + 3] - knots[start + 3]
    step_4 = knots[stop + 4] - knots[start + 4]
    return (
        knots[start + 1] + part * step_1,
        knots[start + 2] + part * step_2,
        knots[start + 3] + part * step_3,
        knots[start + 4] + part * step_4,
        per_second * step_1,
        per_second * step_2,
        per_second * step_3,
        per_second * step_4,
    )
