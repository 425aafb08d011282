"""Parameters of `vectoring` from a vehicle, its actuators and the times of the control loop.

Bandwidths come from the delay that no prediction removes, braking limits from the thrusts that the
limits leave, and the side force that needs no lean from a linear program.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import atan, exp, pi
from typing import Any, Final

import numpy as np

from tiltsim_controllers.laws.failures import Failure
from tiltsim_controllers.laws.full_pose import pose_rank
from tiltsim_controllers.laws.vectoring import Vectoring
from tiltsim_controllers.laws.vectoring_state import Parameters
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.effectiveness import (
    ROTOR_FLOATS,
    SPIN_SIGN,
    force_and_torque,
    tilt_of_rotor,
)
from tiltsim_controllers.vehicle.rotors import by_tilt, rotors_in, wrench_slope

SIDE_SHARE: Final = 0.65
"""Share of the greatest thrusts that side force may take."""
TOTAL_SHARE: Final = 0.9
"""Share of the greatest thrusts that is demanded in all."""
DELAY_MARGIN: Final = 0.22
"""Attitude bandwidth times the delay that is left."""
POSITION_SHARE: Final = 0.3
"""Position bandwidth over attitude bandwidth."""
FASTEST: Final = (40.0, 23.0, 8.0)
"""rad/s: attitude, yaw and position without lag and latency."""
ERROR: Final = 0.1
"""rad: the error of attitude or yaw that demands all torque about its axis, or more."""
TORQUE_OBSERVER: Final = 40.0
"""1/s: the fastest observer of torque."""
TRACKING: Final = 250.0
"""1/s: how fast the wrench follows its demand where rotors have no lag."""
REACH: Final = 10.0
"""Greatest thrust over hover thrust where nothing else limits it."""
SERVO_ANGLE: Final = 0.3
"""rad: the tilt by which braking counts about an axis that only tilts turn."""
MOST_TILT: Final = 3.1
"""rad: commanded tilts stay below half a turn."""
DIRECTIONS: Final = 8
"""Directions of side force in the linear programs."""


@dataclass(frozen=True)
class Craft:
    """A vehicle as the design sees it, N rotors with M tilts.

    Attributes:
        table: Table of the rotors, per newton.
        mass, gravity: kg, m/s^2.
        inertia: kg m^2, shape (3, 3).
        thrust: N s^2/rad^2, shape (N,).
        slowest, fastest: rad/s, along the spin, shape (N,).
        tilts: At the start, rad, shape (M,).
        commanded: Whether the law commands the tilts.
        moving: Whether a gait moves them.
        levers: m, of the rotors from the center of mass, shape (N,).
    """

    table: Values
    mass: float
    gravity: float
    inertia: Floats
    thrust: Floats
    slowest: Floats
    fastest: Floats
    tilts: Floats
    commanded: bool
    moving: bool
    levers: Floats

    @property
    def hover(self) -> float:
        """Thrust (N) of a rotor in hover, were all upward."""
        return self.mass * self.gravity / len(self.thrust)

    @property
    def limits(self) -> tuple[Floats, Floats]:
        """Least and greatest thrusts, N, shape (N,) each."""
        low, high = (self.thrust * s * np.abs(s) for s in (self.slowest, self.fastest))
        return low, high

    def outputs(self, tilts: Floats) -> int:
        """How many of the six outputs rotors and tilts move."""
        spins = np.reshape(self.table, (len(self.thrust), ROTOR_FLOATS))[:, SPIN_SIGN]
        return pose_rank(self.table, tilts, spins)

    def wrench(self, tilts: Floats) -> Floats:
        """Force and torque per newton, shape (6, N)."""
        force, torque = force_and_torque(self.table, tilts[np.newaxis])
        return np.vstack([force[0], torque[0]])


@dataclass(frozen=True)
class Timing:
    """Times of a control loop.

    Attributes:
        period: s, between control samples, or of integration.
        sampled: Whether there are samples.
        latency: Samples from a reading to its command.
        lag: s, of the rotors; 0 for none.
        servo: Natural frequency (rad/s) and damping ratio of the tilt servos.
        servo_limits: Largest rate (rad/s) and angle (rad) of these, infinite without limits.
        tilt_gain: 1/s, of the loop that moves the commanded tilts.
    """

    period: float
    sampled: bool
    latency: int
    lag: float
    servo: tuple[float, float]
    servo_limits: tuple[float, float]
    tilt_gain: float


def preferred_tilts(craft: Craft) -> Floats:
    """The gait's angles or level ones, whichever are farther from singular, rad, shape (M,)."""
    if not craft.commanded:
        return craft.tilts

    def margin(tilts: Floats) -> float:
        scale = np.repeat([1.0, 1.0 / float(craft.levers.mean())], 3)[:, np.newaxis]
        rows = scale * craft.wrench(tilts)
        sizes = [np.linalg.svd(part, compute_uv=False)[-1] for part in (rows, rows[2:])]
        return float((sizes[0] if len(craft.thrust) >= 6 else 0.0) + 1e-3 * sizes[1])

    return max((craft.tilts, np.zeros(len(craft.tilts))), key=margin)


