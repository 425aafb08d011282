"""Rotor accelerations within limits: roll and pitch first, then yaw, then altitude, in closed form.

A rotor's speed must stay within its limits, so its acceleration is limited to what keeps it there
for a horizon: ``(min - |varpi|) / horizon <= |varpi|' <= (max - |varpi|) / horizon``. The requested
accelerations may lie outside this box. Limiting each rotor separately would produce an arbitrary
torque. Here the requested accelerations are split into the part ``a`` that produces the third
derivatives of roll and pitch, the part ``y`` that produces that of yaw, and the part along ``d``
(`torque_free_inputs`), which changes lift and no torque. Of all ``kappa a + beta d`` in the box the
largest ``kappa`` up to 1 is taken, then of ``kappa a + lambda y + beta d`` the largest ``lambda``,
then the ``beta`` nearest to the requested one. The attitude's direction is preserved, and yaw, for
which rotors have the least authority, has lower priority than roll and pitch. Each step is a small
linear program with ``beta`` eliminated pair by pair.
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

Without it rounding would decide between the requested yaw and none.
"""


@scalar
def _pair_bound(
    low: float, own: float, slope: float, high: float, other: float, other_slope: float
) -> float:
    """The largest ``kappa`` for which one rotor's minimum ``beta`` is below another's maximum.

    ``beta >= (low - kappa own) / slope`` and ``beta <= (high - kappa other) / other_slope``. Two
    rotors that ``kappa`` moves alike, as opposite ones with ``alpha_3 = -alpha_1`` in yaw, do not
    bound it.
    """
    above, below = other / other_slope, own / slope
    rise = above - below
    room = high / other_slope - low / slope
    return room / rise if rise > ALIKE * (abs(above) + abs(below)) else inf


@scalar
def largest_feasible_scale(attitude: Quad, direction: Quad, low: Quad, high: Quad) -> float:
    """The largest ``kappa <= 1`` with some ``beta`` that puts ``kappa a + beta d`` into the box.

    For ``kappa = 0`` such a ``beta`` must exist. A rotor whose entry of ``d`` is zero bounds only
    ``kappa``.

    Args:
        attitude: ``a``, rad/s^2
        direction: ``d``, rad/s^2
        low, high: the box, rad/s^2
    """
    scale = 1.0
    for i in range(4):
        if direction[i] == 0.0:
            if attitude[i] > 0.0:
                scale = min(scale, high[i] / attitude[i])
            elif attitude[i] < 0.0:
                scale = min(scale, low[i] / attitude[i])
            continue
        # Where d points down, the rotor's upper limit bounds beta from below.
        low_end = low[i] if direction[i] > 0.0 else high[i]
        for j in range(4):
            if direction[j] == 0.0:
                continue
            high_end = high[j] if direction[j] > 0.0 else low[j]
            scale = min(
                scale,
                _pair_bound(
                    low_end, attitude[i], direction[i], high_end, attitude[j], direction[j]
                ),
            )
    return max(0.0, scale)


@scalar
def _nearest_lift(
    attitude: Quad, direction: Quad, low: Quad, high: Quad, scale: float, requested: float
) -> float:
    """The ``beta`` nearest to the requested one that keeps ``scale a + beta d`` in the box."""
    low_end, high_end = -inf, inf
    for i in range(4):
        if direction[i] == 0.0:
            continue
        first = (low[i] - scale * attitude[i]) / direction[i]
        second = (high[i] - scale * attitude[i]) / direction[i]
        low_end, high_end = max(low_end, min(first, second)), min(high_end, max(first, second))
    return max(min(requested, high_end), low_end)


@scalar
def _subtract_scaled(a: Quad, factor: float, b: Quad) -> Quad:
    """The vector ``a - factor b``."""
    a1, a2, a3, a4 = a
    b1, b2, b3, b4 = b
    return a1 - factor * b1, a2 - factor * b2, a3 - factor * b3, a4 - factor * b4


