"""Rotor accelerations within limits: roll and pitch, then yaw, then altitude, in closed form.

A rotor's speed must stay within its limits, so its acceleration must keep it there for some time to
come: ``(least - |varpi|) / horizon <= |varpi|' <= (greatest - |varpi|) / horizon``. What a law asks
for may lie outside this box. Plain inversion lets every rotor stop at its own limit; what then
comes out is a torque that nobody asked for. Here the wanted accelerations are split into the part
``a`` that makes the third derivatives of roll and pitch, the part ``y`` that makes yaw's, and the
part along ``d`` (`torque_free_inputs`), which changes lift and no torque. Of all
``kappa a + beta d`` in the box the largest ``kappa`` up to 1 is taken, then of
``kappa a + lambda y + beta d`` the largest ``lambda``, then the ``beta`` nearest to the wanted one.
Attitude keeps its direction, and yaw, for which rotors have the least authority, gives way to roll
and pitch. Each answer is that of a small linear program with ``beta`` eliminated pair by pair.
"""

from __future__ import annotations

from math import inf
from typing import Final

from tiltsim_controllers.mathematics.rotation import world_up_in_body
from tiltsim_controllers.mathematics.scalar import Quad, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import (
    sines_and_cosines,
    solve_by_pairs,
    torque_entries,
    torque_free_inputs,
    vertical_force_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

ALIKE: Final = 1e-9
"""Relative difference below which two rotors move alike, well above rounding.

By the last bit alone yaw would get all that is asked for or nothing.
"""


@scalar
def pair_bound(
    low: float, own: float, slope: float, high: float, other: float, other_slope: float
) -> float:
    """The largest ``kappa`` for which one rotor's least ``beta`` is below another's greatest.

    ``beta >= (low - kappa own) / slope`` and ``beta <= (high - kappa other) / other_slope``. Two
    rotors that ``kappa`` moves alike, as opposite ones with ``alpha_3 = -alpha_1`` in yaw, do not
    bound it, however little room they have.
    """
    above, below = other / other_slope, own / slope
    rise = above - below
    room = high / other_slope - low / slope
    return room / rise if rise > ALIKE * (abs(above) + abs(below)) else inf


@scalar
def largest_feasible_scale(attitude: Quad, direction: Quad, low: Quad, high: Quad) -> float:
    """The largest ``kappa <= 1`` with some ``beta`` that puts ``kappa a + beta d`` into the box.

    There must be such a ``beta`` for ``kappa = 0``. A rotor whose entry of ``d`` is zero bounds
    ``kappa`` alone.
    """
    share = 1.0
    for i in range(4):
        if direction[i] == 0.0:
            if attitude[i] > 0.0:
                share = min(share, high[i] / attitude[i])
            elif attitude[i] < 0.0:
                share = min(share, low[i] / attitude[i])
            continue
        # Where d points down, the rotor's upper limit bounds beta from below.
        least = low[i] if direction[i] > 0.0 else high[i]
        for j in range(4):
            if direction[j] == 0.0:
                continue
            greatest = high[j] if direction[j] > 0.0 else low[j]
            share = min(
                share,
                pair_bound(least, attitude[i], direction[i], greatest, attitude[j], direction[j]),
            )
    return max(0.0, share)


@scalar
def nearest_lift(
    attitude: Quad, direction: Quad, low: Quad, high: Quad, share: float, wanted: float
) -> float:
    """The ``beta`` nearest to the wanted one that keeps ``share a + beta d`` in the box."""
    least, greatest = -inf, inf
    for i in range(4):
        if direction[i] == 0.0:
            continue
        first = (low[i] - share * attitude[i]) / direction[i]
        second = (high[i] - share * attitude[i]) / direction[i]
        least, greatest = max(least, min(first, second)), min(greatest, max(first, second))
    return max(min(wanted, greatest), least)


@scalar
def less(a: Quad, factor: float, b: Quad) -> Quad:
    """The vector ``a - factor b``."""
    return (
        a[0] - factor * b[0],
        a[1] - factor * b[1],
        a[2] - factor * b[2],
        a[3] - factor * b[3],
    )


@scalar
def within(w: Quad, low: Quad, high: Quad) -> bool:
    """Whether a vector lies in the box."""
    return (
        low[0] <= w[0] <= high[0]
        and low[1] <= w[1] <= high[1]
        and low[2] <= w[2] <= high[2]
        and low[3] <= w[3] <= high[3]
    )


@scalar
def prioritized(
    tilting: Quad, turning: Quad, direction: Quad, lift: float, low: Quad, high: Quad
) -> Quad:
    """The best of ``kappa tilting + lambda turning + beta direction`` within ``low`` and ``high``.

    Wanted are ``kappa = lambda = 1`` and ``beta = lift``. The box must hold zero.
    """
    share = largest_feasible_scale(tilting, direction, low, high)
    low, high = less(low, share, tilting), less(high, share, tilting)
    counter_yaw_per_tilt = largest_feasible_scale(turning, direction, low, high)
    beta = nearest_lift(turning, direction, low, high, counter_yaw_per_tilt, lift)
    # Rounding may carry the sum past the limit that it touches.
    inside = (
        min(high[0], max(low[0], counter_yaw_per_tilt * turning[0] + beta * direction[0])),
        min(high[1], max(low[1], counter_yaw_per_tilt * turning[1] + beta * direction[1])),
        min(high[2], max(low[2], counter_yaw_per_tilt * turning[2] + beta * direction[2])),
        min(high[3], max(low[3], counter_yaw_per_tilt * turning[3] + beta * direction[3])),
    )
    return less(inside, -share, tilting)


@scalar
def allocate_accelerations(
    wanted: Quad,
    tilts: Quad,
    speeds: Quad,
    roll: float,
    pitch: float,
    vehicle: Vehicle,
    limits: tuple[float, float],
    horizon: float,
) -> Quad:
    """Rotor accelerations (rad/s^2) within the speed limits, attitude before altitude.

    ``wanted`` are those of the law's plain inversion, ``tilts`` (rad) and signed ``speeds`` (rad/s)
    the present ones, ``limits`` the least and greatest absolute speed and ``horizon`` (s) the time
    over which they must hold. ``wanted`` comes back untouched if the limits allow it, and where the
    decoupling matrix is singular.
    """
    w1, w2, w3, w4 = wanted
    s1, s2, s3, s4 = speeds
    least, greatest = limits
    # Along the spin: rotors 1 and 3 turn the negative way. Zero stays in the box beyond a limit.
    low = (
        min(0.0, -(greatest + s1) / horizon),
        min(0.0, (least - s2) / horizon),
        min(0.0, -(greatest + s3) / horizon),
        min(0.0, (least - s4) / horizon),
    )
    high = (
        max(0.0, -(least + s1) / horizon),
        max(0.0, (greatest - s2) / horizon),
        max(0.0, -(least + s3) / horizon),
        max(0.0, (greatest - s4) / horizon),
    )
    if within(wanted, low, high):
        return wanted

    trig = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])
    torque = torque_entries(trig, drag_ratio(vehicle))
    _x2, _x4, _y1, _y3, z1, z2, z3, z4 = torque
    f1, f2, f3, f4 = torque_free_inputs(torque)
    ux, uy, uz = world_up_in_body(roll, pitch)
    force = vertical_force_entries(trig, ux, uy, uz)
    h1, h2, h3, h4 = force
    # Per rad/s^2 a rotor changes its w by 2 |varpi|.
    k1, k2, k3, k4 = 2.0 * abs(s1), 2.0 * abs(s2), 2.0 * abs(s3), 2.0 * abs(s4)
    lift_per_beta = h1 * f1 + h2 * f2 + h3 * f3 + h4 * f4
    if lift_per_beta == 0.0 or k1 == 0.0 or k2 == 0.0 or k3 == 0.0 or k4 == 0.0:
        return wanted
    direction = (f1 / k1, f2 / k2, f3 / k3, f4 / k4)
    lift = (h1 * k1 * w1 + h2 * k2 * w2 + h3 * k3 * w3 + h4 * k4 * w4) / lift_per_beta
    yaw = z1 * k1 * w1 + z2 * k2 * w2 + z3 * k3 * w3 + z4 * k4 * w4
    y1, y2, y3, y4 = solve_by_pairs(torque, force, 0.0, 0.0, yaw, 0.0)
    turning = (y1 / k1, y2 / k2, y3 / k3, y4 / k4)
    tilting = less(less(wanted, lift, direction), 1.0, turning)
    return prioritized(tilting, turning, direction, lift, low, high)
