"""Attitude-altitude feedback linearization of the quadrotor, second order (ch. 2, Appendix B).

Outputs are altitude, roll, pitch and yaw, inputs the total thrust and three torques. Ch. 2 switches
to this controller near the published singular curve: its decoupling matrix is singular only at a
roll or pitch of 90 degrees.
"""

from __future__ import annotations

from math import cos, nan, sin
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.laws.yaw_position import euler_rates, gyroscopic_acceleration
from tiltsim_controllers.mathematics.rotation import wrap_angle
from tiltsim_controllers.mathematics.scalar import Quad, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, position_reference
from tiltsim_controllers.vehicle.parameters import Vehicle


class Gains(NamedTuple):
    """Gains of the linearized system (ch. 2, Eqs. A7-A9)."""

    altitude_1: float  # [k_p1] 1/s, on the rate
    altitude_2: float  # [k_p2] 1/s^2, on the output
    attitude_1: float  # [k_p1] 1/s, roll, pitch and yaw alike
    attitude_2: float  # [k_p2] 1/s^2


GAIN_SETS: Final = {"ch02": Gains(10.0, 10.0, 10.0, 10.0)}
"""Gains by name; ch. 2, Eqs. (A8)-(A9)."""


@scalar
def attitude_altitude_inputs(
    time: float,
    state: Values,
    vehicle: Vehicle,
    gains: Gains,
    reference: ReferenceParameters,
    knots: Vector = NO_KNOTS,
) -> Quad:
    """Thrust (N) and the three torques (N m, body axes) (ch. 2, Eq. A7).

    NaN at a roll or pitch of 90 degrees.

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.states.BODY_FIELDS`; what follows is not read
        vehicle, gains: the quadrotor and its gains
        reference, knots: altitude, roll, pitch and yaw, the angles constant
    """
    _, _, z, _, _, vz, roll, pitch, yaw, p, q, r = state[:12]
    sin_roll, cos_roll = sin(roll), cos(roll)
    sin_pitch, cos_pitch = sin(pitch), cos(pitch)
    if cos_roll == 0.0 or cos_pitch == 0.0:
        return nan, nan, nan, nan
    _, _, z_ref, _, _, vz_ref, _, _, _ = position_reference(time, reference, knots)

    lift = vehicle.gravity + gains.altitude_1 * (vz_ref - vz) + gains.altitude_2 * (z_ref - z)
    thrust = vehicle.mass * lift / (cos_roll * cos_pitch)

    # Eq. (A7), then Euler accelerations into body accelerations: omega = E(roll, pitch) euler',
    # omega' = E euler'' + E' euler'.
    roll_rate, pitch_rate, yaw_rate = euler_rates(roll, pitch, p, q, r)
    k1, k2 = gains.attitude_1, gains.attitude_2
    roll_acceleration = k2 * (reference.roll - roll) - k1 * roll_rate
    pitch_acceleration = k2 * (reference.pitch - pitch) - k1 * pitch_rate
    yaw_acceleration = k2 * wrap_angle(reference.yaw - yaw) - k1 * yaw_rate
    forward = cos_pitch * yaw_acceleration - sin_pitch * pitch_rate * yaw_rate
    p_rate = roll_acceleration - sin_pitch * yaw_acceleration - cos_pitch * pitch_rate * yaw_rate
    q_rate = cos_roll * pitch_acceleration + sin_roll * forward + roll_rate * r
    r_rate = cos_roll * forward - sin_roll * pitch_acceleration - roll_rate * q

    p_drift, q_drift, r_drift = gyroscopic_acceleration(p, q, r, vehicle)
    return (
        thrust,
        vehicle.inertia_xx * (p_rate - p_drift),
        vehicle.inertia_yy * (q_rate - q_drift),
        vehicle.inertia_zz * (r_rate - r_drift),
    )
