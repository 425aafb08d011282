"""Planned gaits with their corners rounded, for what cannot turn about at once."""

from __future__ import annotations

from collections.abc import Sequence

from tiltsim_controllers.gaits import (
    FIXED,
    TWO_COLOR_CIRCLE,
    GaitParameters,
    tilt_acceleration,
    tilt_reference,
)
from tiltsim_controllers.mathematics.jets import Jet
from tiltsim_controllers.mathematics.scalar import clipped, scalar


@scalar
def rounded_ramp(x: float, half: float) -> Jet:
    """The ramp ``max(x, 0)``, smooth within ``half`` of its corner.

    Its second derivative is the kernel ``15/16 (1 - (x/half)^2)^2 / half`` of area one.
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
    """A motion along two straight lines, its corner rounded, in the middle of a window.

    The window lasts ``2 half`` seconds and holds one corner at most; ``start`` and ``stop`` are the
    values at its ends. The lines tell where the corner is.
    """
    middle = start + half * start_rate
    bend = stop_rate - start_rate
    if bend == 0.0:
        return middle, start_rate, 0.0
    since = (stop - middle - half * start_rate) / bend - half
    value, first, second = rounded_ramp(clipped(since, -half, half), half)
    return middle + bend * value, start_rate + bend * first, bend * second


@scalar
def anticipated_tilts(
    time: float, gait: GaitParameters, table: Sequence[float], half: float
) -> tuple[Jet, Jet, Jet, Jet]:
    """The planned tilt angles, for the attitude: their corners rounded, ``half`` seconds each way.

    A gait of straight lines turns about at once, the body cannot. But the corner is known before
    it comes, so the body starts ``half`` before and ends ``half`` after it; what it misses before
    makes up for what it misses after, but for second order. Smooth gaits stay as they are, and so
    do jumps, which have no rates.
    """
    if half <= 0.0 or gait.type == FIXED or gait.type == TWO_COLOR_CIRCLE:
        a1, a2, a3, a4, v1, v2, v3, v4 = tilt_reference(time, gait, table)
        b1, b2, b3, b4 = tilt_acceleration(time, gait)
        return (a1, v1, b1), (a2, v2, b2), (a3, v3, b3), (a4, v4, b4)
    a1, a2, a3, a4, v1, v2, v3, v4 = tilt_reference(time - half, gait, table)
    b1, b2, b3, b4, w1, w2, w3, w4 = tilt_reference(time + half, gait, table)
    return (
        rounded_corner(a1, v1, b1, w1, half),
        rounded_corner(a2, v2, b2, w2, half),
        rounded_corner(a3, v3, b3, w3, half),
        rounded_corner(a4, v4, b4, w4, half),
    )
