"""Full-pose control of the tiltrotor: six outputs, eight inputs (ch. 3, Sec. 6.3).

With the tilt angles as inputs the tiltrotor has more inputs than degrees of freedom. Position and
attitude are tracked by third-order laws; of all inputs that make the wanted third derivatives the
law takes the one of least norm. The inputs are the rates of ``w_i = varpi_i |varpi_i|`` and of the
tilt angles, and least norm depends on what a tilt rate weighs against a rate of ``w``. The
published law takes (rad/s)^2/s and rad/s as they are. One rad/s then moves the force as much as
1e5 (rad/s)^2/s do, so that tilting does nearly all the work, even the vertical force's: of that a
pod at a small angle changes next to nothing, and its rate grows like 1/sin(alpha) down to angles of
1e-5 rad, faster than any step can follow. `force_balanced_tilt_weight` weighs both by the force
they move.

The thesis shows the flights and prints neither the law nor its gains; both are those of its
author's public model of this vehicle. Like ch. 3's own law, it leaves out the gyroscopic torque.
"""

from __future__ import annotations

from math import copysign, inf, nan
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.mathematics.scalar import Octet, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    sines_and_cosines,
    torque_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

Sextet = tuple[Octet, Octet, Octet, Octet, Octet, Octet]

LOST_RANK: Final = 1e-24
"""Squared length of a row without its share in earlier rows, over that of the whole row, below
which the row counts as dependent: rounding leaves some 1e-32, a flying vehicle 1e-11 or more."""


class Gains(NamedTuple):
    """Gains of the third-order laws, ``1`` on the second derivative, ``3`` on the output."""

    position_1: float  # 1/s
    position_2: float  # 1/s^2
    position_3: float  # 1/s^3
    attitude_1: float  # 1/s
    attitude_2: float  # 1/s^2
    attitude_3: float  # 1/s^3


class Limits(NamedTuple):
    """What the tilt servos can do; infinite where there is no limit."""

    max_tilt_rate: float = inf  # rad/s
    max_tilt_angle: float = inf  # rad


class Failure(NamedTuple):
    """A rotor that the law has learnt to be lost: it counts on the other three from then on."""

    rotor: float = 0.0  # 1 to 4, 0 for none
    known_from: float = inf  # s


class Parameters(NamedTuple):
    """All that the law needs to know besides time and state."""

    vehicle: Vehicle
    gains: Gains
    reference: ReferenceParameters
    limits: Limits
    tilt_weight: float  # (rad/s)^2/rad: the norm is that of (w', tilt_weight alpha')
    failure: Failure = Failure()


GAIN_SETS: Final = {
    # the author's public model, HansOersted/tiltrotor_simulator
    "ch03": Gains(750.0, 1875.0, 1562.0, 750.0, 1500.0, 2577.0),
}
"""Gains by name."""

PUBLISHED_TILT_WEIGHT: Final = 1.0
"""Rates of ``w`` and of the tilt angles count alike, number for number."""


def force_balanced_tilt_weight(vehicle: Vehicle) -> float:
    """The weight under which thrust and tilt rates count by the force they move in hover."""
    return vehicle.hover_rotor_speed**2


@scalar
def attitude_error(rotation: Values, wanted: Values) -> Triple:
    """``(R^T R_d - R_d^T R)^vee / 2``, body axes: the sine of the angle to go, along its axis.

    Both rotations are body to world, nine entries, rows first. The error vanishes half a
    revolution away, too, where the law has no direction to prefer.
    """
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation
    d11, d12, d13, d21, d22, d23, d31, d32, d33 = wanted
    return (
        0.5 * (r13 * d12 + r23 * d22 + r33 * d32 - r12 * d13 - r22 * d23 - r32 * d33),
        0.5 * (r11 * d13 + r21 * d23 + r31 * d33 - r13 * d11 - r23 * d21 - r33 * d31),
        0.5 * (r12 * d11 + r22 * d21 + r32 * d31 - r11 * d12 - r21 * d22 - r31 * d32),
    )


