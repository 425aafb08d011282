"""Full-pose control of the tiltrotor: six outputs, eight inputs (ch. 3, Sec. 6.3).

With the tilt angles as inputs the tiltrotor has more inputs than degrees of freedom. Position and
attitude are tracked by third-order error dynamics; of all inputs with the desired third derivatives
the controller takes the one of minimum norm. The inputs are the rates of
``w_i = varpi_i |varpi_i|`` and of the tilt angles, and the norm depends on the weight of a tilt
rate relative to a rate of ``w``. The published controller takes (rad/s)^2/s and rad/s as they are.
One rad/s then moves the force as much as 1e5 (rad/s)^2/s, so that tilting does nearly all the work,
even for the vertical force: a pod at a small angle hardly changes it, and its rate grows like
1/sin(alpha) down to angles of 1e-5 rad, faster than any step can follow.
`force_balanced_tilt_weight` weights both by the force they move.

The thesis shows the flights but neither the control law nor its gains; both are those of its
author's public model of this vehicle. As in ch. 3, the gyroscopic torque is omitted.
"""

from __future__ import annotations

from math import copysign, inf, nan
from typing import Any, Final, NamedTuple

from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.laws.failures import Failure as Failure
from tiltsim_controllers.laws.failures import health_of
from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.mathematics.scalar import Octet, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    body_torque,
    sines_and_cosines,
    torque_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

_health = health_of(4)

Sextet = tuple[Octet, Octet, Octet, Octet, Octet, Octet]

RANK_TOLERANCE: Final = 1e-24
"""Squared length of a row after rejection of the earlier rows, relative to that of the whole row,
below which it is dependent: rounding leaves about 1e-32, a flying vehicle 1e-11 or more."""


class Gains(NamedTuple):
    """Gains of third-order error dynamics, ``1`` on the second derivative, ``3`` on the output."""

    position_1: float  # 1/s
    position_2: float  # 1/s^2
    position_3: float  # 1/s^3
    attitude_1: float  # 1/s
    attitude_2: float  # 1/s^2
    attitude_3: float  # 1/s^3


class Limits(NamedTuple):
    """Limits of the tilt servos; infinite for none."""

    max_tilt_rate: float = inf  # rad/s
    max_tilt_angle: float = inf  # rad


class Parameters(NamedTuple):
    """Parameters of the controller."""

    vehicle: Vehicle
    gains: Gains
    reference: ReferenceParameters
    limits: Limits
    tilt_weight: float  # (rad/s)^2/rad: the norm is that of (w', tilt_weight alpha')
    failure: Failure = Failure()


GAIN_SETS: Final = {
    # the author's public model, HansOersted/tiltrotor_simulator
    "ch03": Gains(750.0, 1875.0, 1562.0, 750.0, 1500.0, 2577.0)
}
"""Gains by name."""

PUBLISHED_TILT_WEIGHT: Final = 1.0
"""Rates of ``w`` and of the tilt angles have the same weight, number for number."""


def force_balanced_tilt_weight(vehicle: Any) -> float:
    """The weight with which thrust and tilt rates count by the force they move in hover.

    The vehicle has a ``hover_rotor_speed``, rad/s.
    """
    weight: float = vehicle.hover_rotor_speed**2
    return weight


@scalar
def attitude_error(rotation: Values, desired: Values) -> Triple:
    """``(R^T R_d - R_d^T R)^vee / 2``, body axes: the sine of the remaining angle, along its axis.

    Both rotations are body to world, nine entries, row by row. The error also vanishes half a
    revolution away.
    """
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation
    d11, d12, d13, d21, d22, d23, d31, d32, d33 = desired
    return (
        0.5 * (r13 * d12 + r23 * d22 + r33 * d32 - r12 * d13 - r22 * d23 - r32 * d33),
        0.5 * (r11 * d13 + r21 * d23 + r31 * d33 - r13 * d11 - r23 * d21 - r33 * d31),
        0.5 * (r12 * d11 + r22 * d21 + r32 * d31 - r11 * d12 - r21 * d22 - r31 * d32),
    )


