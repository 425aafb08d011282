"""Rotor accelerations within limits: roll and pitch first, then yaw, then altitude, in closed form.

A rotor's speed must stay within its limits, so its acceleration is limited to what keeps it there
for a horizon: ``(min - |varpi|) / horizon <= |varpi|' <= (max - |varpi|) / horizon``. The requested
accelerations may lie outside this box, and limiting each rotor separately would produce an
arbitrary torque. Instead, among all accelerations in the box, the allocation takes

1. the largest fraction, up to 1, of the requested roll and pitch torque rates together, so that
   their direction is preserved, whatever that costs in yaw and lift;
2. of what is then left, the yaw torque rate nearest to the requested one;
3. of what is then left, the lift rate nearest to the requested one.

Yaw, for which rotors have the least authority, has lower priority than roll and pitch. Only rotors
2 and 4 produce roll torque and only rotors 1 and 3 pitch torque, which makes each of the three
linear programs one of a single variable.
"""

from __future__ import annotations

from math import inf
from typing import Final

from tiltsim_controllers.mathematics.rotation import world_up_in_body
from tiltsim_controllers.mathematics.scalar import Octet, Pair, Quad, clipped, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_torque,
    sines_and_cosines,
    solve_by_pairs,
    torque_entries,
    torque_free_inputs,
    vertical_force_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

NEGLIGIBLE: Final = 1e-9
"""Slope, relative to the largest, below which a rotor does not move: well above rounding.

Without it, rounding would decide whether a rotor at its limit limits the others.
"""


@scalar
def _products(factor: float, range_: Pair) -> Pair:
    """The range of ``factor x`` for ``x`` in a range, which may be infinite."""
    if factor == 0.0:
        return 0.0, 0.0
    first, second = factor * range_[0], factor * range_[1]
    return min(first, second), max(first, second)


@scalar
def _feasible_steps(start: float, slope: float, range_: Pair) -> Pair:
    """The steps ``x`` for which ``start + slope x`` is in a range."""
    if abs(slope) <= NEGLIGIBLE:
        return -inf, inf
    first, second = (range_[0] - start) / slope, (range_[1] - start) / slope
    return min(first, second), max(first, second)


@scalar
def _feasible_fraction(entries: Pair, torque: float, range_i: Pair, range_j: Pair) -> float:
    """The largest fraction, up to 1, of a pair's torque that inputs within their ranges produce."""
    low_i, high_i = _products(entries[0], range_i)
    low_j, high_j = _products(entries[1], range_j)
    if torque > 0.0:
        return min(1.0, (high_i + high_j) / torque)
    return min(1.0, (low_i + low_j) / torque) if torque < 0.0 else 1.0


@scalar
def _yaw_range(
    entries: Pair, yaw_entries: Pair, torque: float, range_i: Pair, range_j: Pair
) -> Pair:
    """The yaw torques of a pair whose roll or pitch torque is given.

    Args:
        entries, yaw_entries: roll or pitch torque, and yaw torque, by rotor
        torque: the roll or pitch torque, which inputs within their ranges can produce
        range_i, range_j: ranges of the two rotors' inputs
    """
    first, second = entries
    share = torque / (first * first + second * second)
    start_i, start_j = share * first, share * second
    steps_i = _feasible_steps(start_i, -second, range_i)
    steps_j = _feasible_steps(start_j, first, range_j)
    yaw_i, yaw_j = yaw_entries
    start = yaw_i * start_i + yaw_j * start_j
    low, high = _products(
        yaw_j * first - yaw_i * second, (max(steps_i[0], steps_j[0]), min(steps_i[1], steps_j[1]))
    )
    return start + low, start + high


@scalar
def _scaled(a: Quad, b: Quad) -> Quad:
    """The products of two vectors' components."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]


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
def _nearest_lift(inputs: Quad, direction: Quad, low: Quad, high: Quad) -> Quad:
    """The inputs nearest to the given ones, along a direction, that are within their limits."""
    size = max(abs(direction[0]), abs(direction[1]), abs(direction[2]), abs(direction[3]))
    least, most = -inf, inf
    for i in range(4):
        first, last = _feasible_steps(inputs[i], direction[i] / size, (low[i], high[i]))
        least, most = max(least, first), min(most, last)
    step = max(min(0.0, most), least) / size
    # Rounding may take the sum past the active limit.
    return (
        clipped(inputs[0] + step * direction[0], low[0], high[0]),
        clipped(inputs[1] + step * direction[1], low[1], high[1]),
        clipped(inputs[2] + step * direction[2], low[2], high[2]),
        clipped(inputs[3] + step * direction[3], low[3], high[3]),
    )


@scalar
def allocate_by_priority(
    requested: Quad, torque: Octet, force: Quad, low: Quad, high: Quad
) -> Quad:
    """Rotor inputs within limits: roll and pitch first, then yaw, then lift.

    The requested ones where the decoupling matrix is singular.

    Args:
        requested: rates of the four rotor inputs, rad^2/s^3
        torque: `torque_entries` of the tilt angles
        force: the last row of the decoupling matrix, `vertical_force_entries`
        low, high: limits, which must include zero, rad^2/s^3
    """
    v1, v2, v3, v4 = requested
    x2, x4, y1, y3, z1, z2, z3, z4 = torque
    h1, h2, h3, h4 = force
    roll, pitch, yaw = body_torque(torque, v1, v2, v3, v4)
    range_1, range_2 = (low[0], high[0]), (low[1], high[1])
    range_3, range_4 = (low[2], high[2]), (low[3], high[3])
    fraction = min(
        _feasible_fraction((x2, x4), roll, range_2, range_4),
        _feasible_fraction((y1, y3), pitch, range_1, range_3),
    )
    roll, pitch = fraction * roll, fraction * pitch
    low_24, high_24 = _yaw_range((x2, x4), (z2, z4), roll, range_2, range_4)
    low_13, high_13 = _yaw_range((y1, y3), (z1, z3), pitch, range_1, range_3)
    yaw = clipped(yaw, low_24 + low_13, high_24 + high_13)
    lift = h1 * v1 + h2 * v2 + h3 * v3 + h4 * v4
    inputs = solve_by_pairs(torque, force, roll, pitch, yaw, lift)
    if inputs[0] != inputs[0]:
        return requested
    return _nearest_lift(inputs, torque_free_inputs(torque), low, high)


@scalar
def allocate_accelerations(
    requested: Quad,
    tilts: Quad,
    speeds: Quad,
    roll: float,
    pitch: float,
    vehicle: Vehicle,
    limits: Pair,
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
    # Per rad/s^2 a rotor changes its input by 2 |varpi|.
    gain = (2.0 * abs(s1), 2.0 * abs(s2), 2.0 * abs(s3), 2.0 * abs(s4))
    if _is_in_box(requested, low, high) or min(gain[0], gain[1], gain[2], gain[3]) == 0.0:
        return requested

    trig = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])
    ux, uy, uz = world_up_in_body(roll, pitch)
    v1, v2, v3, v4 = allocate_by_priority(
        _scaled(requested, gain),
        torque_entries(trig, drag_ratio(vehicle)),
        vertical_force_entries(trig, ux, uy, uz),
        _scaled(low, gain),
        _scaled(high, gain),
    )
    return v1 / gain[0], v2 / gain[1], v3 / gain[2], v4 / gain[3]