def side_slope(craft: Craft, rows: Floats) -> float:
    """Side force per lift that level hover has in every direction within the limits.

    Args:
        craft: The vehicle.
        rows: Force and torque per newton, shape (6, N).
    """
    if craft.moving:
        return 0.0
    if craft.commanded:
        return 0.5 if craft.outputs(craft.tilts) == 6 else 0.0
    weight = craft.mass * craft.gravity
    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    sides = [np.array([np.cos(angle), np.sin(angle), 0.0]) for angle in angles]
    most = np.minimum(SIDE_SHARE * craft.limits[1], 2.4 * craft.hover)
    return 0.8 * least_force(craft, rows, sides, weight, most) / weight


def pose_cone(craft: Craft, rows: Floats, slope: float) -> float:
    """Angle (rad) from level of the poses that side force holds; pi where all are held.

    Args:
        craft: The vehicle.
        rows: Force and torque per newton, shape (6, N).
        slope: Result of `side_slope`.
    """
    weight, most = craft.mass * craft.gravity, SIDE_SHARE * craft.limits[1]
    ways = [np.array(way) for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)]
    units = [way / np.linalg.norm(way) for way in ways]
    holds_all = slope > 0.0 and not craft.commanded
    if holds_all and least_force(craft, rows, units, 0.0, most) > weight:
        return pi
    return atan(slope)


def least_force(
    craft: Craft, rows: Floats, ways: Sequence[Floats], lift: float, most: Floats
) -> float:
    """The least over some directions of the greatest force (N) without torque; 0 for none.

    Args:
        craft: The vehicle.
        rows: Force and torque per newton, shape (6, N).
        ways: Unit vectors of the directions, body axes.
        lift: N, that the rotors make as well, along z.
        most: Greatest thrusts, N, shape (N,).
    """
    from scipy.optimize import linprog  # a third of a second to import

    if np.linalg.matrix_rank(rows, tol=1e-6) < 6:
        return 0.0
    bounds = [*zip(craft.limits[0], most, strict=True), (0, None)]
    forces = []
    for way in ways:
        found = linprog(
            np.array([*np.zeros(len(most)), -1.0]),
            A_eq=np.column_stack([rows, [*-way, 0.0, 0.0, 0.0]]),
            b_eq=lift * np.eye(6)[2],
            bounds=bounds,
        )
        forces.append(-float(found.fun) if found.status == 0 else 0.0)
    return min(forces)


def free_axis(rows: Floats) -> Floats:
    """Unit axis of the force of the least thrusts that lift without torque, shape (3,)."""
    up, torque = rows[2], rows[3:]
    free = up - np.linalg.pinv(torque, rcond=1e-9) @ (torque @ up)
    force = rows[:3] @ free
    size = float(np.linalg.norm(force))
    return force / size if size > 1e-9 else np.array([0.0, 0.0, 1.0])


def _servo_step(servo: tuple[float, float], period: float) -> tuple[Values, Values]:
    """Angle and rate of a servo after a period, per angle, rate and set point."""
    from scipy.linalg import expm  # a quarter of a second to import

    w, z = servo
    system = np.array([[0.0, 1.0, 0.0], [-w * w, -2.0 * z * w, w * w], [0.0, 0.0, 0.0]])
    angle, rate, _ = map(tuple, expm(system * period).tolist())
    return angle, rate


def _rotor_step(timing: Timing, lag: float) -> dict[str, float]:
    """Shares of speeds and commands in the speeds after a period of commands that ramp."""
    h = timing.period
    if lag == 0.0:
        return {"keep": 0.0, "old": 0.0, "new": 1.0, "begun": 1.0, "gone": 1.0, "reads": 1.0}
    keep = exp(-h / lag)
    mean = lag / h * (1.0 - keep)
    begun = 1.0 - exp(-0.5 * h / lag) if timing.sampled else 0.0
    gone = 1.0 - keep
    return {
        "keep": keep,
        "old": mean - keep,
        "new": 1.0 - mean,
        "begun": begun,
        "gone": gone,
        "reads": 0.0,
    }


def _authority(craft: Craft, rows: Floats, tilts: Floats) -> tuple[float, float]:
    """Angular accelerations (rad/s^2) about x and y, and about z, that hover leaves.

    By the thrusts; about an axis that only tilts turn, by these.
    """
    low, high = craft.limits
    room = np.maximum(np.minimum(high - craft.hover, craft.hover - low), 0.05 * craft.hover)
    turn = np.abs(rows[3:]) @ room / np.diag(craft.inertia)
    if craft.commanded:
        rotors = rotors_in(craft.table, 0, tilt_of_rotor(craft.table))
        slopes = np.abs(by_tilt(rotors, wrench_slope(rotors, tilts)))[3:]
        turning = SERVO_ANGLE * craft.hover * slopes.sum(axis=1) / np.diag(craft.inertia)
        turn = np.where(turn < 0.1 * turn.max(), np.maximum(turn, turning), turn)
    return min(500.0, float(turn[:2].min())), min(350.0, float(turn[2]))


