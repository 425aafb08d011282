"""Planned gaits with rounded corners, for the attitude, which cannot change its rate at once."""

from __future__ import annotations

from tiltsim_controllers.gaits.parameters import FIXED, TABLE, TWO_COLOR_CIRCLE, GaitParameters
from tiltsim_controllers.gaits.tilts import moving_tilts, planned_jets
from tiltsim_controllers.mathematics.jets import Jet, Jets4
from tiltsim_controllers.mathematics.scalar import Vector, clipped, scalar


@scalar
def rounded_ramp(x: float, half: float) -> Jet:
    """The ramp ``max(x, 0)``, smooth within ``half`` of its corner.

    The second derivative is the kernel ``15/16 (1 - (x/half)^2)^2 / half`` of area one.
    """
    if x <= -half:
        return 0.0, 0.0, 0.0
    if x >= half:
        return x, 1.0, 0.0
    u = x / half
    second = u * u
    fourth = second * second
    left = 1.0 - second
    return (
        half * (0.5 * u + (15.0 * second - 5.0 * fourth + second * fourth + 5.0) / 32.0),
        0.5 + u * (15.0 - 10.0 * second + 3.0 * fourth) / 16.0,
        0.9375 * (left * left) / half,
    )


@scalar
def rounded_corner(
    start: float, start_rate: float, stop: float, stop_rate: float, half: float
) -> Jet:
    """Motion along two straight lines with a rounded corner, in the middle of a time window.

    The window contains at most one corner, where the lines meet.

    Args:
        start, stop: values at the ends of the window
        start_rate, stop_rate: rates at its ends, 1/s
        half: half the length of the window, s
    """
    middle = start + half * start_rate
    bend = stop_rate - start_rate
    if bend == 0.0:
        return middle, start_rate, 0.0
    since = (stop - middle - half * start_rate) / bend - half
    value, first, second = rounded_ramp(clipped(since, -half, half), half)
    return middle + bend * value, start_rate + bend * first, bend * second


@scalar
def anticipated_tilts(time: float, gait: GaitParameters, knots: Vector, half: float) -> Jets4:
    """The planned tilt angles with rounded corners, for the attitude.

    The rates of a piecewise linear gait jump at its corners, which the body cannot follow. The
    corner is known in advance, so the body starts to turn ``half`` before and ends ``half`` after
    it; the errors before and after cancel to first order. Smooth gaits and jumps, which have no
    rates, are unchanged.

    Args:
        time: s
        gait, knots: as for `tilt_reference`
        half: time before and after a corner, s

    Returns:
        Four jets, rad and s.
    """
    smooth = gait.type == FIXED or gait.type == TWO_COLOR_CIRCLE or gait.type == TABLE
    if half <= 0.0 or smooth:
        return planned_jets(time, gait, knots)
    (a1, a2, a3, a4), (v1, v2, v3, v4) = moving_tilts(time - half, gait, knots)
    (b1, b2, b3, b4), (w1, w2, w3, w4) = moving_tilts(time + half, gait, knots)
    return (
        rounded_corner(a1, v1, b1, w1, half),
        rounded_corner(a2, v2, b2, w2, half),
        rounded_corner(a3, v3, b3, w3, half),
        rounded_corner(a4, v4, b4, w4, half),
    )
