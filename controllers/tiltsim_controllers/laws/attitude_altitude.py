"""Attitude-altitude feedback linearization of the tiltrotor (ch. 3, Sec. 3; ch. 4, Sec. 3).

Outputs are roll, pitch, yaw and altitude; inputs the four rotor accelerations, which appear in the
third derivatives. The horizontal position is controlled through roll and pitch by a decoupler. The
control law is one function of time and state; its steps follow the order of ch. 4.
"""

from __future__ import annotations

from math import nan
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.parameters import NO_KNOTS, GaitParameters
from tiltsim_controllers.laws.decouplers import (
    CONVENTIONAL,
    EXACT,
    NONE,
    conventional_decoupler,
    exact_decoupler,
    modified_decoupler,
)
from tiltsim_controllers.mathematics.rotation import world_up_in_body, wrap_angle
from tiltsim_controllers.mathematics.scalar import Octet, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, position_reference
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    body_torque,
    sines_and_cosines,
    solve_by_pairs,
    torque_entries,
    unscaled_torque_free_force,
    vertical_force_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio
from tiltsim_controllers.vehicle.states import VX, VY, X, Y

PUBLISHED_DECOUPLING: Final = 0.0
EXACT_DECOUPLING: Final = 1.0

DECOUPLINGS: Final = {"published": PUBLISHED_DECOUPLING, "exact": EXACT_DECOUPLING}
"""Forms of the decoupling matrix by their name in a scenario."""


class Gains(NamedTuple):
    """Gains of the third-order error dynamics and of the position loop (ch. 4, Eqs. 26-28).

    ``1`` multiplies the error of the second derivative, ``2`` of the first, ``3`` of the output;
    in the position loop ``1`` multiplies the velocity error and ``2`` the position error.
    """

    roll_1: float  # [K_P1] 1/s
    roll_2: float  # [K_P2] 1/s^2
    roll_3: float  # [K_P3] 1/s^3
    pitch_1: float
    pitch_2: float
    pitch_3: float
    yaw_1: float
    yaw_2: float
    yaw_3: float
    altitude_1: float  # [K_PZ1] 1/s
    altitude_2: float  # [K_PZ2] 1/s^2
    altitude_3: float  # [K_PZ3] 1/s^3
    position_1: float  # [K_X1 = K_Y1] 1/s
    position_2: float  # [K_X2 = K_Y2] 1/s^2


class Parameters(NamedTuple):
    """Parameters of the controller."""

    vehicle: Vehicle
    gains: Gains
    gait: GaitParameters
    reference: ReferenceParameters
    decoupler: float
    decoupling: float


@scalar
def attitude_reference(
    time: float,
    state: Values,
    trig: Octet,
    torque: Octet,
    parameters: Parameters,
    knots: Vector = NO_KNOTS,
) -> tuple[float, float, float, float, float, float]:
    """Attitude and altitude to track, with the altitude's derivatives (ch. 4, Eqs. 28-30).

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.states.TILTROTOR_FIELDS`
        trig, torque: `sines_and_cosines` and `torque_entries` of the tilt angles
        parameters, knots: of the controller, and of gait and reference

    Returns:
        ``(roll, pitch, yaw, z, vz, az)``, rad, m and s.
    """
    reference = parameters.reference
    x_ref, y_ref, z_ref, vx_ref, vy_ref, vz_ref, ax_ref, ay_ref, az_ref = position_reference(
        time, reference, knots
    )
    yaw_ref = reference.yaw
    if parameters.decoupler == NONE:
        return reference.roll, reference.pitch, yaw_ref, z_ref, vz_ref, az_ref

    # Eq. (28): the desired horizontal acceleration.
    gains = parameters.gains
    ax = ax_ref + gains.position_1 * (vx_ref - state[VX]) + gains.position_2 * (x_ref - state[X])
    ay = ay_ref + gains.position_1 * (vy_ref - state[VY]) + gains.position_2 * (y_ref - state[Y])

    gravity = parameters.vehicle.gravity
    if parameters.decoupler == CONVENTIONAL:
        roll_ref, pitch_ref = conventional_decoupler(ax, ay, yaw_ref, gravity)
        return roll_ref, pitch_ref, yaw_ref, z_ref, vz_ref, az_ref

    n = unscaled_torque_free_force(trig, torque)
    if parameters.decoupler == EXACT:
        roll_ref, pitch_ref = exact_decoupler(ax, ay, az_ref, yaw_ref, gravity, n)
    else:
        roll_ref, pitch_ref = modified_decoupler(ax, ay, yaw_ref, gravity, n)
    return roll_ref, pitch_ref, yaw_ref, z_ref, vz_ref, az_ref