@scalar
def dot(a: Octet, b: Octet) -> float:
    """Inner product of two vectors of eight."""
    return (
        a[0] * b[0]
        + a[1] * b[1]
        + a[2] * b[2]
        + a[3] * b[3]
        + a[4] * b[4]
        + a[5] * b[5]
        + a[6] * b[6]
        + a[7] * b[7]
    )


@scalar
def moved(a: Octet, factor: float, b: Octet) -> Octet:
    """The vector ``a + factor b``."""
    return (
        a[0] + factor * b[0],
        a[1] + factor * b[1],
        a[2] + factor * b[2],
        a[3] + factor * b[3],
        a[4] + factor * b[4],
        a[5] + factor * b[5],
        a[6] + factor * b[6],
        a[7] + factor * b[7],
    )


@scalar
def satisfied(inputs: Octet, row: Octet, new: Octet, wanted: float) -> Octet:
    """Add the multiple of ``new`` to ``inputs`` that makes ``row . inputs`` the wanted number.

    ``new`` is what is left of ``row`` without its share in the rows before, so that those stay
    satisfied. NaN where next to nothing is left.
    """
    length = dot(new, new)
    if not length > LOST_RANK * dot(row, row):
        return nan, nan, nan, nan, nan, nan, nan, nan
    return moved(inputs, (wanted - dot(row, inputs)) / length, new)


@scalar
def all_satisfied(
    inputs: Octet,
    rows: Sextet,
    new: Sextet,
    wanted: tuple[float, float, float, float, float, float],
) -> Octet:
    """`satisfied` for all six rows, one after the other."""
    a1, a2, a3, a4, a5, a6 = rows
    n1, n2, n3, n4, n5, n6 = new
    b1, b2, b3, b4, b5, b6 = wanted
    inputs = satisfied(inputs, a1, n1, b1)
    inputs = satisfied(inputs, a2, n2, b2)
    inputs = satisfied(inputs, a3, n3, b3)
    inputs = satisfied(inputs, a4, n4, b4)
    inputs = satisfied(inputs, a5, n5, b5)
    return satisfied(inputs, a6, n6, b6)


@scalar
def without_share(vector: Octet, direction: Octet) -> Octet:
    """``vector`` less its projection on ``direction``; unchanged for a zero direction."""
    length = dot(direction, direction)
    if length == 0.0:
        return vector
    return moved(vector, -dot(direction, vector) / length, direction)


@scalar
def minimum_norm_inputs(
    rows: Sextet, wanted: tuple[float, float, float, float, float, float]
) -> Octet:
    """The shortest ``x`` with ``rows x = wanted``: the pseudo-inverse of a 6 x 8 matrix, applied.

    Rows are taken one by one. Each is made orthogonal to those before (modified Gram-Schmidt), and
    the answer moves along what is left of it until its equation holds; it never leaves the span of
    the rows, which makes it the shortest. A second round removes what rounding left. This costs
    little more than normal equations and does not square the condition number, which is about 1e5
    under the published weight. All NaN where the rows are dependent.
    """
    a1, a2, a3, a4, a5, a6 = rows
    q2 = without_share(a2, a1)
    q3 = without_share(without_share(a3, a1), q2)
    q4 = without_share(without_share(without_share(a4, a1), q2), q3)
    q5 = without_share(without_share(without_share(without_share(a5, a1), q2), q3), q4)
    q6 = without_share(without_share(without_share(without_share(a6, a1), q2), q3), q4)
    new = (a1, q2, q3, q4, q5, without_share(q6, q5))
    start = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return all_satisfied(all_satisfied(start, rows, new, wanted), rows, new, wanted)