@scalar
def _dot(a: Octet, b: Octet) -> float:
    """Inner product of two vectors of eight."""
    a1, a2, a3, a4, a5, a6, a7, a8 = a
    b1, b2, b3, b4, b5, b6, b7, b8 = b
    return a1 * b1 + a2 * b2 + a3 * b3 + a4 * b4 + a5 * b5 + a6 * b6 + a7 * b7 + a8 * b8


@scalar
def _add_scaled(a: Octet, factor: float, b: Octet) -> Octet:
    """The vector ``a + factor b``."""
    a1, a2, a3, a4, a5, a6, a7, a8 = a
    b1, b2, b3, b4, b5, b6, b7, b8 = b
    k = factor
    low = (a1 + k * b1, a2 + k * b2, a3 + k * b3, a4 + k * b4)
    return (*low, a5 + k * b5, a6 + k * b6, a7 + k * b7, a8 + k * b8)


@scalar
def _project_onto_row(inputs: Octet, row: Octet, new: Octet, desired: float) -> Octet:
    """Add the multiple of ``new`` to ``inputs`` that gives ``row . inputs`` the desired value.

    ``new`` is the rejection of ``row`` from the earlier rows, whose equations remain satisfied. NaN
    where it vanishes but for rounding.
    """
    length = _dot(new, new)
    if not length > RANK_TOLERANCE * _dot(row, row):
        return nan, nan, nan, nan, nan, nan, nan, nan
    return _add_scaled(inputs, (desired - _dot(row, inputs)) / length, new)


@scalar
def _project_onto_rows(
    inputs: Octet,
    rows: Sextet,
    new: Sextet,
    desired: tuple[float, float, float, float, float, float],
) -> Octet:
    """`_project_onto_row` for all six rows in sequence."""
    a1, a2, a3, a4, a5, a6 = rows
    n1, n2, n3, n4, n5, n6 = new
    b1, b2, b3, b4, b5, b6 = desired
    inputs = _project_onto_row(inputs, a1, n1, b1)
    inputs = _project_onto_row(inputs, a2, n2, b2)
    inputs = _project_onto_row(inputs, a3, n3, b3)
    inputs = _project_onto_row(inputs, a4, n4, b4)
    inputs = _project_onto_row(inputs, a5, n5, b5)
    return _project_onto_row(inputs, a6, n6, b6)


@scalar
def _reject(vector: Octet, direction: Octet) -> Octet:
    """Vector rejection: ``vector`` minus its projection onto ``direction``, unless that is zero."""
    length = _dot(direction, direction)
    if length == 0.0:
        return vector
    return _add_scaled(vector, -_dot(direction, vector) / length, direction)


@scalar
def minimum_norm_inputs(
    rows: Sextet, desired: tuple[float, float, float, float, float, float]
) -> Octet:
    """The shortest ``x`` with ``rows x = desired``, by the pseudo-inverse of a 6 x 8 matrix.

    Each row in turn is made orthogonal to the earlier ones (modified Gram-Schmidt), and the
    solution moves along the remainder until its equation holds; it stays in the span of the rows,
    which makes it the shortest. A second pass removes rounding errors. This costs little more than
    normal equations and does not square the condition number, about 1e5 with the published weight.
    All NaN where the rows are dependent.
    """
    a1, a2, a3, a4, a5, a6 = rows
    q2 = _reject(a2, a1)
    q3 = _reject(_reject(a3, a1), q2)
    q4 = _reject(_reject(_reject(a4, a1), q2), q3)
    q5 = _reject(_reject(_reject(_reject(a5, a1), q2), q3), q4)
    q6 = _reject(_reject(_reject(_reject(a6, a1), q2), q3), q4)
    new = (a1, q2, q3, q4, q5, _reject(q6, q5))
    start = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return _project_onto_rows(_project_onto_rows(start, rows, new, desired), rows, new, desired)


