"""State of `vectoring`: memory, observers of disturbances, and the motion to where commands act."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import repeat, take_row, xp
from tiltsim_controllers.laws.observed import Failure, Observed, working
from tiltsim_controllers.laws.vectoring_steps import Frame, Motion, moved, turn_by
from tiltsim_controllers.mathematics.attitude import (
    attitude_error,
    quaternion_of_rotation,
    rotation_of_quaternion,
)
from tiltsim_controllers.mathematics.records import Vector3
from tiltsim_controllers.vehicle.rotors import wrench_map

MOTION = 20
"""States of the modeled motion and its disturbance."""
SPARE_LIFT: Final = 0.3, 0.4
"""Greatest lift over weight, less one, at which yaw yields to lift, and from which it does not."""
YIELDING: Final = 1e-9
"""Softness of a demand of yaw that yields: more than the softness of lift."""


class Ability(NamedTuple):
    """The part of `Parameters` that changes with the failure of a rotor."""

    axis: Vector3
    slope: float
    cone: float
    position: float
    rise: float
    direct: float
    near: float
    lean_time: float
    attitude: float
    yaw: float
    angular: float
    spin: float
    yaw_angular: float
    side_softness: float
    lean_softness: float
    yaw_softness: float


class Parameters(NamedTuple):
    """Numbers of the law, see `tiltsim_controllers.analysis.vectoring_design`."""

    period: float  # s, between calls
    late: float  # s, from the arrival of a command to the middle of its effect
    keep: float  # share of a rotor's speed, ...
    old: float  # ... of its former and ...
    new: float  # ... of its next speed command in its speed after a period
    begun: float  # share of the way to a speed command when its effect begins
    gone: float  # share of the way to a constant command after a period
    reads: float  # 1: rotors are where they are commanded to, else 0
    predicts: float  # 1 or 0
    bounded: float  # 1 or 0
    position: float  # rad/s, across
    damping: float
    rise: float  # rad/s, of height
    rise_damping: float
    acceleration: float  # m/s^2, of the feedback, across
    ascent: float  # m/s^2, likewise upward
    descent: float  # m/s^2, likewise downward
    greatest: float  # m/s^2, of the rotors
    direct: float  # m/s^2, likewise across, by side force alone
    near: float  # m, within which side force alone is faster
    lean_time: float  # s, until a braking begins
    attitude: float  # rad/s
    attitude_damping: float
    yaw: float  # rad/s
    angular: float  # rad/s^2, about x and y
    spin: float  # rad/s, likewise
    yaw_angular: float  # rad/s^2
    reversal: float  # s, until a braking begins
    share: float  # of a demanded change of the wrench in a period
    position_trust: Vector3  # share of a measured position in its estimate, per call
    velocity_trust: Vector3
    attitude_trust: float
    rate_trust: Vector3
    force_gain: float  # 1/s, of the estimated disturbance, per call
    excess_gain: float  # 1/s, of the excess of thrust per mass, likewise
    torque_gain: Vector3
    slope: float  # side force per lift without lean
    cone: float  # rad, from level: of the poses that the side force holds; pi: of all
    hover: float  # N, thrust of a rotor
    lever: float  # m
    axis: Vector3  # along which it pushes with fixed rotors or preferred tilts
    failure: Failure
    after: Ability  # without the failed rotor
    side_softness: float
    lean_softness: float
    yaw_softness: float  # at the tilts that the servos will have
    pull: float  # share of the way to the preferred inputs in a period
    tilt_step: float  # rad, in a period
    tilt_range: float  # rad, from the preferred tilts
    tilt_stop: float  # rad, from level
    tilt_gain: float  # 1/s, of the loop around the law
    servo_angle: Vector3  # of a servo after a period, per angle, rate and set point
    servo_rate: Vector3  # likewise
    servo_lead: float  # s
    patience: float  # s, until a servo that does not move counts as stuck


class Memory(NamedTuple):
    """The law's states of N rotors and M commanded tilts, with d samples of latency."""

    position: Any  # (3,), m, modeled, world axes
    velocity: Any  # (3,), m/s, likewise
    attitude: Any  # (4,), modeled, a unit quaternion, scalar first
    omega: Any  # (3,), rad/s, modeled, body axes
    force: Any  # (3,), m/s^2, of the disturbance
    torque: Any  # (3,), rad/s^2, of the disturbance
    excess: Any  # of the true thrust per mass over the known one
    speeds: Any  # (d + 1, N), rad/s: commanded, at the present and the next samples
    points: Any  # (d, M), rad: set points of the servos on their way
    doubt: Any  # (M,), s, for which servos did not move


