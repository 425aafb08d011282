"""One law for any rotorcraft: rotors fixed, canted, tilting or reversing, four outputs to six.

A call estimates the disturbance from the difference between measured and modeled motion, predicts
the state at which its command will act, demands a force and a torque there, and shares them out to
rotors and tilts within the limits of these; docs/vectoring.md has the theory. Memory are states
whose rates, held over a control period, carry them to their next values.
"""

from __future__ import annotations

from typing import Any, Final, Literal

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.allocation import bounded_least_squares
from tiltsim_controllers.laws.force_directions import torque_free_force
from tiltsim_controllers.laws.keys import Keys, NonNegative, Positive, default, required
from tiltsim_controllers.laws.observed import Command, Observed
from tiltsim_controllers.laws.vectoring_state import (
    Ahead,
    Known,
    Parameters,
    known_of,
    observer_rates,
    predicted,
    served,
    servo_doubts,
)
from tiltsim_controllers.laws.vectoring_steps import (
    TINY,
    aligned,
    demanded,
    pointing,
    turning,
    upward,
)
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.moving import Moving, value_of, where
from tiltsim_controllers.vehicle.rotors import by_tilt, moving_wrench_map, wrench_map, wrench_slope

UP = (0.0, 0.0, 1.0)
LIFT_SOFTNESS: Final = 1e-11
"""Softness of the demanded lift where only rotors meet it; see `bounded_least_squares`."""
TILTING_SOFTNESS: Final = (1e-4, 1e-4, 1e-8, 1e-10, 1e-10, 1e-8)
"""Softness of force and torque that rotors and tilts meet together: roll and pitch come first."""


class Vectoring(Keys):
    """Keys of `vectoring`."""

    law: Literal["vectoring"] = required(
        "one law for every rotorcraft: observers of disturbances, prediction over latency and "
        "lag, braking curves, allocation within limits; rotors and, with tilts = free, tilts"
    )
    position_bandwidth: Positive | None = default(
        None,
        "natural frequency of the position's error; default: a share of attitude_bandwidth [rad/s]",
        3.0,
    )
    attitude_bandwidth: Positive | None = default(
        None,
        "natural frequency of the attitude's error; default: what the lag of rotors, latency and "
        "control period leave [rad/s]",
        12.0,
    )
    observer: NonNegative = default(
        1.0,
        "bandwidth of the observers of force and torque over the designed one; 0: no observers [-]",
    )
    lead: Positive = default(
        3.0, "how much faster than a rotor's lag its thrust follows, by commands beyond [-]"
    )
    restoring: NonNegative = default(
        8.0,
        "rate at which thrusts and tilts that no output sees return to the least and to the "
        "preferred ones [1/s]",
    )
    prediction: bool = default(
        True, "predict the state over latency, control period and lag of the rotors"
    )
    lag_model: bool = default(True, "account for vehicle.rotor_time_constant")
    bounded: bool = default(True, "allocate within the limits of rotors and tilts; false: clip")
    max_tilt_rate: Positive = default(8.0, "of tilts that the law commands [rad/s]")
    max_tilt: Positive = default(
        0.7, "of tilts that the law commands, from the preferred ones [rad]"
    )


def vectoring(observed: Observed, p: Parameters) -> Command:
    """The law, with the states `state_units`."""
    known = known_of(observed, p)
    p = known.p
    doubt, usable = servo_doubts(known)
    ahead = predicted(known, usable)
    speeds, tilt_rates = _allocated(known, ahead, _demand(known, ahead), usable)
    aim = ahead.speeds + (speeds - ahead.speeds) / p.gone
    along = (xp.clip(aim, known.slowest, known.fastest) - ahead.asked) / p.period
    before, asked = known.memory, known.asked
    line = xp.vstack([asked[1:], (asked[-1] + p.period * along)[None]])
    rates = [observer_rates(known), (line - before.speeds).ravel() / p.period]
    if len(observed.tilt_commands) == 0:
        return Command(rotor_accelerations=along, rates=xp.hstack(rates))
    command = observed.tilt_commands
    if len(before.points):
        point = command + p.servo_lead * tilt_rates
        points = xp.vstack([before.points[1:], point[None]])
        rates.append((points - before.points).ravel() / p.period)
    return Command(
        rotor_accelerations=along,
        tilt_angles=command + tilt_rates / p.tilt_gain,
        rates=xp.hstack([*rates, doubt]),
    )


