"""Yaw-position feedback linearization of the quadrotor with dynamic extension (ch. 2).

Outputs are the position and yaw; inputs the total thrust, twice integrated, and three torques.
Thrust does not reach the attitude and torque not the position's second derivative, so the law
treats the thrust ``zeta`` and its rate ``xi`` as states of its own and differentiates the position
four times (Eqs. 1-28).

The thrust pulls against the body's third axis ``b = R e3``. Its derivatives, ``b' = R (omega x
e3)`` and ``b'' = R (omega x (omega x e3) + omega' x e3)``, give the decoupling matrix in closed
form; its determinant is in `tiltsim_controllers.analysis.quadrotor_singularity`. Inside this module
the axes are ch. 2's, z down; `yaw_position_inputs` takes and returns ours.
"""

from __future__ import annotations

from math import cos, nan, sin
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.mathematics.rotation import rotation_from_euler, wrap_angle
from tiltsim_controllers.mathematics.scalar import Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.z_down import (
    flip_attitude,
    flip_state,
    flip_vector,
)
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.vehicle.parameters import Vehicle

Inputs = tuple[float, float, float, float, float, float]

STATE_FIELDS: Final = (
    *("x", "y", "z", "vx", "vy", "vz"),  # 0-5: m and m/s
    *("roll", "pitch", "yaw", "p", "q", "r"),  # 6-11: rad; body rates, rad/s
    *("thrust", "thrust_rate"),  # 12-13: [zeta] N and [xi] N/s, states of the law
)
"""The state of the quadrotor and of the law's extension: one float per name, in this order."""

INPUT_FIELDS: Final = (
    *("thrust", "roll_torque", "pitch_torque", "yaw_torque"),  # N; N m, body axes, to the vehicle
    *("thrust_derivative", "thrust_rate_derivative"),  # N/s, N/s^2: of the law's own two states
)
"""What the laws of the quadrotor return: one float per name, in this order."""


class Gains(NamedTuple):
    """Gains of the linearized system (ch. 2, Eqs. A2-A6), ``1`` on the highest derivative."""

    position_1: float  # [k_1] 1/s, jerk
    position_2: float  # [k_2] 1/s^2, acceleration
    position_3: float  # [k_3] 1/s^3, velocity
    position_4: float  # [k_4] 1/s^4, position
    yaw_1: float  # 1/s, yaw rate, the last entry of k_3
    yaw_2: float  # 1/s^2, yaw, the last entry of k_4


class Parameters(NamedTuple):
    """All that the law needs to know besides time and state."""

    vehicle: Vehicle
    gains: Gains
    reference: ReferenceParameters


GAIN_SETS: Final = {
    # Appendix B. The position loop s^4 + 10 s^3 + 20 s^2 + 50 s + 500 is unstable by itself.
    "ch02": Gains(10.0, 20.0, 50.0, 500.0, 5.0, 5.0),
    # Ours: the same k_1, all four poles of the position loop at -2.5.
    "stable": Gains(10.0, 37.5, 62.5, 39.0625, 5.0, 5.0),
}
"""Gains by name."""


@scalar
def euler_rates(roll: float, pitch: float, p: float, q: float, r: float) -> Triple:
    """Rates (rad/s) of roll, pitch and yaw from the body rates (ch. 2, Eq. 15, rows 4-6)."""
    sin_roll, cos_roll, cos_pitch = sin(roll), cos(roll), cos(pitch)
    if cos_pitch == 0.0:
        return nan, nan, nan
    yaw_rate = (sin_roll * q + cos_roll * r) / cos_pitch
    return p + sin(pitch) * yaw_rate, cos_roll * q - sin_roll * r, yaw_rate


@scalar
def gyroscopic_acceleration(p: float, q: float, r: float, vehicle: Vehicle) -> Triple:
    """Angular acceleration (rad/s^2) without torque (ch. 2, Eq. 15, last three rows)."""
    ix, iy, iz = vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz
    return (iy - iz) / ix * q * r, (iz - ix) / iy * p * r, (ix - iy) / iz * p * q


