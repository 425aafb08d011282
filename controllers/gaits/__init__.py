"""Gaits: the tilt angles as functions of time alone, planned before the flight (ch. 3 to 9)."""

from __future__ import annotations

from typing import Final, NamedTuple

from controllers.gaits.trot import TiltsAndRates, continuous_trot, instant_trot
from controllers.scalar import scalar

FIXED: Final = 0
TROT_INSTANT: Final = 1
TROT_CONTINUOUS: Final = 2

GAIT_TYPES: Final = {
    "fixed": FIXED,
    "trot_instant": TROT_INSTANT,
    "trot_continuous": TROT_CONTINUOUS,
}
"""Gait types by the name a scenario gives them."""


class GaitParameters(NamedTuple):
    """What a gait is made of; each type reads the fields it knows."""

    type: float
    angle_1: float = 0.0  # rad, fixed
    angle_2: float = 0.0
    angle_3: float = 0.0
    angle_4: float = 0.0
    amplitude: float = 0.0  # rad, trots
    period: float = 1.0  # s, trots


@scalar
def tilt_reference(time: float, gait: GaitParameters) -> TiltsAndRates:
    """The planned tilt angles (rad) and their rates (rad/s) at a time (s).

    Returns ``(alpha_1, ..., alpha_4, rate_1, ..., rate_4)``.
    """
    if gait.type == TROT_CONTINUOUS:
        return continuous_trot(time, gait.amplitude, gait.period)
    if gait.type == TROT_INSTANT:
        return instant_trot(time, gait.amplitude, gait.period)
    return gait.angle_1, gait.angle_2, gait.angle_3, gait.angle_4, 0.0, 0.0, 0.0, 0.0