def _demand(known: Known, ahead: Ahead) -> Any:
    """Force (N) and torque (N m) that the rotors shall make, body axes, shape (6,)."""
    seen, p, frame, now = known.seen, known.p, known.frame, ahead.now
    reference, t = seen.reference, ahead.time
    own: Any = p.axis
    if len(ahead.tilts) and len(seen.tilt_commands) == 0:
        rates = reference.tilt_rates
        tilts = Moving(ahead.tilts, rates, 0.0 * rates)
        free = torque_free_force(xp.array(UP), moving_wrench_map(seen.rotors, tilts))
        own = free * (1.0 / xp.sqrt(free.value @ free.value))
    # A vehicle with side force takes the pose; another one leans by its own axis.
    turn, turning_turn = reference.attitude_rates, reference.attitude_accelerations
    pose = Moving(
        reference.attitude + t * (turn + 0.5 * t * turning_turn),
        turn + t * turning_turn,
        turning_turn,
    )
    up = upward(pose)
    axis = where(p.slope > 0.0, up, own)
    x, y, z = up.value
    left = p.cone - xp.arctan2(xp.sqrt(x * x + y * y + TINY), z)
    most = p.slope
    if len(seen.tilt_commands):
        # Tilts that push sideways leave little to turn by; a vehicle that is turned away leans.
        x, y, yaw = now.rotation[0, 0], now.rotation[1, 0], pose.value[2]
        off = xp.arctan2(y * xp.cos(yaw) - x * xp.sin(yaw), x * xp.cos(yaw) + y * xp.sin(yaw))
        most = aligned(abs(off)) * most
    slope = xp.clip(xp.tan(xp.clip(left, 0.0, 1.5)), 0.0, most)
    unit = xp.where(p.cone > 2.0, axis.value, value_of(own))
    made = known.wrench(ahead.speeds, ahead.tilts)[:3]
    # A torque that pushes sideways is no motion to be led along where the vehicle only leans: fed
    # forward it would close an algebraic loop from torque to attitude.
    made = xp.where(p.slope > 0.0, made, (made @ unit) * unit)
    push = now.rotation @ made / frame.mass + frame.force - frame.gravity * xp.array(UP)
    jerk, a = reference.jerk, reference.acceleration
    error = Moving(
        reference.position + t * (reference.velocity + 0.5 * t * (a + t / 3.0 * jerk)),
        reference.velocity + t * (a + 0.5 * t * jerk),
        a + t * jerk,
    ) - Moving(now.position, now.velocity, push)
    turned = jerk - now.rotation @ cross(now.omega, made) / frame.mass
    force = demanded(error, turned, Moving(a + t * jerk, jerk, xp.zeros(3)), frame, p)
    desired, rates, second = pointing(force, axis, pose[2], slope)
    angular = turning(now, desired, rates, second, p)
    momentum = frame.inertia @ now.omega
    torque = frame.inertia @ (angular - frame.torque)
    torque = torque + frame.gyroscopic * cross(now.omega, momentum)
    F = frame.mass * (now.rotation.T @ force.value)
    along = F @ unit
    across = F - along * unit
    size, most = xp.sqrt(across @ across + 1e-24), 1.25 * p.slope * frame.mass * frame.gravity
    across = across * xp.where(size > most, most / size, 1.0)
    pushes = unit @ wrench_map(seen.rotors, ahead.tilts)[:3]
    low, high = (pushes * known.thrusts(speeds) for speeds in (known.slowest, known.fastest))
    lift = xp.maximum(low, high).sum()
    return xp.hstack([xp.clip(along, 0.0, lift) * unit + across, torque])


def _allocated(known: Known, ahead: Ahead, goal: Any, usable: Any) -> tuple[Any, Any]:
    """Rotor speeds (rad/s) after a period, shape (N,), and rates of the tilts (rad/s), (M,)."""
    seen, p, count = known.seen, known.p, len(ahead.speeds)
    free = len(seen.tilt_commands) > 0
    unit = xp.array([1.0, 1.0, 1.0, *[1.0 / p.lever] * 3]) / (count * p.hover)
    limits = known.slowest, known.fastest
    reach = (ahead.speeds + p.gone * (limit - ahead.speeds) for limit in limits)
    low, high = (known.thrusts(speeds) / p.hover for speeds in reach)
    thrusts = known.thrusts(ahead.speeds) / p.hover
    start, rates, tilts = (1.0 - p.pull) * thrusts, xp.zeros(len(ahead.tilts)), ahead.tilts
    side = p.side_softness
    if free:
        start, rates = _with_tilts(known, goal, (thrusts, low, high), usable)
        point = seen.tilt_commands + p.servo_lead * rates
        tilts = served(known, tilts, ahead.tilt_rates, point, usable)[0]
    elif len(tilts):
        tilts = tilts + p.period * seen.reference.tilt_rates
    rows = unit[:, None] * p.hover * wrench_map(seen.rotors, tilts)
    # A gait's tilts change the wrench by themselves, which the thrusts make good.
    made = rows @ thrusts if free else unit * known.wrench(ahead.speeds, ahead.tilts)
    target = made + p.share * (unit * goal - made)
    lean = p.lean_softness
    softness = xp.array([side, side, LIFT_SOFTNESS, lean, lean, p.yaw_softness])
    none = 1e9 * (1.0 - p.bounded)
    found = bounded_least_squares(
        rows, target, softness, xp.ones(count), start, low - none, high + none
    )
    return known.speeds(p.hover * xp.clip(found, low, high)), rates


def _with_tilts(
    known: Known, goal: Any, rotors: tuple[Any, Any, Any], usable: Any
) -> tuple[Any, Any]:
    """Thrusts over hover, shape (N,), and rates of the tilts (rad/s), found together."""
    p = known.p
    seen, (thrusts, low, high) = known.seen, rotors
    command, count = seen.tilt_commands, len(thrusts)
    unit = xp.array([1.0, 1.0, 1.0, *[1.0 / p.lever] * 3]) / count
    pushing = unit[:, None] * wrench_map(seen.rotors, command)
    slopes = wrench_slope(seen.rotors, command) * xp.maximum(thrusts, 0.3)
    leaning = by_tilt(seen.rotors, unit[:, None] * slopes)
    made = pushing @ thrusts
    target = made + p.share * (unit / p.hover * goal - made)
    way = known.preferred - command
    most = p.tilt_step * usable
    least, largest = (
        xp.clip(known.preferred + sign * p.tilt_range, -p.tilt_stop, p.tilt_stop) - command
        for sign in (-1.0, 1.0)
    )
    lower, upper = xp.clip(least, -most, most), xp.clip(largest, -most, most)
    found = bounded_least_squares(
        xp.hstack([pushing, leaning]),
        target,
        xp.array(TILTING_SOFTNESS),
        xp.ones(count + len(command)),
        xp.hstack([(1.0 - p.pull) * thrusts, p.pull * usable * way]),
        xp.hstack([low, lower]),
        xp.hstack([high, upper]),
    )
    return found[:count], found[count:] / p.period