@scalar
def _is_in_box(w: Quad, low: Quad, high: Quad) -> bool:
    """Whether a vector is in the box."""
    return (
        low[0] <= w[0] <= high[0]
        and low[1] <= w[1] <= high[1]
        and low[2] <= w[2] <= high[2]
        and low[3] <= w[3] <= high[3]
    )


@scalar
def allocate_by_priority(
    tilting: Quad, turning: Quad, direction: Quad, lift: float, low: Quad, high: Quad
) -> Quad:
    """The optimum of ``kappa tilting + lambda turning + beta direction`` in the box.

    Requested are ``kappa = lambda = 1`` and ``beta = lift``.

    Args:
        tilting, turning, direction: the parts ``a``, ``y`` and ``d``, rad/s^2
        lift: requested ``beta``
        low, high: the box, which must contain zero, rad/s^2
    """
    scale = largest_feasible_scale(tilting, direction, low, high)
    low, high = _subtract_scaled(low, scale, tilting), _subtract_scaled(high, scale, tilting)
    yaw_scale = largest_feasible_scale(turning, direction, low, high)
    beta = _nearest_lift(turning, direction, low, high, yaw_scale, lift)
    # Rounding may take the sum past the active limit.
    inside = (
        min(high[0], max(low[0], yaw_scale * turning[0] + beta * direction[0])),
        min(high[1], max(low[1], yaw_scale * turning[1] + beta * direction[1])),
        min(high[2], max(low[2], yaw_scale * turning[2] + beta * direction[2])),
        min(high[3], max(low[3], yaw_scale * turning[3] + beta * direction[3])),
    )
    return _subtract_scaled(inside, -scale, tilting)


@scalar
def allocate_accelerations(
    requested: Quad,
    tilts: Quad,
    speeds: Quad,
    roll: float,
    pitch: float,
    vehicle: Vehicle,
    limits: tuple[float, float],
    horizon: float,
) -> Quad:
    """Rotor accelerations (rad/s^2) within the speed limits, attitude before altitude.

    The requested ones if the limits allow them, and where the decoupling matrix is singular.

    Args:
        requested: solution of the decoupling matrix, rad/s^2
        tilts, speeds: tilt angles, rad; signed rotor speeds, rad/s
        roll, pitch: rad
        vehicle: the tiltrotor
        limits: minimum and maximum absolute rotor speed, rad/s
        horizon: time for which the limits must hold, s
    """
    w1, w2, w3, w4 = requested
    s1, s2, s3, s4 = speeds
    slowest, fastest = limits
    # Along the spin, which is negative for rotors 1 and 3. Zero stays in the box beyond a limit.
    low = (
        min(0.0, -(fastest + s1) / horizon),
        min(0.0, (slowest - s2) / horizon),
        min(0.0, -(fastest + s3) / horizon),
        min(0.0, (slowest - s4) / horizon),
    )
    high = (
        max(0.0, -(slowest + s1) / horizon),
        max(0.0, (fastest - s2) / horizon),
        max(0.0, -(slowest + s3) / horizon),
        max(0.0, (fastest - s4) / horizon),
    )
    if _is_in_box(requested, low, high):
        return requested

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
        return requested
    direction = (f1 / k1, f2 / k2, f3 / k3, f4 / k4)
    lift = (h1 * k1 * w1 + h2 * k2 * w2 + h3 * k3 * w3 + h4 * k4 * w4) / lift_per_beta
    yaw = z1 * k1 * w1 + z2 * k2 * w2 + z3 * k3 * w3 + z4 * k4 * w4
    y1, y2, y3, y4 = solve_by_pairs(torque, force, 0.0, 0.0, yaw, 0.0)
    turning = (y1 / k1, y2 / k2, y3 / k3, y4 / k4)
    tilting = _subtract_scaled(_subtract_scaled(requested, lift, direction), 1.0, turning)
    return allocate_by_priority(tilting, turning, direction, lift, low, high)
