"""Attitude-altitude feedback linearization of the quadrotor, second order (ch. 2, Appendix B).

Outputs are altitude, roll, pitch and yaw, inputs the total thrust and three torques. Ch. 2 switches
to this controller near the published singular curve: its decoupling matrix is singular only at a
roll or pitch of 90 degrees.
"""

from typing import Any, ClassVar, Final, Literal

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.gaits.motion import NO_KNOTS
from tiltsim_controllers.laws.keys import (
    Gains2,
    GainSets,
    Keys,
    NamedGains,
    default,
    record_of,
    required,
)
from tiltsim_controllers.laws.yaw_position import gyroscopic_acceleration, moments_of
from tiltsim_controllers.mathematics.attitude import euler_rates, wrapped
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion
from tiltsim_controllers.vehicle.parameters import Vehicle


class QuadrotorAttitudeGainTable(Keys):
    """Explicit gains of the quadrotor's attitude-altitude control."""

    altitude: Gains2 = required(
        "on the errors of vertical velocity and altitude [1/s, 1/s^2]", [10.0, 10.0]
    )
    attitude: Gains2 = required(
        "on the errors of the rates and of roll, pitch and yaw [1/s, 1/s^2]", [10.0, 10.0]
    )


Gains = record_of(QuadrotorAttitudeGainTable)

GAIN_SETS: Final = {"ch02": Gains((10.0, 10.0), (10.0, 10.0))}
"""Gains by name; ch. 2, Eqs. (A8)-(A9)."""

QuadrotorAttitudeGains = NamedGains[Literal["ch02"], QuadrotorAttitudeGainTable]


class QuadrotorAttitudeAltitude(Keys):
    """Keys of `attitude_altitude_inputs`."""

    gain_sets: ClassVar[GainSets] = {"gains": GAIN_SETS}

    law: Literal["quadrotor_attitude_altitude"] = required(
        "the quadrotor's thrust and three torques control attitude and altitude"
    )
    gains: QuadrotorAttitudeGains = default("ch02", "the thesis's set, or a table of gains")


Parameters = record_of(QuadrotorAttitudeAltitude, vehicle=Vehicle, reference=ReferenceParameters)


def attitude_altitude_inputs(
    time: Any,
    state: Any,
    vehicle: Vehicle,
    gains: Any,
    reference: ReferenceParameters,
    knots: Any = NO_KNOTS,
) -> Any:
    """Thrust (N) and the three torques (N m, body axes), shape (4,) (ch. 2, Eq. A7).

    NaN at a roll or pitch of 90 degrees.

    Args:
        time: s
        state: Begins with `tiltsim_controllers.vehicle.body.BODY_FIELDS`, shape (12,).
        vehicle, gains: The quadrotor and its gains.
        reference, knots: Altitude, roll, pitch and yaw, the angles constant.
    """
    z, vz, attitude, omega = state[2], state[5], state[6:9], state[9:12]
    (sin_roll, sin_pitch, _), (cos_roll, cos_pitch, _) = xp.sin(attitude), xp.cos(attitude)
    regular = (cos_roll != 0.0) & (cos_pitch != 0.0)
    upright = xp.where(regular, cos_roll * cos_pitch, xp.nan)
    (_, _, z_ref), (_, _, vz_ref) = reference_motion(time, reference, knots)[:2]
    k1, k2 = gains.altitude
    lift = vehicle.gravity + k1 * (vz_ref - vz) + k2 * (z_ref - z)

    # Eq. (A7), then Euler accelerations into body accelerations: omega = E(roll, pitch) euler',
    # omega' = E euler'' + E' euler'.
    rates = euler_rates(attitude, omega)
    desired = xp.array([reference.roll, reference.pitch, reference.yaw]) - attitude
    error = xp.array([desired[0], desired[1], wrapped(desired[2])])
    k1, k2 = gains.attitude
    roll, pitch, yaw = k2 * error - k1 * rates
    roll_rate, pitch_rate, yaw_rate = rates
    forward = cos_pitch * yaw - sin_pitch * pitch_rate * yaw_rate
    angular = xp.array(
        [
            roll - sin_pitch * yaw - cos_pitch * pitch_rate * yaw_rate,
            cos_roll * pitch + sin_roll * forward + roll_rate * omega[2],
            cos_roll * forward - sin_roll * pitch - roll_rate * omega[1],
        ]
    )
    torque = moments_of(vehicle) * (angular - gyroscopic_acceleration(omega, vehicle))
    return xp.hstack([vehicle.mass * lift / upright, torque + 0.0 * upright])