@scalar
def pose_rows(trig: Octet, torque: Octet, w: Quad) -> Sextet:
    """How the inputs move force and torque, body axes: ``[F, dF/dalpha w; tau, dtau/dalpha w]``.

    Columns are the rates of ``w_1`` to ``w_4`` and of ``alpha_1`` to ``alpha_4``; force is in units
    of ``K_f``, torque in units of ``L K_f``. ``trig`` are the `sines_and_cosines`, ``torque`` the
    `torque_entries`.
    """
    s1, c1, s2, c2, s3, c3, s4, c4 = trig
    x2, x4, y1, y3, z1, z2, z3, z4 = torque
    w1, w2, w3, w4 = w
    return (
        (0.0, s2, 0.0, -s4, 0.0, c2 * w2, 0.0, -c4 * w4),
        (s1, 0.0, -s3, 0.0, c1 * w1, 0.0, -c3 * w3, 0.0),
        (-c1, c2, -c3, c4, s1 * w1, -s2 * w2, s3 * w3, -s4 * w4),
        # Turning the pod by alpha turns roll or pitch torque into yaw torque and back.
        (0.0, x2, 0.0, x4, 0.0, z2 * w2, 0.0, -z4 * w4),
        (y1, 0.0, y3, 0.0, -z1 * w1, 0.0, z3 * w3, 0.0),
        (z1, z2, z3, z4, y1 * w1, -x2 * w2, -y3 * w3, x4 * w4),
    )


@scalar
def without_columns(row: Octet, health: Quad) -> Octet:
    """A row of `pose_rows` with both columns of every rotor times its health, 0 or 1."""
    h1, h2, h3, h4 = health
    return (
        h1 * row[0],
        h2 * row[1],
        h3 * row[2],
        h4 * row[3],
        h1 * row[4],
        h2 * row[5],
        h3 * row[6],
        h4 * row[7],
    )


@scalar
def limited_tilt_rate(rate: float, angle: float, limits: Limits) -> float:
    """A tilt rate (rad/s) within its limit, zero if it would lead on beyond the angle's limit."""
    if abs(angle) >= limits.max_tilt_angle and rate * angle > 0.0:
        return 0.0
    if abs(rate) > limits.max_tilt_rate:
        return copysign(limits.max_tilt_rate, rate)
    return rate