@scalar
def acceleration_and_jerk(z_down: Values, vehicle: Vehicle) -> Values:
    """Second and third derivative of the position (ch. 2, Eqs. 15-18 and 24), three floats each."""
    p, q, thrust, thrust_rate = z_down[9], z_down[10], z_down[12], z_down[13]
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_from_euler(
        z_down[6], z_down[7], z_down[8]
    )
    mass = vehicle.mass
    return (
        -thrust * r13 / mass,
        -thrust * r23 / mass,
        vehicle.gravity - thrust * r33 / mass,
        -(thrust_rate * r13 + thrust * (r11 * q - r12 * p)) / mass,
        -(thrust_rate * r23 + thrust * (r21 * q - r22 * p)) / mass,
        -(thrust_rate * r33 + thrust * (r31 * q - r32 * p)) / mass,
    )


@scalar
def drift(z_down: Values, vehicle: Vehicle) -> Quad:
    """``Ma`` of ch. 2, Eq. (20): what the outputs' derivatives are at zero input.

    Returns the fourth derivative of the position (m/s^4) and the second of yaw (rad/s^2).
    """
    roll, pitch, yaw, p, q, r, thrust, thrust_rate = z_down[6:14]
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_from_euler(roll, pitch, yaw)
    roll_rate, pitch_rate, yaw_rate = euler_rates(roll, pitch, p, q, r)
    p_drift, q_drift, r_drift = gyroscopic_acceleration(p, q, r, vehicle)
    # zeta (omega x (omega x e3) + omega' x e3) + 2 xi (omega x e3), body axes.
    bx = thrust * (p * r + q_drift) + 2.0 * thrust_rate * q
    by = thrust * (q * r - p_drift) - 2.0 * thrust_rate * p
    bz = -thrust * (p * p + q * q)
    cos_pitch = cos(pitch)
    yaw_drift = nan
    if cos_pitch != 0.0:
        yaw_drift = (
            pitch_rate * (roll_rate + sin(pitch) * yaw_rate)
            + sin(roll) * q_drift
            + cos(roll) * r_drift
        ) / cos_pitch
    mass = vehicle.mass
    return (
        -(r11 * bx + r12 * by + r13 * bz) / mass,
        -(r21 * bx + r22 * by + r23 * bz) / mass,
        -(r31 * bx + r32 * by + r33 * bz) / mass,
        yaw_drift,
    )


@scalar
def decoupling_matrix(z_down: Values, vehicle: Vehicle) -> Values:
    """``Delta`` of ch. 2, Eqs. (20) and (42), rows first; NaN at a pitch of 90 degrees.

    Yaw torque does not turn the thrust, so the upper three entries of the last column are zero;
    the printed ones are not, for slips in Eqs. (31) and (36): ``s_theta s_phi`` should read
    ``s_theta c_phi``.
    """
    roll, pitch, yaw, thrust = z_down[6], z_down[7], z_down[8], z_down[12]
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_from_euler(roll, pitch, yaw)
    mass, arm = vehicle.mass, vehicle.arm_length
    by_roll = thrust * arm / (mass * vehicle.inertia_xx)
    by_pitch = -thrust * arm / (mass * vehicle.inertia_yy)
    cos_pitch = cos(pitch)
    yaw_by_pitch, yaw_by_yaw = nan, nan
    if cos_pitch != 0.0:
        yaw_by_pitch = sin(roll) / cos_pitch * arm / vehicle.inertia_yy
        yaw_by_yaw = cos(roll) / cos_pitch * arm / vehicle.inertia_zz
    return (
        *(-r13 / mass, by_roll * r12, by_pitch * r11, 0.0),
        *(-r23 / mass, by_roll * r22, by_pitch * r21, 0.0),
        *(-r33 / mass, by_roll * r32, by_pitch * r31, 0.0),
        *(0.0, 0.0, yaw_by_pitch, yaw_by_yaw),
    )