@scalar
def pose_rows(trig: Octet, torque: Octet, w: Quad) -> Sextet:
    """Force and torque rates per input, body axes: ``[F, dF/dalpha w; tau, dtau/dalpha w]``.

    Columns are the rates of ``w_1`` to ``w_4`` and of ``alpha_1`` to ``alpha_4``; force is in units
    of ``K_f``, torque in units of ``L K_f``. ``trig`` are the `sines_and_cosines`, ``torque`` the
    `torque_entries` of the tilt angles.
    """
    s1, c1, s2, c2, s3, c3, s4, c4 = trig
    x2, x4, y1, y3, z1, z2, z3, z4 = torque
    w1, w2, w3, w4 = w
    return (
        (0.0, s2, 0.0, -s4, 0.0, c2 * w2, 0.0, -c4 * w4),
        (s1, 0.0, -s3, 0.0, c1 * w1, 0.0, -c3 * w3, 0.0),
        (-c1, c2, -c3, c4, s1 * w1, -s2 * w2, s3 * w3, -s4 * w4),
        # Tilting a pod converts roll or pitch torque to yaw torque and back.
        (0.0, x2, 0.0, x4, 0.0, z2 * w2, 0.0, -z4 * w4),
        (y1, 0.0, y3, 0.0, -z1 * w1, 0.0, z3 * w3, 0.0),
        (z1, z2, z3, z4, y1 * w1, -x2 * w2, -y3 * w3, x4 * w4),
    )


@scalar
def _masked(row: Octet, health: Quad) -> Octet:
    """A row of `pose_rows` with both columns of every rotor multiplied by its health, 0 or 1."""
    h1, h2, h3, h4 = health
    w1, w2, w3, w4, a1, a2, a3, a4 = row
    return h1 * w1, h2 * w2, h3 * w3, h4 * w4, h1 * a1, h2 * a2, h3 * a3, h4 * a4


@scalar
def limited_tilt_rate(rate: float, angle: float, limits: Limits) -> float:
    """A tilt rate (rad/s) within its limit, zero if it takes the angle (rad) past its limit."""
    if abs(angle) >= limits.max_tilt_angle and rate * angle > 0.0:
        return 0.0
    if abs(rate) > limits.max_tilt_rate:
        return copysign(limits.max_tilt_rate, rate)
    return rate


@scalar
def desired_jerks(
    time: float,
    state: Values,
    rotation: Values,
    accelerations: tuple[Triple, Triple],
    parameters: Any,
    knots: Vector,
) -> tuple[Triple, Triple]:
    """Desired third derivatives of position (m/s^3, world) and attitude (rad/s^3, body axes).

    Args:
        time: s
        state: twelve numbers of the body, and any more
        rotation: body to world, rows first
        accelerations: the present ones, linear (m/s^2, world) and angular (rad/s^2, body axes)
        parameters, knots: gains and reference of the controller
    """
    x, y, z, vx, vy, vz, _, _, _, p, q, r = state[0:12]
    (ax, ay, az), (p_rate, q_rate, r_rate) = accelerations
    gains, reference = parameters.gains, parameters.reference
    ref = reference_derivatives(time, reference, knots)
    x_ref, y_ref, z_ref, vx_ref, vy_ref, vz_ref, ax_ref, ay_ref, az_ref = ref[:9]
    jx_ref, jy_ref, jz_ref = ref[9:12]
    k1, k2, k3 = gains.position_1, gains.position_2, gains.position_3
    jx = jx_ref + k1 * (ax_ref - ax) + k2 * (vx_ref - vx) + k3 * (x_ref - x)
    jy = jy_ref + k1 * (ay_ref - ay) + k2 * (vy_ref - vy) + k3 * (y_ref - y)
    jz = jz_ref + k1 * (az_ref - az) + k2 * (vz_ref - vz) + k3 * (z_ref - z)
    desired = rotation_from_euler(reference.roll, reference.pitch, reference.yaw)
    ex, ey, ez = attitude_error(rotation, desired)
    k1, k2, k3 = gains.attitude_1, gains.attitude_2, gains.attitude_3
    p_jerk = k3 * ex - k2 * p - k1 * p_rate
    q_jerk = k3 * ey - k2 * q - k1 * q_rate
    r_jerk = k3 * ez - k2 * r - k1 * r_rate
    return (jx, jy, jz), (p_jerk, q_jerk, r_jerk)


