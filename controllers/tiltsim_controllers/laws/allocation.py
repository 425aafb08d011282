"""Rotor accelerations within limits: roll and pitch first, then yaw, lift, and the rest.

A rotor's speed must stay within its limits, so its acceleration is limited to values that keep it
there for a horizon: ``(min - |varpi|) / horizon <= |varpi|' <= (max - |varpi|) / horizon``. The
requested accelerations may lie outside this box, and limiting each rotor separately would produce
an arbitrary torque. Instead, among all accelerations in the box, the allocation takes

1. the largest fraction, up to 1, of the requested roll and pitch torque rates together, so that
   their direction is preserved, whatever that costs in all that follows;
2. of these, the yaw torque rate nearest to the requested one;
3. of these, the lift rate nearest to the requested one;
4. of these, the accelerations nearest to the requested ones, which have the side forces and the
   motion that no output sees.

Roll and pitch decide where the lift points. Yaw, for which rotors have the least authority, must
not cost any of them. It comes before lift, of which a climb may ask for too much as long as it
lasts; side forces come last, as leaning replaces them.

The first three are linear programs, the last is a quadratic one. All are solved by the same active
set method, for any number of rotors: along the objective's gradient, projected on the directions
that earlier objectives and rotors at their limits leave free; a rotor that reaches its limit on the
way stops there, and is released when leaving it pays off.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf, sqrt
from typing import Any, Final, NamedTuple

from tiltsim_controllers.laws.force_directions import combination_of
from tiltsim_controllers.mathematics.rotation import world_up_in_body
from tiltsim_controllers.mathematics.scalar import (
    Pair,
    Quad,
    Triple,
    Values,
    Vector,
    clipped,
    scalar,
)
from tiltsim_controllers.mathematics.vectors import componentwise, vectors_of, written_out
from tiltsim_controllers.vehicle.decoupling_matrix import (
    sines_and_cosines,
    torque_entries,
    vertical_force_entries,
)
from tiltsim_controllers.vehicle.effectiveness import ROTOR_FLOATS, SPIN_SIGN, Rows
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

NEGLIGIBLE: Final = 1e-9
"""Share of a row or gradient below which it is nothing: well above rounding.

Without it, rounding would decide whether a rotor at its limit limits the others.
"""


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


@scalar
def _room(value: float, direction: float, box: Pair) -> float:
    """How far a value may move in a direction within its range."""
    return box[1] - value if direction > 0.0 else value - box[0]


@scalar
def _inverse_length(square: float) -> float:
    """One over the length of the rest of a row of length 1, from its square; 0 if it vanishes."""
    return 1.0 / sqrt(square) if square > NEGLIGIBLE * NEGLIGIBLE else 0.0


@scalar
def _way(value: float, free: float, slope: float, least: float, box: Pair) -> float:
    """The step along a slope that takes a free rotor to its limit; infinite for any other."""
    return _room(value, slope, box) / abs(slope) if free > 0.0 and abs(slope) > least else inf


@scalar
def _loss(value: float, free: float, slope: float, least: float, box: Pair) -> float:
    """Minus the multiplier of a rotor that stopped and gains by leaving its limit; 0 for others."""
    stopped = free == 0.0 and abs(slope) > least
    return -abs(slope) if stopped and _room(value, slope, box) > 0.0 else 0.0


@scalar
def _after(value: float, free: float, slope: float, step: float, is_met: bool, box: Pair) -> float:
    """A rotor's acceleration after a step; at its limit where it is the one that met it."""
    if is_met:
        return box[1] if slope > 0.0 else box[0]
    return value + step * slope if free > 0.0 else value


@cache
def _remainder_of(length: int) -> Callable[..., Values]:
    """Scalar code that projects a gradient off rows and stopped rotors: ``(rows, free, gradient)``.

    The remainder is orthogonal to the rows over the free rotors, for which it is the direction of
    steepest ascent. Its other entries are the multipliers of the rotors that stopped.
    """
    dot, scaled, add_scaled, product, _ = vectors_of(length)

    @scalar
    def without(row: Values, unit: Values, free: Values) -> Values:
        return add_scaled(row, -dot(product(free, unit), row), unit)

    @scalar
    def remainder(
        rows: tuple[Values, Values, Values, Values], free: Values, gradient: Values
    ) -> Values:
        a, b, c, d = rows
        a = scaled(_inverse_length(dot(product(free, a), a)), a)
        b = without(b, a, free)
        b = scaled(_inverse_length(dot(product(free, b), b)), b)
        c = without(without(c, a, free), b, free)
        c = scaled(_inverse_length(dot(product(free, c), c)), c)
        d = without(without(without(d, a, free), b, free), c, free)
        d = scaled(_inverse_length(dot(product(free, d), d)), d)
        rest = without(without(without(gradient, a, free), b, free), c, free)
        return without(rest, d, free)

    return remainder


class _Rotors(NamedTuple):
    """Scalar functions of each of a number of rotors."""

    ways: Callable[..., Values]
    losses: Callable[..., Values]
    after: Callable[..., Values]
    let_go: Callable[..., Values]  # (free, which, now): 1 or 0 for one of them
    smallest: Callable[..., tuple[float, int]]  # (values): and which it is


