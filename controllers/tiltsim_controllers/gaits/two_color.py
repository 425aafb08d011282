"""Gaits on the two colours of the Two Color Map (ch. 6 to 8, 12).

A colour determines ``alpha_3`` and ``alpha_4`` from ``alpha_1`` and ``alpha_2``. With ``delta =
atan(r)`` both colours are exact lines for any vehicle: red ``alpha_3 = alpha_1, alpha_4 =
alpha_2``, blue ``alpha_3 = 2 delta - alpha_1, alpha_4 = -2 delta - alpha_2``. Paths made of
straight lines become keyframes; the circle of ch. 8 is evaluated here.
"""

from __future__ import annotations

from math import atan, cos, pi, sin
from typing import Final

from tiltsim_controllers.gaits.parameters import GaitParameters, TiltsAndRates
from tiltsim_controllers.mathematics.scalar import scalar

RED: Final = 0.0
BLUE: Final = 1.0

COLORS: Final = {"red": RED, "blue": BLUE}
"""Colours by their name in a scenario."""


@scalar
def colored_angles(
    alpha_1: float, alpha_2: float, color: float, drag_ratio: float
) -> tuple[float, float]:
    """``(alpha_3, alpha_4)`` (rad) of a colour (ch. 8, Eqs. 11-12, with the exact offset).

    Args:
        alpha_1, alpha_2: rad
        color: `RED` or `BLUE`
        drag_ratio: ``r = K_m / (L K_f)``
    """
    if color == RED:
        return alpha_1, alpha_2
    offset = 2.0 * atan(drag_ratio)
    return offset - alpha_1, -offset - alpha_2


@scalar
def two_color_circle(time: float, gait: GaitParameters) -> TiltsAndRates:
    """A circle in the alpha_1-alpha_2 plane, without scale and bias (ch. 8, Sec. 4).

    Starts at ``(centre_1 + radius, centre_2)`` and turns counter-clockwise once per period.
    """
    turning = 2.0 * pi / gait.period
    along, across = gait.radius * cos(turning * time), gait.radius * sin(turning * time)
    alpha_1, alpha_2 = gait.centre_1 + along, gait.centre_2 + across
    rate_1, rate_2 = -turning * across, turning * along
    alpha_3, alpha_4 = colored_angles(alpha_1, alpha_2, gait.color, gait.drag_ratio)
    slope = 1.0 if gait.color == RED else -1.0
    return alpha_1, alpha_2, alpha_3, alpha_4, rate_1, rate_2, slope * rate_1, slope * rate_2