def state_units(rotors: int, tilts: int, latency: int) -> dict[str, str]:
    """Names and units of the states, in the order of `Memory`."""
    numbers, pods, steps = range(1, rotors + 1), range(1, tilts + 1), range(latency + 1)
    return {
        **{f"state_modeled_position_{axis}": "m" for axis in "xyz"},
        **{f"state_modeled_velocity_{axis}": "m/s" for axis in "xyz"},
        **{f"state_modeled_quaternion_{part}": "1" for part in "wxyz"},
        **{f"state_modeled_rate_{axis}": "rad/s" for axis in "xyz"},
        **{f"state_disturbing_acceleration_{axis}": "m/s^2" for axis in "xyz"},
        **{f"state_disturbing_angular_acceleration_{axis}": "rad/s^2" for axis in "xyz"},
        "state_excess_of_thrust_per_mass": "1",
        **{f"state_speed_command_{step}_{i}": "rad/s" for step in steps for i in numbers},
        **{f"state_set_point_{step}_{i}": "rad" for step in steps[1:] for i in pods},
        **{f"state_still_{i}": "s" for i in pods},
    }


def memory_of(observed: Observed) -> Memory:
    """The law's states by name."""
    states, rotors = observed.states, len(observed.thrusts)
    tilts = len(observed.tilt_commands)
    steps = (len(states) - MOTION - rotors - tilts) // (rotors + tilts)
    first = MOTION + rotors * (steps + 1)
    speeds, points = states[MOTION:first], states[first : first + steps * tilts]
    return Memory(
        states[0:3],
        states[3:6],
        states[6:10],
        states[10:13],
        states[13:16],
        states[16:19],
        states[19],
        speeds.reshape(steps + 1, rotors),
        points.reshape(steps, tilts),
        states[first + steps * tilts :],
    )


class Known(NamedTuple):
    """The law's knowledge at a call: observation, parameters, memory and `law_table`."""

    seen: Observed
    p: Parameters
    memory: Memory
    frame: Frame
    now: Motion
    asked: Any  # (d + 1, N), rad/s: `Memory.speeds`, from measured speeds on without lag
    thrust: Any  # (N,), N s^2/rad^2
    slowest: Any  # (N,), rad/s, along the spin
    fastest: Any
    preferred: Any  # (M,), rad

    def thrusts(self, speeds: Any) -> Any:
        """Thrusts (N) at speeds (rad/s), shape (N,) each."""
        return self.thrust * speeds * abs(speeds)

    def speeds(self, thrusts: Any) -> Any:
        """The inverse of `thrusts`."""
        return xp.copysign(xp.sqrt(abs(thrusts) / self.thrust), thrusts)

    def wrench(self, speeds: Any, tilts: Any) -> Any:
        """Force (N) and torque (N m) of the rotors, body axes, shape (6,)."""
        return wrench_map(self.seen.rotors, tilts) @ self.thrusts(speeds)


class Ahead(NamedTuple):
    """The state at which a command will act."""

    now: Motion
    speeds: Any  # (N,), rad/s, of the rotors
    asked: Any  # (N,), rad/s, last commanded
    tilts: Any  # (M,), rad
    tilt_rates: Any  # (M,), rad/s
    time: Any  # s from now


