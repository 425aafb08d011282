"""Rotor accelerations within limits: roll and pitch first, then yaw, lift, and the rest.

A rotor's speed must stay within its limits, so its acceleration is limited to the range that keeps
it there for a horizon: ``(min - |varpi|) / horizon <= |varpi|' <= (max - |varpi|) / horizon``. The
requested accelerations may lie outside this box, and limiting each rotor separately would produce
an arbitrary torque. Instead, among all accelerations in the box, the allocation takes

1. the largest fraction, up to 1, of the requested roll and pitch torque rates together, so that
   their direction is preserved, whatever the cost in the levels below;
2. of these, the yaw torque rate nearest to the requested one;
3. of these, the lift rate nearest to the requested one;
4. of these, the accelerations nearest to the requested ones, which have the side forces and the
   motion that no output sees.

Roll and pitch decide where the lift points. Yaw, for which rotors have the least authority, must
not cost any of them. It comes before lift, of which a climb may demand too much as long as it
lasts; side forces come last, as leaning replaces them.

The first three are linear programs, the last is a quadratic one. All are solved by the same active
set method, for any number of rotors: along the objective's gradient, as far as the levels before it
and the rotors at their limits allow; a rotor that the way meets at its limit stops there, and is
let go again where its multiplier says so.

`bounded_least_squares` is for demands that rotors and tilts meet together as their limits allow.
"""

from math import inf
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import branch, repeat, traceable, xp
from tiltsim_controllers.mathematics.linear import norm, solved_symmetric

NEGLIGIBLE: Final = 1e-9
"""Share of a row or gradient below which it is nothing: well above rounding.

Without it, rounding would decide whether a rotor at its limit limits the others.
"""


class RotorRange(NamedTuple):
    """Limits that the allocation keeps."""

    slowest: float = -inf  # rad/s along the spin; negative for rotors that reverse
    fastest: float = inf
    horizon: float = 1.0  # s


@traceable
def acceleration_range(speeds: Any, spins: Any, limits: RotorRange) -> tuple[Any, Any]:
    """Least and greatest accelerations (rad/s^2) that keep rotors within limits, and zero.

    Args:
        speeds: rad/s, signed, shape (N,) or ().
        spins: 1 or -1, signs of the speeds with which they push along their axes, as ``speeds``.
        limits: Limits of the speeds.
    """
    low = xp.minimum(0.0, (limits.slowest - spins * speeds) / limits.horizon)
    high = xp.maximum(0.0, (limits.fastest - spins * speeds) / limits.horizon)
    along = spins > 0.0
    return xp.where(along, low, -high), xp.where(along, high, -low)


def _unit(row: Any) -> Any:
    """A row divided by its length; zeros as they are."""
    square = row @ row
    exists = square > 0.0
    return xp.where(exists, 1.0 / xp.sqrt(xp.where(exists, square, 1.0)), 1.0) * row


def _remainder(rows: Any, free: Any, gradient: Any) -> Any:
    """The part of a gradient that rows and stopped rotors leave: the direction of steepest ascent.

    Its entries of rotors that stopped are their multipliers. Rows, of length 1 or 0, and gradient
    have shape (N,); ``free`` is 1 for rotors that move, 0 for rotors at a limit.
    """
    units: list[Any] = []
    for row in (*rows, gradient):
        rest = row
        for unit in units:
            rest = rest - ((free * unit) @ rest) * unit
        square = (free * rest) @ rest
        exists = square > NEGLIGIBLE * NEGLIGIBLE
        inverse = xp.where(exists, 1.0 / xp.sqrt(xp.where(exists, square, 1.0)), 0.0)
        units.append(inverse * rest)
    return rest


def _least(values: Any) -> tuple[Any, Any]:
    """The first of the least of some numbers, and its place."""
    least, place = values[0], 0.0
    for index, value in enumerate(values):
        place = xp.where(value < least, float(index), place)
        least = xp.where(value < least, value, least)
    return least, place


def _is_at(place: Any, count: int) -> Any:
    """Whether each of a number of rotors is the one at a place."""
    return xp.array([float(index) for index in range(count)]) == place


