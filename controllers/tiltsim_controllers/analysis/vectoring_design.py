"""Parameters of `vectoring` from a vehicle, its actuators and the times of the control loop.

Bandwidths come from the delay that no prediction removes, braking limits from the thrusts that the
limits leave, and the side force that needs no lean from a linear program.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan, exp, inf, pi
from typing import Any, Final

import numpy as np

from tiltsim_controllers.analysis.vectoring_limits import (
    Craft,
    authority,
    free_axis,
    pose_cone,
    preferred_tilts,
    side_slope,
    sideways_limit,
)
from tiltsim_controllers.laws.observed import Failure
from tiltsim_controllers.laws.vectoring import Vectoring
from tiltsim_controllers.laws.vectoring_state import Ability, Parameters
from tiltsim_controllers.mathematics.scalar import Values

TOTAL_SHARE: Final = 0.9
"""Share of the greatest thrusts that is demanded in all."""
DELAY_MARGIN: Final = 0.22
"""Attitude bandwidth times the delay that is left."""
SERVO_SHARE: Final = 1.6
"""The largest attitude bandwidth over the greatest rate of servos, which is not predicted."""
POSITION_SHARE: Final = 0.55
"""Bandwidth of the position across over the attitude's, ..."""
DAMPING: Final = 0.85
"""Damping ratio of the position across."""
SIDEWAYS_POSITION: Final = 0.5
"""... and where the push of torques limits attitude."""
ALWAYS_LEANS: Final = 1e-9
"""m: no way is short enough for side force alone to be faster."""
AGILE_POSITION: Final = 0.9
"""The largest one over the root of the angular acceleration."""
RISE: Final = 0.6, 1.4
"""Bandwidth of height over the attitude's, and damping ratio: no lean delays it."""
VERTICAL: Final = 4.5, 1.5
"""m/s^2: of the feedback of height, up and down; more would take torque or lean."""
ACROSS: Final = 0.33
"""Acceleration of the feedback across over the greatest that keeps the height."""
SPIN: Final = 0.8
"""Rate of the lean over the root of the angular acceleration that stops it."""
LEAN: Final = 1.5, 2.0
"""Time until a braking begins: over the attitude's, and over the root of lean by acceleration."""
SIDEWAYS_SHARE: Final = 0.9
"""Attitude bandwidth over `sideways_limit`."""
FASTEST: Final = (40.0, 23.0, 8.0, 16.0)
"""rad/s: attitude, yaw, position across and height without lag and latency."""
ERROR: Final = 0.1
"""rad: the error of attitude or yaw that demands all torque about its axis, or more."""
SIDE_OBSERVER: Final = 0.6
"""Bandwidth of the observer of side force over the position's."""
TORQUE_OBSERVER: Final = 40.0
"""1/s: the fastest observers of torque and of the excess of thrust."""
OBSERVER_DAMPING: Final = 0.5, 1.0
"""Damping ratios of the observers of force: with sensor noise, of which a larger one would pass
more, and without noise, where it steadies pushes along walls and loads on slack cables."""
ROUGHNESS: Final = 0.5, 1.4, 2.1
"""How far a disturbance walks in a second: side force and thrust (m/s^2), torque (rad/s^2)."""
TRACKING: Final = 250.0
"""1/s: how fast the wrench follows its demand where rotors have no lag."""
REACH: Final = 10.0
"""Greatest thrust over hover thrust where nothing else limits it."""
MOST_TILT: Final = 3.1
"""rad: commanded tilts stay below half a turn."""


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
        noise: Deviations of velocities (m/s) and body rates (rad/s), in the mean of a second.
    """

    period: float
    sampled: bool
    latency: int
    lag: float
    servo: tuple[float, float]
    servo_limits: tuple[float, float]
    tilt_gain: float
    noise: tuple[float, float]


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


def _observers(
    factor: float, bandwidths: Values, noise: tuple[float, float], period: float
) -> dict[str, Any]:
    """Gains of the observers; without them all measurements are taken.

    Args:
        factor: Multiplies the bandwidths; 0 for no observers.
        bandwidths: Estimates of side force, thrust and torque follow at these; last, yaw's, 1/s.
        noise: See `Timing`.
        period: s, between calls.
    """
    if factor == 0.0:
        trusts = dict.fromkeys(("position_trust", "velocity_trust", "rate_trust"), (1.0,) * 3)
        none = {"force_gain": 0.0, "excess_gain": 0.0, "torque_gain": (0.0,) * 3}
        return {**trusts, "attitude_trust": 1.0, **none}

    def steps(fastest: float, roughness: float, noise: float) -> float:
        # The best estimate of a disturbance that walks has this natural frequency.
        best = (roughness / noise) ** 0.5 if noise > 0.0 else inf
        return factor * min(2.0 * fastest, best) * period

    noises = noise[0], noise[0], noise[1]
    side, rise, torque = map(steps, bandwidths, ROUGHNESS, noises)
    turning = torque, torque, min(torque, 4.0 * factor * bandwidths[3] * period)
    damping = OBSERVER_DAMPING[noise[0] == 0.0]
    pushes = [_correction(pole, damping) for pole in (side, side, rise)]
    turns = [_correction(pole, 1.0) for pole in turning]
    return {
        "position_trust": (1.0 - exp(-side), 1.0 - exp(-side), 1.0 - exp(-rise)),
        "velocity_trust": tuple(trust for trust, _ in pushes),
        "attitude_trust": 1.0 - exp(-torque),
        "rate_trust": tuple(trust for trust, _ in turns),
        "force_gain": pushes[0][1] / period,
        "excess_gain": pushes[2][1] / period,
        "torque_gain": tuple(gain / period for _, gain in turns),
    }


def _correction(pole: float, damping: float) -> tuple[float, float]:
    """Shares of its error by which a call corrects a speed, and its change in a period."""
    root = np.exp(pole * complex(-damping, (1.0 - damping**2) ** 0.5))
    trust = 2.0 - 2.0 * float(root.real)
    return trust, float(abs(root)) ** 2 - 1.0 + trust


def _feedback_push(craft: Craft) -> float:
    """Largest acceleration of the feedback across, m/s^2."""
    greatest = float(craft.limits[1].sum()) / craft.mass / craft.gravity
    return min(20.0, ACROSS * craft.gravity * max(0.0, greatest**2 - 1.0) ** 0.5)


def ability(keys: Vectoring, craft: Craft, left: float, *, harmed: bool = False) -> Ability:
    """Abilities of a vehicle, with all its rotors or without one.

    Args:
        keys: Keys of the law.
        craft: The vehicle.
        left: s, the delay that no prediction removes.
        harmed: Whether it has lost a rotor.
    """
    preferred = preferred_tilts(craft)
    rows = craft.wrench(preferred)
    slope, (angular, yaw_angular) = side_slope(craft), authority(craft, rows, preferred)
    fastest, share = min(FASTEST[0], DELAY_MARGIN / left, (angular / ERROR) ** 0.5), POSITION_SHARE
    if harmed and slope == 0.0:
        sideways = SIDEWAYS_SHARE * sideways_limit(craft, rows)
        if sideways < fastest:
            fastest, share = sideways, SIDEWAYS_POSITION
    attitude, given = keys.attitude_bandwidth or fastest, keys.position_bandwidth
    cone, sizes = pose_cone(craft, rows, slope), np.square(rows[3:]).sum(axis=1)
    yaw_size = float(2.0 * sizes[2] / sizes[:2].sum())
    most = direct = _feedback_push(craft)
    lean = atan(0.6 * most / craft.gravity)
    lean_time = LEAN[0] / attitude + LEAN[1] * (lean / angular) ** 0.5
    across, near = min(FASTEST[2], share * attitude, AGILE_POSITION * angular**0.5), ALWAYS_LEANS
    if cone == pi and (side := slope * craft.gravity) < most:
        # A lean pays once it shortens a way from rest to rest by more than the time that it takes.
        across, direct = RISE[0] * attitude, side
        near = (lean_time / (2.0 * (side**-0.5 - most**-0.5))) ** 2
    return Ability(
        axis=tuple(free_axis(rows).tolist()),
        slope=slope,
        cone=cone,
        position=given or across,
        rise=RISE[0] * (given / POSITION_SHARE if given else min(FASTEST[3] / RISE[0], attitude)),
        direct=direct,
        near=near,
        lean_time=lean_time,
        attitude=attitude,
        yaw=min(FASTEST[1], attitude, (yaw_angular / ERROR) ** 0.5),
        angular=angular,
        spin=SPIN * angular**0.5,
        yaw_angular=yaw_angular,
        side_softness=3e-4 if craft.works.sum() >= 6 else 1.0,
        # A vehicle that leans to move must lean first; one that holds every pose need not, and one
        # without a rotor would lose its height.
        lean_softness=1e-11 if cone == pi or (harmed and not craft.commanded) else 1e-13,
        # The tilts have made the torque that they can; a harmed vehicle has little of it to give.
        yaw_softness=1e-4 if craft.commanded or harmed else 1e-11 * yaw_size,
    )


def design(
    keys: Vectoring, craft: Craft, timing: Timing, failure: Failure
) -> tuple[Parameters, Values]:
    """Parameters of the law, and its table.

    Args:
        keys: Keys of the law.
        craft, timing: The vehicle and the loop.
        failure: A rotor that is known to have failed, and since when.
    """
    h = timing.period
    high = craft.limits[1]
    lag = timing.lag if keys.lag_model else 0.0
    greatest = float(high.sum()) / craft.mass
    tracking = min(TRACKING, keys.lead / lag) if lag else TRACKING
    latency = timing.latency * h
    sample = h * timing.sampled
    # The prediction removes most of the delay; its error grows with the delay.
    left = 1.0 / tracking + (0.6 * sample + 0.25 * latency if keys.prediction else sample + latency)
    if craft.commanded:
        left = max(left, DELAY_MARGIN / (SERVO_SHARE * timing.servo_limits[0]))
    delay = 1.5 * sample + 1.0 / tracking + latency
    works = 1.0 * (np.arange(1, len(craft.thrust) + 1) != failure.rotor)
    able = ability(keys, craft, left)
    after = ability(keys, replace(craft, works=works), left, harmed=True) if failure.rotor else able
    fast = min(TORQUE_OBSERVER, 0.5 / delay)
    following = (SIDE_OBSERVER * fast, fast, fast, able.yaw)
    servo_angle, servo_rate = _servo_step(timing.servo, h)
    parameters = Parameters(
        period=h,
        late=(1.5 * h if lag else h) if timing.sampled else 0.0,
        **_rotor_step(timing, lag),
        predicts=float(keys.prediction),
        bounded=float(keys.bounded),
        **able._asdict(),
        damping=DAMPING,
        rise_damping=RISE[1],
        acceleration=_feedback_push(craft),
        ascent=VERTICAL[0],
        descent=VERTICAL[1],
        greatest=TOTAL_SHARE * greatest,
        attitude_damping=0.9,
        reversal=lag + h if lag else 0.0,
        share=1.0 - exp(-tracking * h),
        **_observers(keys.observer, following, timing.noise, h),
        hover=craft.hover,
        lever=max(0.02, float(craft.levers.mean())),
        failure=failure,
        after=after,
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
        numbers.append(preferred_tilts(craft))
    return parameters, tuple(float(value) for part in numbers for value in part)