def known_of(observed: Observed, p: Parameters) -> Known:
    """The law's knowledge at a call."""
    body, memory = observed.vehicle, memory_of(observed)
    inertia, turns = observed.inertia, observed.gyroscopic
    rotors, table = len(observed.thrusts), xp.array(observed.table)
    works = working(observed.time, p.failure, rotors)
    harmed = observed.time >= p.failure.known_from
    able = {
        name: xp.where(harmed, getattr(p.after, name), getattr(p, name))
        for name in Ability._fields[1:]
    }
    p = p._replace(axis=xp.where(harmed, xp.array(p.after.axis), xp.array(p.axis)), **able)
    # An object to stand on carries the vehicle and is no disturbance: nothing is learned there.
    push = observed.contact_force
    learns = xp.where((push[2] < 0.0) & (4.0 * push[2] * push[2] > push @ push), 0.0, 1.0)
    p = p._replace(
        velocity_trust=1.0 - learns * (1.0 - xp.array(p.velocity_trust)),
        rate_trust=1.0 - learns * (1.0 - xp.array(p.rate_trust)),
        force_gain=learns * p.force_gain,
        excess_gain=learns * p.excess_gain,
        torque_gain=learns * xp.array(p.torque_gain),
    )
    mass = body.mass / (1.0 + memory.excess)
    # Yaw takes lift, as it slows rotors down: where little lift is spare, yaw yields to it.
    spare = p.greatest * body.mass / (mass * body.gravity) - 1.0
    needs = xp.clip((SPARE_LIFT[1] - spare) / (SPARE_LIFT[1] - SPARE_LIFT[0]), 0.0, 1.0)
    p = p._replace(yaw_softness=p.yaw_softness + YIELDING * needs)
    thrust, slowest, fastest = table[: 3 * rotors].reshape(3, rotors)
    return Known(
        observed._replace(rotors=observed.rotors.masked(works)),
        p,
        memory,
        Frame(mass, body.gravity, inertia, turns, memory.force, memory.torque),
        _estimated(observed, memory, p),
        memory.speeds + p.reads * (observed.rotor_speeds - memory.speeds[0]),
        thrust,
        slowest,
        fastest,
        table[3 * rotors :],
    )


def _estimated(seen: Observed, memory: Memory, p: Parameters) -> Motion:
    """The motion between the modeled and the measured one, which is noisier and never late."""
    rotation = rotation_of_quaternion(memory.attitude)
    turn = turn_by(p.attitude_trust * attitude_error(rotation, seen.rotation))
    return Motion(
        memory.position + xp.array(p.position_trust) * (seen.position - memory.position),
        memory.velocity + p.velocity_trust * (seen.velocity - memory.velocity),
        rotation @ turn,
        memory.omega + p.rate_trust * (seen.body_rates - memory.omega),
    )


def observer_rates(known: Known) -> Any:
    """Rates of modeled motion and estimated disturbance, shape (MOTION,)."""
    seen, p, memory = known.seen, known.p, known.memory
    after = following(known, seen.rotor_speeds, known.asked[:2])
    speeds = 0.5 * (seen.rotor_speeds + after)
    wrench = known.wrench(speeds, seen.tilt_angles + 0.5 * p.period * seen.tilt_rates)
    then = moved(known.now, wrench, known.frame, p.period)
    # A disturbance along the thrust counts as an excess of it, and leans with the vehicle.
    push = known.now.rotation @ wrench[:3] / seen.vehicle.mass
    slip = seen.velocity - memory.velocity
    along = (slip @ push) / (push @ push + 0.1 * seen.vehicle.gravity**2)
    attitude = quaternion_of_rotation(then.rotation)
    attitude = attitude * xp.copysign(1.0, attitude @ memory.attitude)
    change = [
        then.position - memory.position,
        then.velocity - memory.velocity,
        attitude - memory.attitude,
        then.omega - memory.omega,
        p.force_gain * (slip - along * push),
        p.torque_gain * (seen.body_rates - memory.omega),
        xp.array([xp.clip(memory.excess + p.excess_gain * along, -0.5, 0.6) - memory.excess]),
    ]
    return xp.hstack(change) / p.period