@scalar
def rotor_accelerations(
    time: float,
    state: Values,
    parameters: Parameters,
    knots: Vector = NO_KNOTS,
    angular_acceleration: Triple | None = None,
) -> Quad:
    """The rotor accelerations (rad/s^2) of the feedback linearization.

    Third-order error dynamics (ch. 4, Eqs. 26-27) give the desired third derivatives of the
    outputs; the decoupling matrix and ``Ma`` (Eq. 18) convert them to inputs (Eq. 19). Body rates
    are used for the rates of roll, pitch and yaw (ch. 3, Eq. 8). NaN where the decoupling matrix is
    singular.

    Args:
        time, state, parameters, knots: as for `attitude_reference`
        angular_acceleration: measured, rad/s^2, body axes; None takes the model's, ``I^-1 tau w``
    """
    _x, _y, z, _vx, _vy, vz, roll, pitch, yaw, p, q, r, a1, a2, a3, a4, s1, s2, s3, s4 = state
    vehicle = parameters.vehicle
    gains = parameters.gains

    trig = sines_and_cosines(a1, a2, a3, a4)
    torque = torque_entries(trig, drag_ratio(vehicle))
    roll_ref, pitch_ref, yaw_ref, z_ref, vz_ref, az_ref = attitude_reference(
        time, state, trig, torque, parameters, knots
    )

    # Second derivatives of the outputs, Eq. (10), from w_i = varpi_i |varpi_i|: torques in units of
    # L K_f and forces in units of K_f, those of the decoupling matrix.
    ux, uy, uz = world_up_in_body(roll, pitch)
    h1, h2, h3, h4 = vertical_force_entries(trig, ux, uy, uz)
    size_1, size_2, size_3, size_4 = abs(s1), abs(s2), abs(s3), abs(s4)
    w1, w2, w3, w4 = s1 * size_1, s2 * size_2, s3 * size_3, s4 * size_4
    unit = 1.0 / (vehicle.arm_length * vehicle.thrust_coefficient)
    ix, iy, iz = vehicle.inertia_xx * unit, vehicle.inertia_yy * unit, vehicle.inertia_zz * unit
    if angular_acceleration is None:
        tx, ty, tz = body_torque(torque, w1, w2, w3, w4)
    else:
        p_rate, q_rate, r_rate = angular_acceleration
        tx, ty, tz = ix * p_rate, iy * q_rate, iz * r_rate
    lift = h1 * w1 + h2 * w2 + h3 * w3 + h4 * w4

    # Ma, Eq. (18): the thrust direction turns with the body, r3^T (omega x F w).
    fx, fy, fz = body_force(trig, w1, w2, w3, w4)
    turning = ux * (q * fz - r * fy) + uy * (r * fx - p * fz) + uz * (p * fy - q * fx)

    # Third-order error dynamics, Eqs. (26)-(27), as rates of those torques and of the lift; the
    # references of roll, pitch and yaw are treated as constant.
    yaw_error = wrap_angle(yaw_ref - yaw)
    roll_rate = ix * (gains.roll_3 * (roll_ref - roll) - gains.roll_2 * p) - gains.roll_1 * tx
    pitch_rate = iy * (gains.pitch_3 * (pitch_ref - pitch) - gains.pitch_2 * q) - gains.pitch_1 * ty
    yaw_rate = iz * (gains.yaw_3 * yaw_error - gains.yaw_2 * r) - gains.yaw_1 * tz
    lift_rate = (
        vehicle.mass
        / vehicle.thrust_coefficient
        * (
            gains.altitude_3 * (z_ref - z)
            + gains.altitude_2 * (vz_ref - vz)
            + gains.altitude_1 * (az_ref + vehicle.gravity)
        )
        - gains.altitude_1 * lift
        - turning
    )

    # Eq. (19). The published matrix has the factor 2 |varpi_i| only in its last row, the exact one
    # in every row, so that the solution can be divided by it instead.
    f1, f2, f3, f4 = 2.0 * size_1, 2.0 * size_2, 2.0 * size_3, 2.0 * size_4
    if parameters.decoupling == PUBLISHED_DECOUPLING:
        published = (h1 * f1, h2 * f2, h3 * f3, h4 * f4)
        return solve_by_pairs(torque, published, roll_rate, pitch_rate, yaw_rate, lift_rate)
    if f1 == 0.0 or f2 == 0.0 or f3 == 0.0 or f4 == 0.0:
        return nan, nan, nan, nan
    v1, v2, v3, v4 = solve_by_pairs(
        torque, (h1, h2, h3, h4), roll_rate, pitch_rate, yaw_rate, lift_rate
    )
    return v1 / f1, v2 / f2, v3 / f3, v4 / f4
