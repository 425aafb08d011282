"""Attitude-altitude feedback linearization of the tiltrotor (ch. 3, Sec. 3; ch. 4, Sec. 3).

Outputs are roll, pitch, yaw and altitude; inputs the four rotor accelerations, reached by the
third derivative. Position is steered through roll and pitch by a decoupler. The law is one
function of time and state, built from the steps below in the order in which a reader of ch. 4
meets them.
"""

from __future__ import annotations

from collections.abc import Sequence
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
from tiltsim_controllers.mathematics.scalar import Octet, Quad, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, position_reference
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    sines_and_cosines,
    solve_by_pairs,
    torque_entries,
    unscaled_torque_free_force,
    vertical_force_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

PUBLISHED_DECOUPLING: Final = 0.0
EXACT_DECOUPLING: Final = 1.0

DECOUPLINGS: Final = {"published": PUBLISHED_DECOUPLING, "exact": EXACT_DECOUPLING}
"""Forms of the decoupling matrix by the name a scenario gives them."""


class Gains(NamedTuple):
    """Gains of the third-order laws and of the position loop (ch. 4, Eqs. 26-28).

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
    """All that the law needs to know besides time and state."""

    vehicle: Vehicle
    gains: Gains
    gait: GaitParameters
    reference: ReferenceParameters
    decoupler: float
    decoupling: float


State = tuple[float, ...]

STATE_FIELDS: Final = (
    *("x", "y", "z", "vx", "vy", "vz"),  # 0-5: m and m/s, world axes
    *("roll", "pitch", "yaw", "p", "q", "r"),  # 6-11: rad; body rates, rad/s
    *("alpha_1", "alpha_2", "alpha_3", "alpha_4"),  # 12-15: rad
    *("rotor_speed_1", "rotor_speed_2", "rotor_speed_3", "rotor_speed_4"),  # 16-19: rad/s, signed
)
"""The vehicle's state as the law takes it: one float per name, in this order."""


@scalar
def attitude_reference(
    time: float,
    state: State,
    trig: Octet,
    torque: Octet,
    parameters: Parameters,
    table: Sequence[float] = NO_KNOTS,
) -> tuple[float, float, float, float, float, float]:
    """Attitude and altitude to track, with the altitude's derivatives (ch. 4, Eqs. 28-30).

    ``trig`` are the `sines_and_cosines` of the tilt angles, ``torque`` their `torque_entries`.
    Returns ``(roll, pitch, yaw, z, vz, az)`` in rad and SI units.
    """
    reference = parameters.reference
    x_ref, y_ref, z_ref, vx_ref, vy_ref, vz_ref, ax_ref, ay_ref, az_ref = position_reference(
        time, reference, table
    )
    yaw_ref = reference.yaw
    if parameters.decoupler == NONE:
        return reference.roll, reference.pitch, yaw_ref, z_ref, vz_ref, az_ref

    # Eq. (28): the horizontal acceleration that would take the vehicle to its reference.
    gains = parameters.gains
    ax = ax_ref + gains.position_1 * (vx_ref - state[3]) + gains.position_2 * (x_ref - state[0])
    ay = ay_ref + gains.position_1 * (vy_ref - state[4]) + gains.position_2 * (y_ref - state[1])

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
    time: float, state: State, parameters: Parameters, table: Sequence[float] = NO_KNOTS
) -> Quad:
    """The rotor accelerations (rad/s^2) of the feedback linearization at a time and state.

    Third-order laws (ch. 4, Eqs. 26-27) on the outputs give the wanted third derivatives; the
    decoupling matrix and ``Ma`` (Eq. 18) turn them into inputs (Eq. 19). Body rates stand for
    the rates of roll, pitch and yaw (ch. 3, Eq. 8), second derivatives come from the model. NaN
    where the decoupling matrix is singular.
    """
    _x, _y, z, _vx, _vy, vz, roll, pitch, yaw, p, q, r, a1, a2, a3, a4, s1, s2, s3, s4 = state
    vehicle = parameters.vehicle
    gains = parameters.gains

    trig = sines_and_cosines(a1, a2, a3, a4)
    torque = torque_entries(trig, drag_ratio(vehicle))
    x2, x4, y1, y3, z1, z2, z3, z4 = torque
    roll_ref, pitch_ref, yaw_ref, z_ref, vz_ref, az_ref = attitude_reference(
        time, state, trig, torque, parameters, table
    )

    # What the rotors do now, from w_i = varpi_i |varpi_i|: second derivatives of the outputs, Eq.
    # (10), as torques in units of L K_f and forces in units of K_f, the decoupling matrix's own.
    ux, uy, uz = world_up_in_body(roll, pitch)
    h1, h2, h3, h4 = vertical_force_entries(trig, ux, uy, uz)
    size_1, size_2, size_3, size_4 = abs(s1), abs(s2), abs(s3), abs(s4)
    w1, w2, w3, w4 = s1 * size_1, s2 * size_2, s3 * size_3, s4 * size_4
    roll_torque = x2 * w2 + x4 * w4
    pitch_torque = y1 * w1 + y3 * w3
    yaw_torque = z1 * w1 + z2 * w2 + z3 * w3 + z4 * w4
    lift = h1 * w1 + h2 * w2 + h3 * w3 + h4 * w4

    # Ma, Eq. (18): the thrust direction turns with the body, r3^T (omega x F w).
    fx, fy, fz = body_force(trig, w1, w2, w3, w4)
    turning = ux * (q * fz - r * fy) + uy * (r * fx - p * fz) + uz * (p * fy - q * fx)

    # Third-order laws, Eqs. (26)-(27), as rates of those torques and of the lift; the references
    # of roll, pitch and yaw are held constant.
    per_torque = 1.0 / (vehicle.arm_length * vehicle.thrust_coefficient)
    roll_rate = (
        vehicle.inertia_xx * per_torque * (gains.roll_3 * (roll_ref - roll) - gains.roll_2 * p)
        - gains.roll_1 * roll_torque
    )
    pitch_rate = (
        vehicle.inertia_yy * per_torque * (gains.pitch_3 * (pitch_ref - pitch) - gains.pitch_2 * q)
        - gains.pitch_1 * pitch_torque
    )
    yaw_error = wrap_angle(yaw_ref - yaw)
    yaw_rate = (
        vehicle.inertia_zz * per_torque * (gains.yaw_3 * yaw_error - gains.yaw_2 * r)
        - gains.yaw_1 * yaw_torque
    )
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

    # Eq. (19). The published matrix has the factor 2 |varpi_i| in its last row alone; the exact one
    # has it in every row, so that it can be taken out of the matrix and divided out of the answer.
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