class _Objective(NamedTuple):
    """The four levels of the allocation, of which each keeps the results of those before it."""

    requested: Any  # requested accelerations, rad/s^2, shape (N,)
    across: Any  # row that keeps the direction of the roll and pitch torque, shape (N,)
    rows: Any  # rows of roll and pitch, yaw, and lift, shape (3, N)
    low: Any  # lower limits of the accelerations, rad/s^2, shape (N,)
    high: Any  # upper limits of the accelerations, rad/s^2, shape (N,)

    def gradient(self, level: Any, now: Any) -> tuple[Any, Any, Any]:
        """The gradient of a level, the gap that it closes, and the rows that it keeps."""
        leaning, turning, rising = self.rows
        objective = xp.where(level > 1.0, rising, xp.where(level > 0.0, turning, leaning))
        gap = objective @ self.requested - objective @ now
        toward = xp.where(gap > 0.0, 1.0, -1.0) * objective
        gradient = xp.where(level > 2.0, self.requested - now, toward)
        kept = [xp.where(level > k, row, 0.0 * row) for k, row in enumerate(self.rows)]
        return gradient, gap, (self.across, *kept)

    def turn(self, now: Any, free: Any, level: Any) -> tuple[Any, Any, Any, Any]:
        """Accelerations, free rotors, level and whether it is done, one step further."""
        gradient, gap, rows = self.gradient(level, now)
        rest = _remainder(rows, free, gradient)
        along = (free * rest) @ rest
        least = NEGLIGIBLE * norm(gradient)
        counts = abs(rest) > least
        room = xp.where(rest > 0.0, self.high - now, now - self.low)

        def step() -> tuple[Any, ...]:
            moves = (free > 0.0) & counts
            way, met = _least(xp.where(moves, room / xp.where(moves, abs(rest), 1.0), inf))
            enough = xp.where(level < 3.0, abs(gap) / along, 1.0)
            stops = way < enough
            stopped = stops & _is_at(met, len(now))
            moved = now + xp.where(stops, way, enough) * rest
            limit = xp.where(rest > 0.0, self.high, self.low)
            reached = xp.where(stopped, limit, xp.where(free > 0.0, moved, now))
            next_level = xp.where(stops, level, xp.minimum(3.0, level + 1.0))
            return reached, xp.where(stopped, 0.0, free), next_level, 0.0

        def release() -> tuple[Any, ...]:
            stopped = (free == 0.0) & counts & (room > 0.0)
            loss, place = _least(xp.where(stopped, -abs(rest), 0.0))
            gains, is_last = loss < 0.0, level == 3.0
            freed = xp.where(gains & _is_at(place, len(now)), 1.0, free)
            next_level = xp.where(gains | is_last, level, level + 1.0)
            return now, freed, next_level, xp.where(gains, 0.0, xp.where(is_last, 1.0, 0.0))

        return branch(along > least * least, step, release)


@traceable
def allocated(requested: Any, torque: Any, lift: Any, low: Any, high: Any) -> Any:
    """Rotor accelerations (rad/s^2) within limits, shape (N,).

    Requested accelerations within the limits are returned unchanged, and so are infinite and NaN
    ones.

    Args:
        requested: rad/s^2, shape (N,).
        torque: Torque rates per acceleration, of any unit, shape (3, N).
        lift: Force rates, likewise, shape (N,).
        low, high: Limits, which include zero, rad/s^2, shape (N,) each.
    """
    count = len(requested)
    exceeds = False
    for value, least, most in zip(requested, low, high):
        exceeds = exceeds | (value < least) | (value > most)

    def limited() -> Any:
        roll, pitch = torque[0] @ requested, torque[1] @ requested
        roll = xp.where((roll == 0.0) & (pitch == 0.0), 1.0, roll)
        across = _unit(pitch * torque[0] - roll * torque[1])
        leaning = _unit(roll * torque[0] + pitch * torque[1])
        rows = xp.array([leaning, _unit(torque[2]), _unit(lift)])
        objective = _Objective(requested, across, rows, low, high)
        found = repeat(
            3 * count + 8,
            lambda _turn, now, free, level, _done: objective.turn(now, free, level),
            *(xp.zeros(count), xp.ones(count), 0.0, 0.0),
            until=lambda _now, _free, _level, done: done > 0.0,
        )[0]
        return xp.clip(found, low, high)  # rounding may take the sum past the active limit

    return branch((norm(requested) < inf) & exceeds, limited, lambda: requested)


