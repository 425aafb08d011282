"""Gaits through the rows of a table: cubic splines, once or over and over."""

from __future__ import annotations

from math import floor
from typing import Final

from tiltsim_controllers.gaits.parameters import GaitParameters
from tiltsim_controllers.mathematics.jets import Jet, Jets4
from tiltsim_controllers.mathematics.scalar import Vector, scalar
from tiltsim_controllers.mathematics.splines import polynomial_motion, row_at

COEFFICIENTS: Final = 4
"""Of a cubic polynomial, highest power first."""

ROW: Final = 1 + 4 * COEFFICIENTS
"""Floats per segment: the time at which it begins, and one polynomial per tilt angle."""


@scalar
def segment_jet(since: float, start: int, knots: Vector) -> Jet:
    """A tilt angle with rate and acceleration, ``since`` seconds into its polynomial's segment."""
    value, rate, acceleration, _, _ = polynomial_motion(since, start, COEFFICIENTS, knots)
    return value, rate, acceleration


@scalar
def table_gait(time: float, gait: GaitParameters, knots: Vector) -> Jets4:
    """The tilt angles of a table with rates and accelerations, without scale and bias.

    Args:
        time: s; before the first row that holds, and after the last one if the gait does not repeat
        gait: a table
        knots: the segments; further floats may follow
    """
    if gait.repeats != 0.0:
        time -= floor(time / gait.period) * gait.period
    row = ROW * row_at(time, int(gait.keyframes), 0, ROW, knots)
    since = max(0.0, time - knots[row])
    return (
        segment_jet(since, row + 1, knots),
        segment_jet(since, row + 1 + COEFFICIENTS, knots),
        segment_jet(since, row + 1 + 2 * COEFFICIENTS, knots),
        segment_jet(since, row + 1 + 3 * COEFFICIENTS, knots),
    )
