"""The colors of the Two Color Map (ch. 6 to 8, 12), and the red gait nearest to a given one.

Red is the plane ``alpha_3 = alpha_1, alpha_4 = alpha_2``, on which the torque-free force ``n`` is
vertical for all tilts except on the curve L, where it vanishes
(`tiltsim_controllers.analysis.two_color_map`). The nearest point of the plane has the means of
opposite angles. The straight path to it keeps their sums and reduces their differences. Where these
are below a right angle, ``n_x`` and ``n_y`` only decrease and ``n_z`` only increases: the margin of
a level vehicle grows along the whole path. With larger differences the path passes a difference of
a right angle, where ``n`` leans most, so the margin may decrease first; beyond half a revolution
``n_z`` also decreases, and the path may be singular.

With ``delta = atan(r)``, ``u = alpha_1 - delta`` and ``v = alpha_2 + delta`` the residual on red is

    ``R = 4 cos u cos v (cos delta sin(v - u) - 2 sin delta sin u sin v) / (cos delta sin 2 delta)``

and the squares of the rotor speeds in hover are proportional to ``sin 2v`` (rotors 1 and 3) and
``-sin 2u`` (rotors 2 and 4). So L, ``cot u - cot v = 2 r``, is not the only boundary: where ``u``
or ``v`` changes sign two rotors stop, before L is reached. The untilted vehicle lies in the
quadrant ``u < 0 < v``, which ends in P and does not intersect L. There the nearest point is found
angle by angle.
"""

from math import atan
from typing import Any, Final

from tiltsim_controllers.code.arrays import traceable, xp

COLORS: Final = ("red", "blue")
"""The colors of the Two Color Map (ch. 6)."""


def colored_angles(
    alpha_1: float, alpha_2: float, color: str, drag_ratio: float
) -> tuple[float, float]:
    """``(alpha_3, alpha_4)`` (rad) of a color (ch. 8, Eqs. 11-12, with the exact offset).

    With ``delta = atan(r)`` both colors are exact lines for any vehicle: red ``alpha_3 = alpha_1,
    alpha_4 = alpha_2``, blue ``alpha_3 = 2 delta - alpha_1, alpha_4 = -2 delta - alpha_2``.

    Args:
        alpha_1, alpha_2: rad
        color: ``red`` or ``blue``
        drag_ratio: ``r = K_m / (L K_f)``

    Raises:
        ValueError: If there is no such color.
    """
    require_color(color)
    if color == "red":
        return alpha_1, alpha_2
    offset = 2.0 * atan(drag_ratio)
    return offset - alpha_1, -offset - alpha_2


def require_color(color: str) -> None:
    """Raise ValueError unless there is a color of this name."""
    if color not in COLORS:
        raise ValueError(f"{color!r} is not a color; choose {', '.join(COLORS)}")


@traceable
def nearest_red_angles(tilts: Any, drag_ratio: Any, clearance: Any) -> Any:
    """``alpha_1`` and ``alpha_2`` of the red gait nearest to moving tilts, shape (4, 3) to (2, 3).

    Angles, rates and accelerations (rad, s), at rest on a side. The clearance (rad, below
    ``delta``) is from the sides of the quadrant ``u < 0 < v``, where rotors stop, and from a right
    angle beyond them, where ``R`` vanishes; the drag ratio is ``r = K_m / (L K_f)``.
    """
    delta = xp.arctan(drag_ratio)
    near, far = clearance - delta, 0.5 * xp.pi - delta - clearance
    means = 0.5 * tilts[:2] + 0.5 * tilts[2:]
    ends = xp.array([[-far, -near], [near, far]])
    return xp.array([_limited(mean, *limits) for mean, limits in zip(means, ends)])


def _limited(mean: Any, low: Any, high: Any) -> Any:
    """A quantity limited to an interval, at rest on its ends, shape (3,)."""
    below, above = mean[0] < low, mean[0] > high
    angle = xp.where(below, low, xp.where(above, high, mean[0]))
    return xp.hstack([angle, xp.where(below | above, 0.0, mean[1:])])