@scalar
def solve_decoupling(z_down: Values, vehicle: Vehicle, wanted: Quad) -> Quad:
    """The inputs ``u`` with ``Delta u = wanted`` (Eq. A1), NaN where ``Delta`` is singular.

    Seen from the body, ``Delta`` is triangular: along the thrust acts ``u_1`` alone, across it
    ``u_2`` and ``u_3``, and ``u_4`` corrects the yaw. It is singular at zero thrust, and at a roll
    or pitch of 90 degrees.
    """
    roll, pitch, yaw, thrust = z_down[6], z_down[7], z_down[8], z_down[12]
    cos_roll, cos_pitch = cos(roll), cos(pitch)
    if thrust == 0.0 or cos_roll == 0.0 or cos_pitch == 0.0:
        return nan, nan, nan, nan
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_from_euler(roll, pitch, yaw)
    x, y, z, yaw_acceleration = wanted
    bx = r11 * x + r21 * y + r31 * z
    by = r12 * x + r22 * y + r32 * z
    bz = r13 * x + r23 * y + r33 * z
    p_rate = vehicle.mass * by / thrust
    q_rate = -vehicle.mass * bx / thrust
    r_rate = (cos_pitch * yaw_acceleration - sin(roll) * q_rate) / cos_roll
    arm = vehicle.arm_length
    return (
        -vehicle.mass * bz,
        p_rate * vehicle.inertia_xx / arm,
        q_rate * vehicle.inertia_yy / arm,
        r_rate * vehicle.inertia_zz / arm,
    )


@scalar
def wanted_derivatives(
    time: float, z_down: Values, parameters: Parameters, knots: Vector = NO_KNOTS
) -> Quad:
    """The fourth derivative of the position and the second of yaw to ask for (Eqs. A2-A6)."""
    x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, _, _ = z_down
    gains = parameters.gains
    k1, k2, k3, k4 = gains.position_1, gains.position_2, gains.position_3, gains.position_4
    ax, ay, az, jx, jy, jz = acceleration_and_jerk(z_down, parameters.vehicle)
    reference = reference_derivatives(time, parameters.reference, knots)
    x_ref, y_ref, z_ref = flip_vector(reference[0], reference[1], reference[2])
    vx_ref, vy_ref, vz_ref = flip_vector(reference[3], reference[4], reference[5])
    ax_ref, ay_ref, az_ref = flip_vector(reference[6], reference[7], reference[8])
    jx_ref, jy_ref, jz_ref = flip_vector(reference[9], reference[10], reference[11])
    sx_ref, sy_ref, sz_ref = flip_vector(reference[12], reference[13], reference[14])
    _, _, yaw_ref = flip_attitude(0.0, 0.0, parameters.reference.yaw)
    _, _, yaw_rate = euler_rates(roll, pitch, p, q, r)
    return (
        sx_ref + k1 * (jx_ref - jx) + k2 * (ax_ref - ax) + k3 * (vx_ref - vx) + k4 * (x_ref - x),
        sy_ref + k1 * (jy_ref - jy) + k2 * (ay_ref - ay) + k3 * (vy_ref - vy) + k4 * (y_ref - y),
        sz_ref + k1 * (jz_ref - jz) + k2 * (az_ref - az) + k3 * (vz_ref - vz) + k4 * (z_ref - z),
        gains.yaw_2 * wrap_angle(yaw_ref - yaw) - gains.yaw_1 * yaw_rate,
    )


@scalar
def yaw_position_inputs(
    time: float, state: Values, parameters: Parameters, knots: Vector = NO_KNOTS
) -> Inputs:
    """Thrust, torques and the rates of the law's own states (`INPUT_FIELDS`), world z up.

    The inputs of ch. 2, Eqs. (1)-(8), with ``u_2`` to ``u_4`` turned from forces at the arms into
    torques. NaN where the decoupling matrix is singular.
    """
    z_down = flip_state(state)
    vehicle = parameters.vehicle
    sx, sy, sz, yaw_acceleration = wanted_derivatives(time, z_down, parameters, knots)
    drift_x, drift_y, drift_z, drift_yaw = drift(z_down, vehicle)
    wanted = (sx - drift_x, sy - drift_y, sz - drift_z, yaw_acceleration - drift_yaw)
    u1, u2, u3, u4 = solve_decoupling(z_down, vehicle, wanted)
    arm = vehicle.arm_length
    roll_torque, pitch_torque, yaw_torque = flip_vector(arm * u2, arm * u3, arm * u4)
    return state[12], roll_torque, pitch_torque, yaw_torque, state[13], u1
