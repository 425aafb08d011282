"""Yaw-position feedback linearization of the quadrotor with dynamic extension (ch. 2).

Outputs are the position and yaw; inputs the total thrust, twice integrated, and three torques.
Thrust does not affect the attitude, and torque does not affect the position's second derivative, so
the controller treats the thrust ``zeta`` and its rate ``xi`` as its own states and differentiates
the position four times (Eqs. 1-28).

The thrust acts against the body's third axis ``b = R e3``. Its derivatives, ``b' = R (omega x
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
from tiltsim_controllers.mathematics.z_down import flip_attitude, flip_state, flip_vector
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.states import PITCH, ROLL, THRUST, THRUST_RATE, YAW

Inputs = tuple[float, float, float, float, float, float]

INPUT_FIELDS: Final = (
    "thrust",  # N
    "roll_torque",  # N m, body axes
    "pitch_torque",
    "yaw_torque",
    "thrust_derivative",  # N/s, of the controller's own two states
    "thrust_rate_derivative",  # N/s^2
)
"""The result of the quadrotor's control laws: one float per name, in this order."""


class Gains(NamedTuple):
    """Gains of the linearized system (ch. 2, Eqs. A2-A6), ``1`` on the highest derivative."""

    position_1: float  # [k_1] 1/s, jerk
    position_2: float  # [k_2] 1/s^2, acceleration
    position_3: float  # [k_3] 1/s^3, velocity
    position_4: float  # [k_4] 1/s^4, position
    yaw_1: float  # 1/s, yaw rate, the last entry of k_3
    yaw_2: float  # 1/s^2, yaw, the last entry of k_4


class Parameters(NamedTuple):
    """Parameters of the controller."""

    vehicle: Vehicle
    gains: Gains
    reference: ReferenceParameters


GAIN_SETS: Final = {
    # Appendix B. The position loop s^4 + 10 s^3 + 20 s^2 + 50 s + 500 is unstable.
    "ch02": Gains(10.0, 20.0, 50.0, 500.0, 5.0, 5.0),
    # Ours: the same k_1, all four poles of the position loop at -2.5.
    "stable": Gains(10.0, 37.5, 62.5, 39.0625, 5.0, 5.0),
}
"""Gains by name."""


@scalar
def euler_rates(roll: float, pitch: float, p: float, q: float, r: float) -> Triple:
    """Rates (rad/s) of roll, pitch and yaw from the body rates (ch. 2, Eq. 15, rows 4-6).

    Args:
        roll, pitch: rad
        p, q, r: body rates, rad/s
    """
    sin_roll, cos_roll, cos_pitch = sin(roll), cos(roll), cos(pitch)
    if cos_pitch == 0.0:
        return nan, nan, nan
    yaw_rate = (sin_roll * q + cos_roll * r) / cos_pitch
    return p + sin(pitch) * yaw_rate, cos_roll * q - sin_roll * r, yaw_rate


@scalar
def gyroscopic_acceleration(p: float, q: float, r: float, vehicle: Vehicle) -> Triple:
    """Angular acceleration (rad/s^2) without torque (ch. 2, Eq. 15, last three rows).

    Args:
        p, q, r: body rates, rad/s
        vehicle: its inertia
    """
    ix, iy, iz = vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz
    return (iy - iz) / ix * q * r, (iz - ix) / iy * p * r, (ix - iy) / iz * p * q