def following(known: Known, speeds: Any, commands: Any) -> Any:
    """Rotor speeds (rad/s) after a period, shape (N,).

    Args:
        known: See `Known`.
        speeds: At its beginning, rad/s.
        commands: At its beginning and end, or equal ones once, rad/s, shape (2, N) or (1, N).
    """
    p = known.p
    return p.keep * speeds + p.old * commands[0] + p.new * commands[-1]


def servo_doubts(known: Known) -> tuple[Any, Any]:
    """Rates of the doubts in the servos, and 1 for a servo that works, else 0: shape (M,) each."""
    seen, p, before = known.seen, known.p, known.memory.doubt
    if len(seen.tilt_commands) == 0:
        return xp.zeros(0), xp.zeros(0)
    way = abs(seen.tilt_commands - seen.tilt_angles)
    still = (way > 0.02) & (abs(seen.tilt_rates) * p.patience < 0.5 * way)
    doubt = xp.where(still, xp.minimum(before + p.period, 2.0 * p.patience), 0.0)
    doubt = xp.where((way > 0.02) | (before == 0.0), doubt, before)
    return (doubt - before) / p.period, xp.where(doubt > p.patience, 0.0, 1.0)


def served(known: Known, tilts: Any, rates: Any, point: Any, usable: Any) -> tuple[Any, Any]:
    """Tilts (rad) and their rates (rad/s) after a period, shape (M,) each.

    Args:
        known: See `Known`.
        tilts, rates: At its beginning, rad and rad/s.
        point: Set point of the servos, rad.
        usable: 0 for a servo that is stuck, else 1.
    """
    state = xp.vstack([tilts, rates, point])
    angle = xp.where(usable > 0.5, xp.array(known.p.servo_angle) @ state, tilts)
    return angle, usable * (xp.array(known.p.servo_rate) @ state)


def predicted(known: Known, usable: Any) -> Ahead:
    """The state at which this call's command will act, by the commands on their way."""
    seen, p, asked, now = known.seen, known.p, known.asked, known.now
    steps, rotors, free = len(asked) - 1, len(seen.thrusts), len(seen.tilt_commands) > 0
    tilts, rates, speeds = seen.tilt_angles, seen.tilt_rates, seen.rotor_speeds
    planned, h = seen.reference.tilt_rates, p.period
    queue, points = asked.ravel(), known.memory.points.ravel()

    def turn(i: Any, *state: Any) -> tuple[Any, ...]:
        body, speeds, tilts, rates = Motion(*state[:4]), *state[4:]
        commands = take_row(queue, i, rotors), take_row(queue, i + 1.0, rotors)
        next_speeds = following(known, speeds, commands)
        if free:
            point = take_row(points, i, len(tilts))
            next_tilts, next_rates = served(known, tilts, rates, point, usable)
        else:
            next_tilts, next_rates = tilts + h * planned, planned
        mean = 0.5 * (speeds + next_speeds), 0.5 * (tilts + next_tilts)
        body = moved(body, known.wrench(*mean), known.frame, h)
        return (*body, next_speeds, next_tilts, next_rates)

    state: tuple[Any, ...] = (*now, speeds, tilts, rates)
    if steps:
        state = repeat(steps * p.predicts, turn, *state)
    now, (speeds, tilts, rates) = Motion(*state[:4]), state[4:]
    speeds = speeds + p.begun * (asked[-1] - speeds)
    late = p.predicts * p.late
    if free:
        at = served(known, tilts, rates, seen.tilt_commands, usable)[0]
        tilts = xp.where(p.predicts * late > 0.0, at, tilts)
    else:
        tilts = tilts + late * planned
    now = moved(now, known.wrench(speeds, tilts), known.frame, late)
    return Ahead(now, speeds, asked[-1], tilts, rates, p.predicts * steps * h + late)