@scalar
def full_pose_inputs(
    time: float, state: Values, parameters: Parameters, knots: Vector = NO_KNOTS
) -> Octet:
    """The rotor accelerations (rad/s^2) and tilt rates (rad/s), four each, at a time and state.

    ``state`` is that of `tiltsim_controllers.vehicle.states.TILTROTOR_FIELDS`, world z up. The
    reference gives position, roll, pitch and yaw; one of attitude and altitude gives x = y = 0. All
    NaN where the 6 x 8 matrix has lost rank or a rotor stands still, as its acceleration does not
    move its thrust there.
    """
    vehicle, gains, reference = parameters.vehicle, parameters.gains, parameters.reference
    x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r = state[0:12]
    alpha_1, alpha_2, alpha_3, alpha_4, speed_1, speed_2, speed_3, speed_4 = state[12:20]
    trig = sines_and_cosines(alpha_1, alpha_2, alpha_3, alpha_4)
    torque = torque_entries(trig, drag_ratio(vehicle))
    x2, x4, y1, y3, z1, z2, z3, z4 = torque
    w1, w2 = speed_1 * abs(speed_1), speed_2 * abs(speed_2)
    w3, w4 = speed_3 * abs(speed_3), speed_4 * abs(speed_4)
    lost = parameters.failure.rotor if time >= parameters.failure.known_from else 0.0
    health = (
        0.0 if lost == 1.0 else 1.0,
        0.0 if lost == 2.0 else 1.0,
        0.0 if lost == 3.0 else 1.0,
        0.0 if lost == 4.0 else 1.0,
    )
    w1, w2, w3, w4 = health[0] * w1, health[1] * w2, health[2] * w3, health[3] * w4

    # Second derivatives from the model, ch. 3, Eqs. (1) and (4).
    rotation = rotation_from_euler(roll, pitch, yaw)
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation
    fx, fy, fz = body_force(trig, w1, w2, w3, w4)
    per_force = vehicle.thrust_coefficient / vehicle.mass
    ax = per_force * (r11 * fx + r12 * fy + r13 * fz)
    ay = per_force * (r21 * fx + r22 * fy + r23 * fz)
    az = per_force * (r31 * fx + r32 * fy + r33 * fz) - vehicle.gravity
    per_torque = vehicle.arm_length * vehicle.thrust_coefficient
    per_roll = per_torque / vehicle.inertia_xx
    per_pitch = per_torque / vehicle.inertia_yy
    per_yaw = per_torque / vehicle.inertia_zz
    p_rate = per_roll * (x2 * w2 + x4 * w4)
    q_rate = per_pitch * (y1 * w1 + y3 * w3)
    r_rate = per_yaw * (z1 * w1 + z2 * w2 + z3 * w3 + z4 * w4)

    # Third-order laws; the attitude to reach is constant.
    ref = reference_derivatives(time, reference, knots)
    k1, k2, k3 = gains.position_1, gains.position_2, gains.position_3
    jx = ref[9] + k1 * (ref[6] - ax) + k2 * (ref[3] - vx) + k3 * (ref[0] - x)
    jy = ref[10] + k1 * (ref[7] - ay) + k2 * (ref[4] - vy) + k3 * (ref[1] - y)
    jz = ref[11] + k1 * (ref[8] - az) + k2 * (ref[5] - vz) + k3 * (ref[2] - z)
    level = rotation_from_euler(reference.roll, reference.pitch, reference.yaw)
    ex, ey, ez = attitude_error(rotation, level)
    k1, k2, k3 = gains.attitude_1, gains.attitude_2, gains.attitude_3
    p_jerk = k3 * ex - k2 * p - k1 * p_rate
    q_jerk = k3 * ey - k2 * q - k1 * q_rate
    r_jerk = k3 * ez - k2 * r - k1 * r_rate

    # Seen from the body: R^T j m / K_f, less the force's turning with the body, omega x F w.
    wanted = (
        (r11 * jx + r21 * jy + r31 * jz) / per_force - (q * fz - r * fy),
        (r12 * jx + r22 * jy + r32 * jz) / per_force - (r * fx - p * fz),
        (r13 * jx + r23 * jy + r33 * jz) / per_force - (p * fy - q * fx),
        p_jerk / per_roll,
        q_jerk / per_pitch,
        r_jerk / per_yaw,
    )
    # Columns of weighted tilt rates are those of tilt rates over the weight.
    weight = parameters.tilt_weight
    rows = pose_rows(trig, torque, (w1 / weight, w2 / weight, w3 / weight, w4 / weight))
    if lost != 0.0:
        a1, a2, a3, a4, a5, a6 = rows
        rows = (
            without_columns(a1, health),
            without_columns(a2, health),
            without_columns(a3, health),
            without_columns(a4, health),
            without_columns(a5, health),
            without_columns(a6, health),
        )
    u1, u2, u3, u4, turn_1, turn_2, turn_3, turn_4 = minimum_norm_inputs(rows, wanted)

    # w' = 2 |varpi| varpi'.
    factor_1, factor_2 = 2.0 * abs(speed_1), 2.0 * abs(speed_2)
    factor_3, factor_4 = 2.0 * abs(speed_3), 2.0 * abs(speed_4)
    if factor_1 == 0.0 or factor_2 == 0.0 or factor_3 == 0.0 or factor_4 == 0.0:
        return nan, nan, nan, nan, nan, nan, nan, nan
    limits = parameters.limits
    return (
        *(u1 / factor_1, u2 / factor_2, u3 / factor_3, u4 / factor_4),
        limited_tilt_rate(turn_1 / weight, alpha_1, limits),
        limited_tilt_rate(turn_2 / weight, alpha_2, limits),
        limited_tilt_rate(turn_3 / weight, alpha_3, limits),
        limited_tilt_rate(turn_4 / weight, alpha_4, limits),
    )