@scalar
def acceleration_and_jerk(z_down: Values, vehicle: Vehicle) -> Values:
    """Second and third derivative of the position (ch. 2, Eqs. 15-18 and 24), three floats each.

    ``z_down`` is the state `EXTENDED_QUADROTOR_FIELDS` with z down, here and in what follows.
    """
    roll, pitch, yaw, p, q, _, thrust, thrust_rate = z_down[ROLL:]
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_from_euler(roll, pitch, yaw)
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
    """``Ma`` of ch. 2, Eq. (20): the derivatives of the outputs at zero input.

    Returns the fourth derivative of the position (m/s^4) and the second of yaw (rad/s^2).
    """
    roll, pitch, yaw, p, q, r, thrust, thrust_rate = z_down[ROLL:]
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
    """``Delta`` of ch. 2, Eqs. (20) and (42), row by row; NaN at a pitch of 90 degrees.

    Yaw torque does not turn the thrust, so the upper three entries of the last column are zero.
    They are printed as non-zero due to errors in Eqs. (31) and (36): ``s_theta s_phi`` should read
    ``s_theta c_phi``.
    """
    roll, pitch, yaw, thrust = z_down[ROLL], z_down[PITCH], z_down[YAW], z_down[THRUST]
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_from_euler(roll, pitch, yaw)
    mass, arm = vehicle.mass, vehicle.arm_length
    by_roll = thrust * arm / (mass * vehicle.inertia_xx)
    by_pitch = -thrust * arm / (mass * vehicle.inertia_yy)
    cos_pitch = cos(pitch)
    yaw_by_pitch, yaw_by_yaw = nan, nan
    if cos_pitch != 0.0:
        yaw_by_pitch = sin(roll) / cos_pitch * arm / vehicle.inertia_yy
        yaw_by_yaw = cos(roll) / cos_pitch * arm / vehicle.inertia_zz
    row_1 = (-r13 / mass, by_roll * r12, by_pitch * r11, 0.0)
    row_2 = (-r23 / mass, by_roll * r22, by_pitch * r21, 0.0)
    row_3 = (-r33 / mass, by_roll * r32, by_pitch * r31, 0.0)
    return (*row_1, *row_2, *row_3, 0.0, 0.0, yaw_by_pitch, yaw_by_yaw)


@scalar
def solve_decoupling(z_down: Values, vehicle: Vehicle, desired: Quad) -> Quad:
    """The inputs ``u`` with ``Delta u = desired`` (Eq. A1), NaN where ``Delta`` is singular.

    In body axes ``Delta`` is triangular: only ``u_1`` acts along the thrust, ``u_2`` and ``u_3``
    across it, and ``u_4`` corrects the yaw. It is singular at zero thrust, and at a roll or pitch
    of 90 degrees.
    """
    roll, pitch, yaw, thrust = z_down[ROLL], z_down[PITCH], z_down[YAW], z_down[THRUST]
    cos_roll, cos_pitch = cos(roll), cos(pitch)
    if thrust == 0.0 or cos_roll == 0.0 or cos_pitch == 0.0:
        return nan, nan, nan, nan
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_from_euler(roll, pitch, yaw)
    x, y, z, yaw_acceleration = desired
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
def demanded_derivatives(
    time: float, z_down: Values, parameters: Parameters, knots: Vector = NO_KNOTS
) -> Quad:
    """The desired fourth derivative of the position and second of yaw (Eqs. A2-A6).

    Args:
        time: s
        z_down: the state with z down
        parameters, knots: of the controller and of the reference
    """
    x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, _, _ = z_down
    gains = parameters.gains
    k1, k2, k3, k4 = gains.position_1, gains.position_2, gains.position_3, gains.position_4
    ax, ay, az, jx, jy, jz = acceleration_and_jerk(z_down, parameters.vehicle)
    motion = reference_derivatives(time, parameters.reference, knots)
    x0, y0, z0, x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4 = motion
    x_ref, y_ref, z_ref = flip_vector(x0, y0, z0)
    vx_ref, vy_ref, vz_ref = flip_vector(x1, y1, z1)
    ax_ref, ay_ref, az_ref = flip_vector(x2, y2, z2)
    jx_ref, jy_ref, jz_ref = flip_vector(x3, y3, z3)
    sx_ref, sy_ref, sz_ref = flip_vector(x4, y4, z4)
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
    """`INPUT_FIELDS`: thrust, torques and rates of the controller's own states, z up.

    The inputs of ch. 2, Eqs. (1)-(8), with ``u_2`` to ``u_4`` converted from forces at the arms to
    torques. NaN where the decoupling matrix is singular.

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.states.EXTENDED_QUADROTOR_FIELDS`, z up
        parameters, knots: of the controller and of the reference
    """
    z_down = flip_state(state)
    vehicle = parameters.vehicle
    sx, sy, sz, yaw_acceleration = demanded_derivatives(time, z_down, parameters, knots)
    drift_x, drift_y, drift_z, drift_yaw = drift(z_down, vehicle)
    desired = (sx - drift_x, sy - drift_y, sz - drift_z, yaw_acceleration - drift_yaw)
    u1, u2, u3, u4 = solve_decoupling(z_down, vehicle, desired)
    arm = vehicle.arm_length
    roll_torque, pitch_torque, yaw_torque = flip_vector(arm * u2, arm * u3, arm * u4)
    return state[THRUST], roll_torque, pitch_torque, yaw_torque, state[THRUST_RATE], u1
