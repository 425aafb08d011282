"""The red gait nearest to a given one, in closed form, with a clearance from the curve L.

Red is the plane ``alpha_3 = alpha_1, alpha_4 = alpha_2`` of the Two Color Map, on which the
torque-free force ``n`` is vertical for all tilts except on the curve L, where it vanishes
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

from __future__ import annotations

from math import atan, cos, pi, sin

from tiltsim_controllers.mathematics.jets import Jet, Jets4, jet_sum
from tiltsim_controllers.mathematics.scalar import scalar


@scalar
def clipped_jet(x: Jet, low: float, high: float) -> Jet:
    """A quantity limited to an interval, at rest on its ends."""
    if x[0] < low:
        return low, 0.0, 0.0
    if x[0] > high:
        return high, 0.0, 0.0
    return x


@scalar
def nearest_red_angles(tilts: Jets4, drag_ratio: float, clearance: float) -> tuple[Jet, Jet]:
    """``(alpha_1, alpha_2)`` of the red gait nearest to moving ``tilts``, as jets (rad and s).

    ``clearance`` (rad, below ``delta``) is the distance kept from the sides of the quadrant
    ``u < 0 < v``, where rotors stop, and from a right angle beyond them, where ``R`` vanishes.
    """
    alpha_1, alpha_2, alpha_3, alpha_4 = tilts
    delta = atan(drag_ratio)
    low, high = clearance - delta, 0.5 * pi - delta - clearance
    return (
        clipped_jet(jet_sum(0.5, alpha_1, 0.5, alpha_3), -high, -low),
        clipped_jet(jet_sum(0.5, alpha_2, 0.5, alpha_4), low, high),
    )


@scalar
def red_determinant(alpha_1: float, alpha_2: float, drag_ratio: float) -> float:
    """``R`` on red (ch. 8, Eq. 7) of angles in rad, factored as above; 4 without tilt."""
    delta = atan(drag_ratio)
    u, v = alpha_1 - delta, alpha_2 + delta
    beside_l = cos(delta) * sin(v - u) - 2.0 * sin(delta) * sin(u) * sin(v)
    return 4.0 * cos(u) * cos(v) * beside_l / (cos(delta) * sin(2.0 * delta))


def determinant_at_clearance(clearance: float, drag_ratio: float) -> float:
    """``R`` at the corner next to P of the region that `nearest_red_angles` allows (rad)."""
    angle = atan(drag_ratio) - clearance
    return red_determinant(angle, -angle, drag_ratio)