def _observers(factor: float, bandwidths: Values, period: float) -> dict[str, Any]:
    """Gains of the observers, which have double poles; without them all measurements are taken.

    Args:
        factor: Multiplies the bandwidths; 0 for no observers.
        bandwidths: The observers' of force and torque, and the bandwidth of yaw, 1/s.
        period: s, between calls.
    """
    if factor == 0.0:
        trusts = dict.fromkeys(("position_trust", "velocity_trust", "attitude_trust"), 1.0)
        return {**trusts, "rate_trust": (1.0,) * 3, "force_gain": 0.0, "torque_gain": (0.0,) * 3}
    force, torque, yaw = (2.0 * factor * bandwidth * period for bandwidth in bandwidths)
    turning = torque, torque, min(torque, 2.0 * yaw)
    return {
        "position_trust": 1.0 - exp(-force),
        "velocity_trust": 1.0 - exp(-2.0 * force),
        "attitude_trust": 1.0 - exp(-torque),
        "rate_trust": tuple(1.0 - exp(-2.0 * pole) for pole in turning),
        "force_gain": (1.0 - exp(-force)) ** 2 / period,
        "torque_gain": tuple((1.0 - exp(-pole)) ** 2 / period for pole in turning),
    }


def design(
    keys: Vectoring, craft: Craft, timing: Timing, failure: Failure
) -> tuple[Parameters, Values]:
    """Parameters of the law, and its table.

    Args:
        keys: Keys of the law.
        craft, timing: The vehicle and the loop.
        failure: A rotor that is known to have failed, and since when.
    """
    h, preferred = timing.period, preferred_tilts(craft)
    rows = craft.wrench(preferred)
    works = np.arange(1, len(craft.thrust) + 1) != failure.rotor
    high = craft.limits[1]
    lag = timing.lag if keys.lag_model else 0.0
    slope = side_slope(craft, rows)
    angular, yaw_angular = _authority(craft, rows, preferred)
    greatest = float(high.sum()) / craft.mass
    lift = max(0.0, (greatest / craft.gravity) ** 2 - 1.0) ** 0.5
    tracking = min(TRACKING, keys.lead / lag) if lag else TRACKING
    latency = timing.latency * h
    sample = h * timing.sampled
    # The prediction removes most of the delay; its error grows with the delay.
    left = 1.0 / tracking + (0.6 * sample + 0.25 * latency if keys.prediction else sample + latency)
    attitude = keys.attitude_bandwidth or min(
        FASTEST[0], DELAY_MARGIN / left, (angular / ERROR) ** 0.5
    )
    position = keys.position_bandwidth or min(FASTEST[2], POSITION_SHARE * attitude)
    delay = 1.5 * sample + 1.0 / tracking + latency
    yaw = min(FASTEST[1], attitude, (yaw_angular / ERROR) ** 0.5)
    servo_angle, servo_rate = _servo_step(timing.servo, h)
    parameters = Parameters(
        period=h,
        late=(1.5 * h if lag else h) if timing.sampled else 0.0,
        **_rotor_step(timing, lag),
        predicts=float(keys.prediction),
        bounded=float(keys.bounded),
        position=position,
        damping=1.0,
        acceleration=min(20.0, 0.45 * craft.gravity * lift),
        descent=6.0,
        greatest=TOTAL_SHARE * greatest,
        lean_time=1.5 / attitude if slope < 1.0 else 0.0,
        attitude=attitude,
        attitude_damping=0.9,
        yaw=yaw,
        angular=angular,
        yaw_angular=yaw_angular,
        reversal=lag + h if lag else 0.0,
        share=1.0 - exp(-tracking * h),
        **_observers(keys.observer, (2.5 * position, min(TORQUE_OBSERVER, 0.5 / delay), yaw), h),
        slope=slope,
        cone=pose_cone(craft, rows, slope),
        hover=craft.hover,
        lever=max(0.02, float(craft.levers.mean())),
        axis=tuple(free_axis(rows).tolist()),
        axis_after=tuple(free_axis(rows * works).tolist()),
        failure=failure,
        side_softness=3e-4 if len(craft.thrust) >= 6 else 1.0,
        pull=min(1.0, keys.restoring * h),
        tilt_step=min(keys.max_tilt_rate, timing.servo_limits[0]) * h,
        tilt_range=keys.max_tilt,
        tilt_stop=min(MOST_TILT, timing.servo_limits[1]),
        tilt_gain=timing.tilt_gain,
        servo_angle=servo_angle,
        servo_rate=servo_rate,
        servo_lead=2.0 * timing.servo[1] / timing.servo[0],
        patience=5.0 / timing.servo[0] + 3.0 * h,
    )
    numbers: list[Any] = [craft.thrust, craft.slowest, craft.fastest]
    if craft.commanded:
        numbers.append(preferred)
    return parameters, tuple(float(value) for part in numbers for value in part)