@traceable
def limited_accelerations(
    requested: Any, wrench: Any, up: Any, speeds: Any, spins: Any, limits: RotorRange
) -> Any:
    """Rotor accelerations (rad/s^2) that keep the speeds within limits, shape (N,).

    Args:
        requested: rad/s^2, shape (N,).
        wrench: Force and torque per unit of ``w``, body axes, any units, shape (6, N).
        up: World up in body axes, shape (3,).
        speeds: rad/s, signed, shape (N,).
        spins: Signs of the speeds with which they push along their axes, shape (N,).
        limits: Limits of the speeds.
    """
    gain = 2.0 * abs(speeds)  # of w, per acceleration
    low, high = acceleration_range(speeds, spins, limits)
    return allocated(requested, gain * wrench[3:], gain * (up @ wrench[:3]), low, high)


TOLERANCE: Final = 1e-12
"""How far beyond a limit, in units of the weighted input, counts as beyond."""


def bounded_least_squares(
    matrix: Any, demand: Any, softness: Any, weights: Any, start: Any, low: Any, high: Any
) -> Any:
    """Inputs within limits that meet a demand best, shape (n,).

    The minimum of ``sum (G x - y)^2 / softness + sum q (x - start)^2`` has a dual system with a row
    for each of the six demands, whatever the number of inputs. A small softness makes a demand
    nearly exact, and sets its priority where limits forbid to meet all; inputs without any effect
    stay at the start.

    Inputs beyond their limits first stop there in turn, the farthest ones first (redistributed
    pseudoinverse; Bodson 2002, "Evaluation of optimization methods for control allocation"). From
    there an active set method goes on to the optimum: an input that its limit holds for no reason
    is let go, and one that the way to the next solution meets at its limit stops.

    Args:
        matrix: Effect of the inputs, ``G``, shape (6, n).
        demand: ``y``, shape (6,).
        softness: Shape (6,), positive.
        weights: ``q``, shape (n,), positive.
        start: Shape (n,).
        low, high: Limits, shape (n,).
    """
    lead, size = xp.diag(softness), len(start)
    root = xp.sqrt(weights)

    def turn(_: Any, x: Any, free: Any, settled: Any, _done: Any) -> tuple[Any, ...]:
        moves = free > 0.0
        rest = demand - matrix @ xp.where(moves, start, x)
        dual = solved_symmetric((matrix * (free / weights)) @ matrix.T + lead, rest)
        goal = start + (dual @ matrix) / weights  # of the inputs without limits
        beyond = root * xp.maximum(low - goal, goal - high)
        worst = largest(xp.where(moves, beyond, 0.0))

        def stop() -> tuple[Any, ...]:
            way = xp.where(moves, goal - x, 0.0)
            room = xp.where(way > 0.0, high - x, low - x)
            crosses = moves & (beyond > TOLERANCE)
            shares = xp.where(crosses, room / xp.where(way == 0.0, 1.0, way), 2.0)
            share = -largest(-shares)
            far = crosses & (beyond > 0.5 * worst)
            leaves = (settled > 0.0) & (shares == share) | (settled == 0.0) & far
            along = xp.where(settled > 0.0, x + share * way, xp.where(moves, goal, x))
            limit = xp.where(goal > high, high, low)
            return xp.where(leaves, limit, along), xp.where(leaves, 0.0, free), settled, 0.0

        def release() -> tuple[Any, ...]:
            inward = root * xp.where(x < high, goal - x, x - goal)
            held = xp.where(moves | (low == high), 0.0, inward)
            most = largest(held)
            freed = (held == most) & (most > TOLERANCE)
            done = xp.where(most > TOLERANCE, 0.0, 1.0)
            return xp.where(moves, goal, x), xp.where(freed, 1.0, free), 1.0, done

        return branch(worst > TOLERANCE, stop, release)

    state = (start, xp.ones(size), 0.0, 0.0)
    found = repeat(4.0 * size, turn, *state, until=lambda _x, _free, _settled, done: done > 0.0)
    return xp.clip(found[0], low, high)


def largest(values: Any) -> Any:
    """The largest of some numbers."""
    most = values[0]
    for value in values[1:]:
        most = xp.maximum(most, value)
    return most
