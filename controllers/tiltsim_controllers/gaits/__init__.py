"""Gaits: the tilt angles as functions of time alone, planned before the flight (ch. 3 to 9).

`tilt_reference` is what a flight evaluates. `tiltsim_controllers.gaits.plans` builds its parameters
from what a scenario or a chapter states, and knows period, amplitude, rate and continuity.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.keyframes import NO_KNOTS, keyframe_gait
from tiltsim_controllers.gaits.penguin import penguin_swing, rotating
from tiltsim_controllers.gaits.trot import TiltsAndRates, continuous_trot, instant_trot
from tiltsim_controllers.gaits.two_color import RED, two_color_circle
from tiltsim_controllers.mathematics.scalar import Quad, scalar

FIXED: Final = 0.0
TROT_INSTANT: Final = 1.0
TROT_CONTINUOUS: Final = 2.0
KEYFRAMES: Final = 3.0
TWO_COLOR_CIRCLE: Final = 4.0
PENGUIN: Final = 5.0
ROTATING: Final = 6.0

GAIT_TYPES: Final = {
    "fixed": FIXED,
    "trot_instant": TROT_INSTANT,
    "trot_continuous": TROT_CONTINUOUS,
    "walk": KEYFRAMES,
    "run": KEYFRAMES,
    "transverse_gallop": KEYFRAMES,
    "rotary_gallop": KEYFRAMES,
    "two_color": KEYFRAMES,  # a circular path is a TWO_COLOR_CIRCLE
    "waypoints": KEYFRAMES,
    "penguin_small": PENGUIN,
    "penguin_large": PENGUIN,
    "rotating": ROTATING,
}
"""How a gait is evaluated, by the name a scenario gives it."""


class GaitParameters(NamedTuple):
    """What a gait is made of; each type reads the fields it knows."""

    type: float
    angle_1: float = 0.0  # rad, fixed; the tilt-car's gaits move the first angle alone
    angle_2: float = 0.0
    angle_3: float = 0.0
    angle_4: float = 0.0
    amplitude: float = 0.0  # rad, trots and penguins
    period: float = 1.0  # s, all but fixed
    scale: float = 1.0  # all four angles are multiplied by it (ch. 5, Eq. 16: 1/n)
    bias: float = 1.0  # [eta] alpha_3 and alpha_4 are multiplied by it (ch. 6, Eqs. 12-15)
    keyframes: float = 0.0  # number of rows of the table, keyframes
    centre_1: float = 0.0  # rad, circle in the alpha_1-alpha_2 plane
    centre_2: float = 0.0
    radius: float = 0.0
    color: float = 0.0
    drag_ratio: float = 0.0  # [r] sets the offset of the blue lines
    rate: float = 0.0  # rad/s, rotating


@scalar
def planned_angles(time: float, gait: GaitParameters, table: Sequence[float]) -> TiltsAndRates:
    """The gait before scale and bias: ``(alpha_1, ..., alpha_4, rate_1, ..., rate_4)``."""
    if gait.type == FIXED:
        return gait.angle_1, gait.angle_2, gait.angle_3, gait.angle_4, 0.0, 0.0, 0.0, 0.0
    if gait.type == KEYFRAMES:
        return keyframe_gait(time, gait.period, gait.keyframes, table)
    if gait.type == TWO_COLOR_CIRCLE:
        return two_color_circle(
            time,
            gait.period,
            gait.centre_1,
            gait.centre_2,
            gait.radius,
            gait.color,
            gait.drag_ratio,
        )
    if gait.type == PENGUIN:
        return penguin_swing(time, gait.amplitude, gait.period)
    if gait.type == ROTATING:
        return rotating(time, gait.angle_1, gait.rate)
    if gait.type == TROT_CONTINUOUS:
        return continuous_trot(time, gait.amplitude, gait.period)
    return instant_trot(time, gait.amplitude, gait.period)


@scalar
def tilt_reference(
    time: float, gait: GaitParameters, table: Sequence[float] = NO_KNOTS
) -> TiltsAndRates:
    """The planned tilt angles (rad) and their rates (rad/s) at a time (s).

    ``table`` holds the keyframes of gaits that have them (`tiltsim_controllers.gaits.keyframes`): a
    flat tuple of floats in Python, a one-dimensional array in native code; other gaits leave it
    unread. Returns ``(alpha_1, ..., alpha_4, rate_1, ..., rate_4)``. At a jump and at a corner what
    comes after holds; but the first half of a trot's period includes its end, as ch. 4 prints it.
    """
    a1, a2, a3, a4, rate_1, rate_2, rate_3, rate_4 = planned_angles(time, gait, table)
    front = gait.scale
    back = gait.scale * gait.bias
    return (
        front * a1,
        front * a2,
        back * a3,
        back * a4,
        front * rate_1,
        front * rate_2,
        back * rate_3,
        back * rate_4,
    )


@scalar
def tilt_acceleration(time: float, gait: GaitParameters) -> Quad:
    """The second derivatives (rad/s^2) of the planned tilt angles at a time (s).

    Zero for constant gaits and for those made of straight lines, whose rates jump at the corners.
    """
    if gait.type != TWO_COLOR_CIRCLE:
        return 0.0, 0.0, 0.0, 0.0
    turning = 2.0 * pi / gait.period
    inward = -gait.scale * gait.radius * turning * turning
    front_1, front_2 = inward * cos(turning * time), inward * sin(turning * time)
    slope = gait.bias if gait.color == RED else -gait.bias
    return front_1, front_2, slope * front_1, slope * front_2