@cache
def _rotors_of(length: int) -> _Rotors:
    @scalar
    def smallest(values: Values) -> tuple[float, int]:
        least, which = values[0], 0
        for i in range(1, length):
            if values[i] < least:
                least, which = values[i], i
        return least, which

    return _Rotors(
        componentwise(
            "ways",
            "a, free, rest, least, box",
            "way(a#, free#, rest#, least, box#)",
            length,
            way=_way,
        ),
        componentwise(
            "losses",
            "a, free, rest, least, box",
            "loss(a#, free#, rest#, least, box#)",
            length,
            loss=_loss,
        ),
        componentwise(
            "after",
            "a, free, rest, step, met, box",
            "after(a#, free#, rest#, step, met == @, box#)",
            length,
            after=_after,
        ),
        componentwise("let_go", "free, which, now", "now if which == @ else free#", length),
        smallest,
    )


@cache
def allocated_of(length: int) -> Callable[..., Values]:
    """Scalar code of the accelerations in a box: ``(requested, torque, lift, box)``.

    ``torque`` are three rows, ``lift`` is one: torque and force rates per acceleration, of any
    unit. The box has a lower and an upper limit for each rotor, and includes zero. Requested
    accelerations that are in it come back as they are, and so do non-finite ones.
    """
    dot, scaled, add_scaled, product, _ = vectors_of(length)
    nothing, each = (0.0,) * length, (1.0,) * length
    remainder, steps = _remainder_of(length), 3 * length + 8
    ways, losses, after, let_go, smallest = _rotors_of(length)
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
    def unit(row: Values) -> Values:
        square = dot(row, row)
        return scaled(1.0 / sqrt(square), row) if square > 0.0 else row

    @scalar
    def allocated(
        requested: Values, torque: tuple[Values, Values, Values], lift: Values, box: Any
    ) -> Values:
        size = sqrt(dot(requested, requested))
        if is_within(requested, box) or not size < inf:
            return requested
        roll, pitch = dot(torque[0], requested), dot(torque[1], requested)
        if roll == 0.0 and pitch == 0.0:
            roll = 1.0
        across = unit(add_scaled(scaled(pitch, torque[0]), -roll, torque[1]))
        leaning = unit(add_scaled(scaled(roll, torque[0]), pitch, torque[1]))
        turning, rising = unit(torque[2]), unit(lift)
        a, free, level = nothing, each, 0
        for _ in range(steps):
            objective, kept, kept_yaw, kept_lift = leaning, nothing, nothing, nothing
            if level > 0:
                objective, kept = turning, leaning
            if level > 1:
                objective, kept_yaw = rising, turning
            gap = dot(objective, requested) - dot(objective, a)
            gradient = scaled(1.0 if gap > 0.0 else -1.0, objective)
            if level > 2:
                gradient, kept_lift = add_scaled(requested, -1.0, a), rising
            rest = remainder((across, kept, kept_yaw, kept_lift), free, gradient)
            along = dot(product(free, rest), rest)
            least = NEGLIGIBLE * sqrt(dot(gradient, gradient))
            if along > least * least:
                enough = abs(gap) / along if level < 3 else 1.0
                step, which = smallest(ways(a, free, rest, least, box))
                if step < enough:
                    a = after(a, free, rest, step, which, box)
                    free = let_go(free, which, 0.0)
                else:
                    a = after(a, free, rest, enough, -1, box)
                    level = min(3, level + 1)
            else:
                loss, which = smallest(losses(a, free, rest, least, box))
                if loss < 0.0:
                    free = let_go(free, which, 1.0)
                elif level == 3:
                    break
                else:
                    level += 1
        return within(a, box)

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


_allocated, _product = allocated_of(4), vectors_of(4).product


@scalar
def limited_tiltrotor(
    requested: Quad,
    tilts: Quad,
    speeds: Quad,
    roll: float,
    pitch: float,
    vehicle: Vehicle,
    limits: Any,
) -> Values:
    """Rotor accelerations (rad/s^2) of the tiltrotor within limits.

    Args:
        requested: solution of the decoupling matrix, rad/s^2
        tilts, speeds: tilt angles, rad; signed rotor speeds, rad/s
        roll, pitch: rad
        vehicle: the tiltrotor
        limits: a `RotorRange`
    """
    s1, s2, s3, s4 = speeds
    trig = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])
    x2, x4, y1, y3, z1, z2, z3, z4 = torque_entries(trig, drag_ratio(vehicle))
    ux, uy, uz = world_up_in_body(roll, pitch)
    gain = 2.0 * abs(s1), 2.0 * abs(s2), 2.0 * abs(s3), 2.0 * abs(s4)
    torque = (
        _product(gain, (0.0, x2, 0.0, x4)),
        _product(gain, (y1, 0.0, y3, 0.0)),
        _product(gain, (z1, z2, z3, z4)),
    )
    lift = _product(gain, vertical_force_entries(trig, ux, uy, uz))
    box = (
        acceleration_range(s1, -1.0, limits),
        acceleration_range(s2, 1.0, limits),
        acceleration_range(s3, -1.0, limits),
        acceleration_range(s4, 1.0, limits),
    )
    return _allocated(requested, torque, lift, box)
