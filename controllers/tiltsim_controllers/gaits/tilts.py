"""The planned tilt angles of every gait, with rates and accelerations, at a time."""

from __future__ import annotations

from math import cos, pi, sin

from tiltsim_controllers.gaits.keyframes import keyframe_gait
from tiltsim_controllers.gaits.parameters import (
    FIXED,
    KEYFRAMES,
    NO_KNOTS,
    PENGUIN,
    ROTATING,
    TABLE,
    TROT_CONTINUOUS,
    TWO_COLOR_CIRCLE,
    GaitParameters,
    TiltsAndRates,
)
from tiltsim_controllers.gaits.penguin import penguin_swing, rotating
from tiltsim_controllers.gaits.tabulated import table_gait
from tiltsim_controllers.gaits.trot import continuous_trot, instant_trot
from tiltsim_controllers.gaits.two_color import RED, two_color_circle
from tiltsim_controllers.mathematics.jets import Jets4
from tiltsim_controllers.mathematics.scalar import Quad, Vector, scalar


@scalar
def planned_angles(time: float, gait: GaitParameters, knots: Vector) -> TiltsAndRates:
    """The gait before scale and bias; arguments and result as for `tilt_reference`."""
    if gait.type == FIXED:
        return gait.angle_1, gait.angle_2, gait.angle_3, gait.angle_4, 0.0, 0.0, 0.0, 0.0
    if gait.type == KEYFRAMES:
        return keyframe_gait(time, gait.period, gait.keyframes, knots)
    if gait.type == TWO_COLOR_CIRCLE:
        return two_color_circle(time, gait)
    if gait.type == PENGUIN:
        return penguin_swing(time, gait.amplitude, gait.period)
    if gait.type == ROTATING:
        return rotating(time, gait.angle_1, gait.rate)
    if gait.type == TABLE:
        (a1, v1, _), (a2, v2, _), (a3, v3, _), (a4, v4, _) = table_gait(time, gait, knots)
        return a1, a2, a3, a4, v1, v2, v3, v4
    if gait.type == TROT_CONTINUOUS:
        return continuous_trot(time, gait.amplitude, gait.period)
    return instant_trot(time, gait.amplitude, gait.period)


@scalar
def moving_tilts(time: float, gait: GaitParameters, knots: Vector) -> tuple[Quad, Quad]:
    """The planned tilt angles (rad), and their rates (rad/s); arguments as for `tilt_reference`."""
    a1, a2, a3, a4, v1, v2, v3, v4 = planned_angles(time, gait, knots)
    f, b = gait.scale, gait.scale * gait.bias  # of the front and back pods
    return (f * a1, f * a2, b * a3, b * a4), (f * v1, f * v2, b * v3, b * v4)


@scalar
def tilt_reference(time: float, gait: GaitParameters, knots: Vector = NO_KNOTS) -> TiltsAndRates:
    """The planned tilt angles (rad) and their rates (rad/s).

    At a jump and at a corner the values after it hold, except that the first half of a trot's
    period includes its end, as printed in ch. 4.

    Args:
        time: s
        gait: type and parameters
        knots: The keyframes or the spline of gaits that have them
            (`tiltsim_controllers.gaits.keyframes` and ``tabulated``): a flat tuple of floats in
            Python, a one-dimensional array in native code. Other gaits do not read it.

    Returns:
        ``(alpha_1, ..., alpha_4, rate_1, ..., rate_4)``.
    """
    (a1, a2, a3, a4), (v1, v2, v3, v4) = moving_tilts(time, gait, knots)
    return a1, a2, a3, a4, v1, v2, v3, v4


@scalar
def tilt_acceleration(time: float, gait: GaitParameters, knots: Vector = NO_KNOTS) -> Quad:
    """The second derivatives (rad/s^2) of the planned tilt angles; arguments as `tilt_reference`.

    Zero for constant and piecewise linear gaits, whose rates jump at the corners.
    """
    if gait.type == TABLE:
        (_, _, b1), (_, _, b2), (_, _, b3), (_, _, b4) = table_gait(time, gait, knots)
        f, b = gait.scale, gait.scale * gait.bias
        return f * b1, f * b2, b * b3, b * b4
    if gait.type != TWO_COLOR_CIRCLE:
        return 0.0, 0.0, 0.0, 0.0
    turning = 2.0 * pi / gait.period
    inward = -gait.scale * gait.radius * turning * turning
    front_1, front_2 = inward * cos(turning * time), inward * sin(turning * time)
    slope = gait.bias if gait.color == RED else -gait.bias
    return front_1, front_2, slope * front_1, slope * front_2


@scalar
def planned_jets(time: float, gait: GaitParameters, knots: Vector) -> Jets4:
    """The planned tilt angles with rates and accelerations; arguments as for `tilt_reference`."""
    (a1, a2, a3, a4), (v1, v2, v3, v4) = moving_tilts(time, gait, knots)
    b1, b2, b3, b4 = tilt_acceleration(time, gait, knots)
    return (a1, v1, b1), (a2, v2, b2), (a3, v3, b3), (a4, v4, b4)
