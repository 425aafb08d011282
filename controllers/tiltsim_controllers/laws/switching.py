"""Switching between yaw-position and attitude-altitude control of the quadrotor (ch. 2, Sec. 5).

Ch. 2 considers its determinant surface singular near level attitude and switches to the
attitude-altitude controller there. The choice is a function of the attitude only, without memory.

Only the yaw-position controller has states, the thrust ``zeta`` and its rate ``xi``. The
chapter does not state how they evolve while the other controller is active: under the inactive
yaw-position controller (``running``), constant (``held``), or ``bumpless``. These follow the thrust
and thrust rate of the attitude-altitude controller, so that both are continuous when the
yaw-position controller takes over again.
"""

from typing import Any, ClassVar, Final, Literal

from pydantic import ConfigDict

import tiltsim_controllers.laws.quadrotor_attitude_altitude as attitude_altitude
import tiltsim_controllers.laws.yaw_position as yaw_position
from tiltsim_controllers.code.arrays import branch, xp
from tiltsim_controllers.gaits.motion import NO_KNOTS
from tiltsim_controllers.laws.keys import (
    Gains2,
    GainSets,
    Keys,
    Positive,
    choice,
    default,
    record_of,
    required,
)
from tiltsim_controllers.laws.quadrotor_attitude_altitude import (
    QuadrotorAttitudeGains,
    attitude_altitude_inputs,
)
from tiltsim_controllers.laws.yaw_position import (
    YAW_POSITION_GAINS,
    YawPositionGains,
    yaw_position_inputs,
)
from tiltsim_controllers.mathematics.attitude import euler_rates
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion
from tiltsim_controllers.vehicle.parameters import Vehicle

PUBLISHED_ROLL: Final = (-1.5707963267948966, 0.2)
"""rad: Eq. (47); its lower bound, -pi/2, is the edge of the attitudes that ch. 2 considers."""

PUBLISHED_PITCH: Final = (-0.5, 0.5)
"""rad: Eq. (47) with z up; the interval is symmetric."""


class ZoneTable(Keys):
    """Attitudes at which attitude-altitude control is active, edges included; Eq. (47)."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"roll": [-1.57, 0.2]}]})

    roll: Gains2 = default(PUBLISHED_ROLL, "smallest and largest roll [rad]", [-1.57, 0.2])
    pitch: Gains2 = default(PUBLISHED_PITCH, "smallest and largest pitch [rad]")


PUBLISHED_ZONE: Final = ZoneTable()


class Switching(Keys):
    """Keys of `switching_inputs`."""

    gain_sets: ClassVar[GainSets] = {
        "gains": yaw_position.GAIN_SETS,
        "attitude_gains": attitude_altitude.GAIN_SETS,
    }

    law: Literal["switching"] = required(
        "yaw_position, and quadrotor_attitude_altitude while the attitude is in a zone"
    )
    gains: YawPositionGains = default("stable", f"of the yaw-position law: {YAW_POSITION_GAINS}")
    attitude_gains: QuadrotorAttitudeGains = default(
        "ch02", "of the attitude-altitude law: the thesis's set, or a table of gains"
    )
    zone: ZoneTable = default(
        ZoneTable(), "the attitudes at which the attitude-altitude law is active"
    )
    extension: Literal["bumpless", "held", "running"] = default(
        "bumpless",
        "the yaw-position law's own states, thrust and its rate, while the other law is active: "
        "bumpless follows the actual thrust, held stops them, running goes on",
    )
    extension_rate: Positive = default(
        100.0, "rate at which bumpless states converge to the actual thrust [1/s]"
    )


Parameters = record_of(Switching, vehicle=Vehicle, reference=ReferenceParameters)

BUMPLESS: Final = choice(Switching, "extension", "bumpless")
RUNNING: Final = choice(Switching, "extension", "running")


def in_attitude_zone(roll: Any, pitch: Any, zone: Any) -> Any:
    """Whether the attitude-altitude controller is active at an attitude (rad; ch. 2, Eq. 47)."""
    (roll_min, roll_max), (pitch_min, pitch_max) = zone.roll, zone.pitch
    rolled = (roll_min <= roll) & (roll <= roll_max)
    return rolled & (pitch_min <= pitch) & (pitch <= pitch_max)


def attitude_altitude_thrust_rate(
    time: Any, state: Any, thrust: Any, p: Any, knots: Any = NO_KNOTS
) -> Any:
    """Rate (N/s) of the attitude-altitude controller's thrust.

    Args:
        time: s
        state: Begins with `tiltsim_controllers.vehicle.body.BODY_FIELDS`, shape (12,).
        thrust: N
        p: `Parameters`.
        knots: Table data of the reference.
    """
    attitude, vz = state[6:9], state[5]
    vehicle, motion = p.vehicle, reference_motion(time, p.reference, knots)
    upright = xp.cos(attitude[0]) * xp.cos(attitude[1])
    upright = xp.where(upright == 0.0, xp.nan, upright)
    az = thrust * upright / vehicle.mass - vehicle.gravity
    k1, k2 = p.attitude_gains.altitude
    lift_rate = k1 * (motion[2, 2] - az) + k2 * (motion[1, 2] - vz)
    leaning = xp.tan(attitude[:2]) @ euler_rates(attitude, state[9:12])[:2]
    return vehicle.mass * lift_rate / upright + thrust * leaning


def switching_inputs(time: Any, state: Any, p: Any, knots: Any = NO_KNOTS) -> Any:
    """Thrust (N), torques (N m) and rates of the extension's states, shape (6,).

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.body.EXTENDED_QUADROTOR_FIELDS`, shape (14,).
        p: `Parameters`.
        knots: Table data of the reference.
    """

    def outside() -> Any:
        return yaw_position_inputs(time, state, p, knots)

    def inside() -> Any:
        wrench = attitude_altitude_inputs(
            time, state, p.vehicle, p.attitude_gains, p.reference, knots
        )
        extension = xp.zeros(2)
        if p.extension == RUNNING:
            extension = outside()[4:]
        elif p.extension == BUMPLESS:
            thrust = wrench[0]
            thrust_rate = attitude_altitude_thrust_rate(time, state, thrust, p, knots)
            flown = xp.array([thrust, thrust_rate])
            follow = p.extension_rate * (flown - state[12:14])
            extension = xp.array([thrust_rate, 0.0]) + follow
        return xp.hstack([wrench, extension])

    return branch(in_attitude_zone(state[6], state[7], p.zone), inside, outside)
