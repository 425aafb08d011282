"""Gaits on the two colours of the Two Color Map (ch. 6 to 8, 12).

A colour gives ``alpha_3`` and ``alpha_4`` for chosen ``alpha_1`` and ``alpha_2``. With ``delta =
atan(r)`` both colours are exact lines for any vehicle: red ``alpha_3 = alpha_1, alpha_4 =
alpha_2``, blue ``alpha_3 = 2 delta - alpha_1, alpha_4 = -2 delta - alpha_2``. Paths made of
straight lines become keyframes; the circle of ch. 8 is evaluated here.
"""

from __future__ import annotations

from math import atan, cos, pi, sin
from typing import Final

from tiltsim_controllers.gaits.trot import TiltsAndRates
from tiltsim_controllers.mathematics.scalar import scalar

RED: Final = 0.0
BLUE: Final = 1.0

COLORS: Final = {"red": RED, "blue": BLUE}
"""Colours by the name a scenario gives them."""


@scalar
def colored_angles(
    alpha_1: float, alpha_2: float, color: float, drag_ratio: float
) -> tuple[float, float]:
    """``(alpha_3, alpha_4)`` of a colour (ch. 8, Eqs. 11-12, with the exact offset), rad."""
    if color == RED:
        return alpha_1, alpha_2
    offset = 2.0 * atan(drag_ratio)
    return offset - alpha_1, -offset - alpha_2


@scalar
def two_color_circle(
    time: float,
    period: float,
    centre_1: float,
    centre_2: float,
    radius: float,
    color: float,
    drag_ratio: float,
) -> TiltsAndRates:
    """Tilt angles (rad) and rates (rad/s) on a circle in the alpha_1-alpha_2 plane (ch. 8, Sec. 4).

    Starts at ``(centre_1 + radius, centre_2)`` and turns counter-clockwise once a period.
    """
    turning = 2.0 * pi / period
    along, across = radius * cos(turning * time), radius * sin(turning * time)
    alpha_1, alpha_2 = centre_1 + along, centre_2 + across
    rate_1, rate_2 = -turning * across, turning * along
    alpha_3, alpha_4 = colored_angles(alpha_1, alpha_2, color, drag_ratio)
    slope = 1.0 if color == RED else -1.0
    return alpha_1, alpha_2, alpha_3, alpha_4, rate_1, rate_2, slope * rate_1, slope * rate_2