@scalar
def full_pose_inputs(
    time: float, state: Values, parameters: Parameters, knots: Vector = NO_KNOTS
) -> Octet:
    """The rotor accelerations (rad/s^2) and tilt rates (rad/s), four each.

    All NaN where the 6 x 8 matrix is rank-deficient or a rotor stands still, where its acceleration
    does not change its thrust.

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.states.TILTROTOR_FIELDS`
        parameters, knots: the reference has position, roll, pitch and yaw, or x = y = 0 without one
    """
    vehicle = parameters.vehicle
    _, _, _, _, _, _, roll, pitch, yaw, p, q, r = state[0:12]
    alpha_1, alpha_2, alpha_3, alpha_4, speed_1, speed_2, speed_3, speed_4 = state[12:20]
    trig = sines_and_cosines(alpha_1, alpha_2, alpha_3, alpha_4)
    torque = torque_entries(trig, drag_ratio(vehicle))
    health = _health(time, parameters.failure)
    w1, w2 = speed_1 * abs(speed_1), speed_2 * abs(speed_2)
    w3, w4 = speed_3 * abs(speed_3), speed_4 * abs(speed_4)
    w1, w2, w3, w4 = health[0] * w1, health[1] * w2, health[2] * w3, health[3] * w4

    # Second derivatives from the model, ch. 3, Eqs. (1) and (4).
    rotation = rotation_from_euler(roll, pitch, yaw)
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation
    fx, fy, fz = body_force(trig, w1, w2, w3, w4)
    tx, ty, tz = body_torque(torque, w1, w2, w3, w4)
    per_force = vehicle.thrust_coefficient / vehicle.mass
    ax = per_force * (r11 * fx + r12 * fy + r13 * fz)
    ay = per_force * (r21 * fx + r22 * fy + r23 * fz)
    az = per_force * (r31 * fx + r32 * fy + r33 * fz) - vehicle.gravity
    per_torque = vehicle.arm_length * vehicle.thrust_coefficient
    per_roll = per_torque / vehicle.inertia_xx
    per_pitch = per_torque / vehicle.inertia_yy
    per_yaw = per_torque / vehicle.inertia_zz
    present = (ax, ay, az), (per_roll * tx, per_pitch * ty, per_yaw * tz)
    (jx, jy, jz), (p_jerk, q_jerk, r_jerk) = desired_jerks(
        time, state, rotation, present, parameters, knots
    )

    # In body axes: R^T j m / K_f minus the turning of the force with the body, omega x F w.
    desired = (
        (r11 * jx + r21 * jy + r31 * jz) / per_force - (q * fz - r * fy),
        (r12 * jx + r22 * jy + r32 * jz) / per_force - (r * fx - p * fz),
        (r13 * jx + r23 * jy + r33 * jz) / per_force - (p * fy - q * fx),
        p_jerk / per_roll,
        q_jerk / per_pitch,
        r_jerk / per_yaw,
    )
    # The columns of weighted tilt rates are those of tilt rates divided by the weight.
    weight = parameters.tilt_weight
    rows = pose_rows(trig, torque, (w1 / weight, w2 / weight, w3 / weight, w4 / weight))
    if health != (1.0, 1.0, 1.0, 1.0):
        a1, a2, a3, a4, a5, a6 = rows
        a1, a2, a3 = _masked(a1, health), _masked(a2, health), _masked(a3, health)
        a4, a5, a6 = _masked(a4, health), _masked(a5, health), _masked(a6, health)
        rows = a1, a2, a3, a4, a5, a6
    u1, u2, u3, u4, turn_1, turn_2, turn_3, turn_4 = minimum_norm_inputs(rows, desired)

    # w' = 2 |varpi| varpi'.
    factor_1, factor_2 = 2.0 * abs(speed_1), 2.0 * abs(speed_2)
    factor_3, factor_4 = 2.0 * abs(speed_3), 2.0 * abs(speed_4)
    if factor_1 == 0.0 or factor_2 == 0.0 or factor_3 == 0.0 or factor_4 == 0.0:
        return nan, nan, nan, nan, nan, nan, nan, nan
    limits = parameters.limits
    accelerations = (u1 / factor_1, u2 / factor_2, u3 / factor_3, u4 / factor_4)
    return (
        *accelerations,
        limited_tilt_rate(turn_1 / weight, alpha_1, limits),
        limited_tilt_rate(turn_2 / weight, alpha_2, limits),
        limited_tilt_rate(turn_3 / weight, alpha_3, limits),
        limited_tilt_rate(turn_4 / weight, alpha_4, limits),
    )
