"""Accelerations of any number of rotors within limits: torque, then lift, then side forces.

A rotor's speed must stay within its limits, so its acceleration is limited to what keeps it there
for a horizon, as in `tiltsim_controllers.laws.allocation`. Requested accelerations outside this box
are split into four parts: the least accelerations with the requested roll and pitch torque rates
and without yaw; the least with the yaw torque rate alone; along ``e``, the least that change lift
and no torque; and what remains, which changes neither: side forces and motion that no output sees.
Then in closed form

1. the largest share, up to 1, of roll and pitch together that is in the box with any lift, so that
   their direction is preserved, whatever that costs in lift;
2. the largest share, up to 1, of yaw that is in the box with that and any lift;
3. the lift nearest to the requested one that is in the box with that torque;
4. the largest share, up to 1, of what remains that is in the box with all of these.

Each is the optimum of a linear program: the first two of two variables, the others of one. Four
rotors have no other torque-free motion than ``e``, so that their roll and pitch are the largest of
all accelerations that do not yaw. More rotors have: motion other than along ``e`` is not searched
for a larger share, which would take a general linear program.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf
from typing import Any, NamedTuple

from tiltsim_controllers.laws.allocation import NEGLIGIBLE
from tiltsim_controllers.laws.force_directions import combination_of
from tiltsim_controllers.laws.least_norm import orthogonal_of, shares_of
from tiltsim_controllers.mathematics.scalar import Pair, Triple, Values, Vector, clipped, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, vectors_of, written_out
from tiltsim_controllers.vehicle.effectiveness import ROTOR_FLOATS, SPIN_SIGN, Rows


class RotorRange(NamedTuple):
    """Limits that the allocation keeps."""

    slowest: float = -inf  # rad/s along the spin; negative for rotors that reverse
    fastest: float = inf
    horizon: float = 1.0  # s


@scalar
def acceleration_range(speed: float, spin: float, limits: Any) -> Pair:
    """The accelerations (rad/s^2) of a rotor that keep it within limits, and zero in any case.

    Args:
        speed: rad/s, signed
        spin: 1 or -1, the sign of the speed with which it pushes along its axis
        limits: a `RotorRange`
    """
    low = min(0.0, (limits.slowest - spin * speed) / limits.horizon)
    high = max(0.0, (limits.fastest - spin * speed) / limits.horizon)
    return (low, high) if spin > 0.0 else (-high, -low)


@cache
def _largest_of(length: int) -> Callable[..., float]:
    @scalar
    def largest(values: Values) -> float:
        size = 0.0
        for i in range(length):
            size = max(size, abs(values[i]))
        return size

    return largest


@cache
def torque_share_of(length: int) -> Callable[..., float]:
    """Scalar code of the largest ``k`` up to 1 with ``start + k torque + c lift`` in a box.

    ``(start, torque, lift, box)``, for any ``c``; the box has a lower and an upper limit for each
    rotor, and is reached without the torque. Every rotor bounds ``c`` from both sides, each bound
    linear in ``k``; the least upper and the greatest lower bound meet at the largest ``k``.
    """
    largest = _largest_of(length)

    @scalar
    def torque_share(start: Values, torque: Values, lift: Values, box: tuple[Pair, ...]) -> float:
        share, steep, small = 1.0, NEGLIGIBLE * largest(lift), NEGLIGIBLE * largest(torque)
        for i in range(length):
            if abs(lift[i]) > steep:
                slope = torque[i] / lift[i]
                most = ((box[i][1] if lift[i] > 0.0 else box[i][0]) - start[i]) / lift[i]
                for j in range(length):
                    if abs(lift[j]) > steep:
                        other = torque[j] / lift[j]
                        end = box[j][0] if lift[j] > 0.0 else box[j][1]
                        least = (end - start[j]) / lift[j]
                        if slope - other > NEGLIGIBLE * (abs(slope) + abs(other)):
                            share = min(share, (most - least) / (slope - other))
            elif abs(torque[i]) > small:
                end = box[i][1] if torque[i] > 0.0 else box[i][0]
                share = min(share, (end - start[i]) / torque[i])
        return max(0.0, share)

    return torque_share


@cache
def feasible_steps_of(length: int) -> Callable[..., Pair]:
    """Scalar code of the steps ``x`` with ``start + x direction`` in a box.

    ``(start, direction, box)``; the start is in the box up to rounding or ahead of it, as a torque
    is that needs some lift.
    """
    largest = _largest_of(length)

    @scalar
    def feasible_steps(start: Values, direction: Values, box: tuple[Pair, ...]) -> Pair:
        low, high, small = -inf, inf, NEGLIGIBLE * largest(direction)
        for i in range(length):
            if abs(direction[i]) > small:
                first = (box[i][0] - start[i]) / direction[i]
                last = (box[i][1] - start[i]) / direction[i]
                low, high = max(low, min(first, last)), min(high, max(first, last))
        return low, high

    return feasible_steps


@cache
def allocated_of(length: int) -> Callable[..., Values]:
    """Scalar code of the accelerations in a box: ``(requested, torque, lift, box)``.

    ``torque`` are three rows, ``lift`` is one: torque and force rates per acceleration. Requested
    ones that are in the box come back as they are, and where the rows depend on each other.
    """
    orthogonal, shares = orthogonal_of(length), shares_of(length, 2)
    dot, scaled, add_scaled = vectors_of(length)[:3]
    torque_share, feasible_steps = torque_share_of(length), feasible_steps_of(length)
    orthonormal, unit, remainder = orthogonal.orthonormal, orthogonal.unit, orthogonal.remainder
    # Rounding may take the sum past the active limit.
    within: Callable[..., Values] = componentwise(
        "within", "a, box", "clipped(a#, box#[0], box#[1])", length, clipped=clipped
    )

    is_within: Callable[..., bool] = written_out(
        f"is_within_{length}",
        "a, box",
        " and ".join(f"box[{i}][0] <= a[{i}] <= box[{i}][1]" for i in range(length)),
    )

    @scalar
    def allocated(
        requested: Values, torque: tuple[Values, Values, Values], lift: Values, box: Any
    ) -> Values:
        if is_within(requested, box):
            return requested
        units = orthonormal(torque[0], torque[1], torque[2])
        alone = unit(remainder(lift, units), lift)
        lift_of_step = dot(lift, alone)
        if lift_of_step != lift_of_step:
            return requested
        yaw, spinning = torque[2], units[2]  # which changes neither roll nor pitch
        along, yaw_of_step = shares(units, requested), dot(yaw, spinning)
        leaning = add_scaled(scaled(along[0], units[0]), along[1], units[1])
        leaning = add_scaled(leaning, -dot(yaw, leaning) / yaw_of_step, spinning)
        spinning = scaled(dot(yaw, requested) / yaw_of_step, spinning)
        rest = add_scaled(remainder(requested, units), -dot(alone, requested), alone)

        share = torque_share(scaled(0.0, leaning), leaning, alone, box)
        turning = scaled(share, leaning)
        share = torque_share(turning, spinning, alone, box)
        turning = add_scaled(turning, share, spinning)
        least, most = feasible_steps(turning, alone, box)
        step = (dot(lift, requested) - dot(lift, turning)) / lift_of_step
        reached = within(add_scaled(turning, max(least, min(most, step)), alone), box)
        _, most = feasible_steps(reached, rest, box)
        return within(add_scaled(reached, max(0.0, min(1.0, most)), rest), box)

    return allocated


@cache
def limited_of(length: int) -> Callable[..., Values]:
    """Scalar code that keeps rotor accelerations (rad/s^2) within limits.

    ``(requested, rows, up, speeds, limits, table, at)``: ``rows`` of F and tau per unit of ``w``,
    ``up`` is world up in body axes, ``limits`` a `RotorRange`; ``table`` and ``at`` as in
    `tiltsim_controllers.vehicle.effectiveness`.
    """
    _, scaled, _, product, sizes = vectors_of(length)
    allocated, combination = allocated_of(length), combination_of(length)
    ranges: Callable[..., tuple[Pair, ...]] = componentwise(
        "acceleration_ranges",
        "speeds, limits, table, at",
        f"range_of(speeds#, table[at + {SPIN_SIGN} + {ROTOR_FLOATS} * @], limits)",
        length,
        range_of=acceleration_range,
    )

    @scalar
    def limited(
        requested: Values,
        rows: Rows,
        up: Triple,
        speeds: Values,
        limits: Any,
        table: Vector,
        at: int,
    ) -> Values:
        fx, fy, fz, tx, ty, tz = rows
        gain = scaled(2.0, sizes(speeds))  # of w, per acceleration
        torque = product(gain, tx), product(gain, ty), product(gain, tz)
        lift = product(gain, combination(up, fx, fy, fz))
        return allocated(requested, torque, lift, ranges(speeds, limits, table, at))

    return limited
