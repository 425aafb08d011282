"""Attitude-altitude linearization that knows how its gait moves: exact, with integral action.

The published law (`tiltsim_controllers.laws.attitude_altitude`) takes the tilt angles as they are
and every reference of roll and pitch as if it stood still, so it trails behind a moving gait. But
the gait is planned: its rates are known, and with them the derivatives of all that depends on it.
This law

* counts the tilt rates into ``Ma``: torque and force change with the tilt, ``(d tau / d alpha)
  alpha' w`` and ``(d F / d alpha) alpha' w``;
* gives roll and pitch the velocity and acceleration with which the exact decoupler's answer moves
  as the torque-free force ``n(alpha(t))`` turns in the body;
* follows the position reference up to its snap;
* differentiates Euler angles exactly, where ch. 3, Eq. (8), takes body rates for their rates, and
  includes the gyroscopic torque;
* integrates the position error, so that a constant disturbance leaves no steady error. Where the
  wanted acceleration is at its limit, the integrators do not wind up.

Each ingredient can be left out, to see what it is worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, nan, sqrt
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.anticipation import anticipated_tilts
from tiltsim_controllers.gaits.parameters import NO_KNOTS, GaitParameters
from tiltsim_controllers.gaits.tilts import tilt_reference
from tiltsim_controllers.laws.attitude_altitude import Gains, State
from tiltsim_controllers.laws.decouplers import NONE
from tiltsim_controllers.laws.gains import IntegralGains
from tiltsim_controllers.laws.supervisor import (
    SUPERVISOR_AT_REST,
    Supervisor,
    gait_time,
    supervised_gait_scale,
    supervised_tilts,
)
from tiltsim_controllers.mathematics.jets import (
    Jet,
    jet_angle,
    jet_cosine,
    jet_product,
    jet_quotient,
    jet_scaled,
    jet_sine,
    jet_square_root,
    jet_sum,
)
from tiltsim_controllers.mathematics.rotation import rotation_from_euler, to_world, wrap_angle
from tiltsim_controllers.mathematics.scalar import Quad, Triple, clipped, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    body_torque,
    sines_and_cosines,
    solve_by_pairs,
    torque_entries,
    vertical_force_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio
from tiltsim_controllers.vehicle.rigid_body import (
    angular_jerk,
    cross,
    euler_derivatives,
    torque_rate,
)


class FeedforwardTerms(NamedTuple):
    """What the law counts in: 1 or 0 each."""

    gait_rates: float = 1.0  # tilt rates in Ma
    attitude_rates: float = 1.0  # velocity and acceleration of the roll and pitch references
    reference_derivatives: float = 1.0  # acceleration, jerk and snap of the position reference
    euler_rates: float = 1.0  # exact derivatives of the Euler angles, else the body rates
    gyroscopic_torque: float = 1.0  # omega x I omega
    integral_action: float = 1.0


class Parameters(NamedTuple):
    """All that the law needs to know besides time and state."""

    vehicle: Vehicle
    gains: Gains
    integral: IntegralGains
    max_acceleration: float  # m/s^2 of the feedback, horizontally; integrators stop there
    max_angular_acceleration: float  # rad/s^2, each axis, asked of the body
    anticipation: float  # s before and after a corner of the gait in which the body turns
    ingredients: FeedforwardTerms
    gait: GaitParameters
    reference: ReferenceParameters
    decoupler: float  # NONE or EXACT
    supervisor: Supervisor = Supervisor()


INTEGRAL_FIELDS: Final = ("integral_x", "integral_y", "integral_z")
"""The law's own states: integrals of the position error, m s, world axes."""


# --- how the torque-free force and the attitude move -------------------------------------------


@scalar
def torque_free_force_jet(
    alpha_1: Jet, alpha_2: Jet, alpha_3: Jet, alpha_4: Jet, drag_ratio: float
) -> tuple[Jet, Jet, Jet]:
    """`tiltsim_controllers.vehicle.decoupling_matrix.torque_free_force` of moving tilt angles.

    Written in the sums and differences of opposite angles, with which the products of ch. 3 reduce
    to ``n_x = -sin(a2 - a4) A / 2r`` and the like.
    """
    sum_13, sum_24 = jet_sum(1.0, alpha_1, 1.0, alpha_3), jet_sum(1.0, alpha_2, 1.0, alpha_4)
    gap_13, gap_24 = jet_sum(1.0, alpha_1, -1.0, alpha_3), jet_sum(1.0, alpha_2, -1.0, alpha_4)
    sin_13, cos_13 = jet_sine(sum_13), jet_cosine(sum_13)
    sin_24, cos_24 = jet_sine(sum_24), jet_cosine(sum_24)
    r = drag_ratio
    # Yaw torque of each pair per unit of its inputs without roll or pitch torque, over -2r.
    yaw_13 = jet_sum(0.5 * (1.0 / r - r), sin_13, -1.0, cos_13)
    yaw_24 = jet_sum(0.5 * (r - 1.0 / r), sin_24, -1.0, cos_24)
    lift_13 = jet_sum(1.0, jet_sum(1.0, cos_13, 1.0, jet_cosine(gap_13)), r, sin_13)
    lift_24 = jet_sum(1.0, jet_sum(1.0, cos_24, 1.0, jet_cosine(gap_24)), -r, sin_24)
    return (
        jet_product(jet_scaled(-1.0, jet_sine(gap_24)), yaw_13),
        jet_product(jet_sine(gap_13), yaw_24),
        jet_sum(-1.0, jet_product(lift_13, yaw_24), -1.0, jet_product(lift_24, yaw_13)),
    )


@scalar
def exact_decoupler_jet(
    ax: Jet, ay: Jet, lift: Jet, yaw: Jet, nx: Jet, ny: Jet, nz: Jet
) -> tuple[Jet, Jet]:
    """`tiltsim_controllers.laws.decouplers.exact_decoupler` of moving arguments.

    ``lift`` is ``g + az``.

    NaN where the torque-free force has neither a side nor a vertical part. Where no roll reaches
    the wanted direction the nearest one is returned, at rest.
    """
    sin_yaw, cos_yaw = jet_sine(yaw), jet_cosine(yaw)
    dx = jet_sum(1.0, jet_product(ax, cos_yaw), 1.0, jet_product(ay, sin_yaw))
    dy = jet_sum(1.0, jet_product(ay, cos_yaw), -1.0, jet_product(ax, sin_yaw))
    side = 1.0 if nz[0] >= 0.0 else -1.0
    nx, ny, nz = jet_scaled(side, nx), jet_scaled(side, ny), jet_scaled(side, nz)
    across = jet_sum(1.0, jet_product(ny, ny), 1.0, jet_product(nz, nz))
    if across[0] == 0.0:
        return (nan, nan, nan), (nan, nan, nan)
    wanted = jet_sum(1.0, jet_product(dx, dx), 1.0, jet_product(lift, lift))
    force = jet_sum(1.0, across, 1.0, jet_product(nx, nx))
    length = jet_sum(1.0, wanted, 1.0, jet_product(dy, dy))
    if length[0] == 0.0:
        return (nan, nan, nan), (nan, nan, nan)
    # Roll makes  n_y cos(roll) - n_z sin(roll) = d_y |n| / |d|,  the part across the pitch axis.
    reach = jet_product(dy, jet_square_root(jet_quotient(force, length)))
    rest = jet_sum(1.0, across, -1.0, jet_product(reach, reach))
    turned = jet_angle(nz, ny)
    if rest[0] > 0.0:
        roll = jet_sum(1.0, jet_angle(jet_square_root(rest), reach), -1.0, turned)
    else:
        nearest = atan2(0.0, reach[0])
        roll = (nearest - turned[0], 0.0, 0.0)
    forward = jet_sum(1.0, jet_product(ny, jet_sine(roll)), 1.0, jet_product(nz, jet_cosine(roll)))
    pitch = jet_sum(1.0, jet_angle(dx, lift), -1.0, jet_angle(nx, forward))
    return roll, pitch


# --- how the body moves ------------------------------------------------------------------------


@scalar
def jerk_along(
    nx: Jet, ny: Jet, nz: Jet, specific: Triple, omega: Triple, counted: float
) -> Triple:
    """Jerk (m/s^3, body axes) of a body whose force stays along ``n``, of the size that it has.

    ``specific`` is the force per mass (m/s^2, body axes). It turns with the body and, ``counted``
    times, with ``n`` in it.
    """
    length = jet_square_root(
        jet_sum(
            1.0,
            jet_sum(1.0, jet_product(nx, nx), 1.0, jet_product(ny, ny)),
            1.0,
            jet_product(nz, nz),
        )
    )
    push_x, push_y, push_z = specific
    size = sqrt(push_x * push_x + push_y * push_y + push_z * push_z)
    if nz[0] < 0.0:
        size = -size
    size = size * counted
    swept = cross(omega, specific)
    return (
        swept[0] + size * jet_quotient(nx, length)[1],
        swept[1] + size * jet_quotient(ny, length)[1],
        swept[2] + size * jet_quotient(nz, length)[1],
    )


# --- the law -----------------------------------------------------------------------------------


@scalar
def limited_acceleration(x: Jet, y: Jet, limit: float) -> tuple[Jet, Jet]:
    """A horizontal acceleration scaled back to ``limit`` (m/s^2) where it is longer."""
    square = jet_sum(1.0, jet_product(x, x), 1.0, jet_product(y, y))
    if square[0] <= limit * limit:
        return x, y
    share = jet_quotient((limit, 0.0, 0.0), jet_square_root(square))
    return jet_product(x, share), jet_product(y, share)


@scalar
def position_feedback(
    error: Jet, jerk_error: float, integral: float, k1: float, k2: float, k3: float
) -> Jet:
    """``k1 e' + k2 e + k3 integral`` of a position error and its integral, and how it moves."""
    return (
        k1 * error[1] + k2 * error[0] + k3 * integral,
        k1 * error[2] + k2 * error[1] + k3 * error[0],
        k1 * jerk_error + k2 * error[2] + k3 * error[1],
    )


@scalar
def integrator_rate(error: float, wanted: float, limit: float) -> float:
    """Rate of an integrator of ``error``: it stops where it would push a limit further."""
    if abs(wanted) > limit and error * wanted > 0.0:
        return 0.0
    return error


@scalar
def attitude_jerk(wanted: Jet, now: Jet, k1: float, k2: float, k3: float, limit: float) -> float:
    """Third-order law (ch. 4, Eq. 26) around a reference that moves, with bounded effort.

    As long as nothing saturates, ``k1 e'' + k2 e' + k3 e``. Read as a cascade (the angle asks for a
    rate, the rate for an acceleration), the acceleration asked for by the errors is held to
    ``limit`` and the rate to what it brakes from, so that a large error does not stop a rotor.
    """
    rate = clipped(k3 / k2 * (wanted[0] - now[0]), -limit * k1 / k2, limit * k1 / k2)
    acceleration = clipped(k2 / k1 * (rate + wanted[1] - now[1]) + wanted[2], -limit, limit)
    return k1 * (acceleration - now[2])


@scalar
def planned_force(
    time: float,
    roll: float,
    pitch: float,
    supervisor_motion: Triple,
    parameters: Parameters,
    table: Sequence[float],
) -> tuple[Jet, Jet, Jet]:
    """The torque-free force ``n`` of the gait as it is commanded, with how it moves (body axes).

    That is the planned gait, or what a supervisor makes of it; ``supervisor_motion`` is the
    supervisor's state with its rate and acceleration.
    """
    gait, supervisor = parameters.gait, parameters.supervisor
    ratio = drag_ratio(parameters.vehicle)
    clock = gait_time(time, supervisor_motion, supervisor)
    share = supervised_gait_scale(
        tilt_reference(clock, gait, table), roll, pitch, supervisor, parameters.vehicle
    )
    alpha_1, alpha_2, alpha_3, alpha_4 = supervised_tilts(
        anticipated_tilts(clock, gait, table, parameters.anticipation),
        *(share, supervisor_motion, supervisor, ratio),
    )
    return torque_free_force_jet(alpha_1, alpha_2, alpha_3, alpha_4, ratio)


@scalar
def tracking_inputs(
    time: float,
    state: State,
    tilt_rates: Quad,
    integrals: Triple,
    parameters: Parameters,
    table: Sequence[float] = NO_KNOTS,
    supervisor_motion: Triple = SUPERVISOR_AT_REST,
) -> tuple[float, ...]:
    """Rotor accelerations, rates of the integrators, and the attitude asked for.

    ``state`` is `tiltsim_controllers.laws.attitude_altitude.STATE_FIELDS`, ``tilt_rates`` (rad/s)
    are those of its tilt angles, ``integrals`` the `INTEGRAL_FIELDS`, ``supervisor_motion`` the
    supervisor's state with its rate and acceleration. Returns four rotor accelerations
    (rad/s^2), three rates (m) and the references of roll, pitch and yaw (rad); NaN where the
    decoupling matrix is singular.
    """
    x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r, a1, a2, a3, a4, s1, s2, s3, s4 = state
    vehicle, gains, ingredients = parameters.vehicle, parameters.gains, parameters.ingredients
    reference, gravity = parameters.reference, vehicle.gravity
    ratio = drag_ratio(vehicle)
    per_force = vehicle.thrust_coefficient / vehicle.mass
    per_torque = vehicle.arm_length * vehicle.thrust_coefficient
    ixx, iyy, izz = vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz
    gyroscopic = ingredients.gyroscopic_torque

    # What the rotors do now, and how that changes while the pods turn and the speeds stay.
    trig = sines_and_cosines(a1, a2, a3, a4)
    sin_1, cos_1, sin_2, cos_2, sin_3, cos_3, sin_4, cos_4 = trig
    rate_1, rate_2, rate_3, rate_4 = tilt_rates
    counted = ingredients.gait_rates
    rate_1, rate_2 = counted * rate_1, counted * rate_2
    rate_3, rate_4 = counted * rate_3, counted * rate_4
    turning = (
        *(cos_1 * rate_1, -sin_1 * rate_1, cos_2 * rate_2, -sin_2 * rate_2),
        *(cos_3 * rate_3, -sin_3 * rate_3, cos_4 * rate_4, -sin_4 * rate_4),
    )
    w1, w2, w3, w4 = s1 * abs(s1), s2 * abs(s2), s3 * abs(s3), s4 * abs(s4)
    entries = torque_entries(trig, ratio)
    tx, ty, tz = body_torque(entries, w1, w2, w3, w4)
    hx, hy, hz = body_torque(torque_entries(turning, ratio), w1, w2, w3, w4)
    fx, fy, fz = body_force(trig, w1, w2, w3, w4)
    gx, gy, gz = body_force(turning, w1, w2, w3, w4)

    # Newton and Euler: accelerations of the body and of its Euler angles.
    rotation = rotation_from_euler(roll, pitch, yaw)
    specific = (per_force * fx, per_force * fy, per_force * fz)
    ax, ay, lift = to_world(rotation, specific)
    omega = (p, q, r)
    cx, cy, cz = cross(omega, (ixx * p, iyy * q, izz * r))
    omega_rate = (
        (per_torque * tx - gyroscopic * cx) / ixx,
        (per_torque * ty - gyroscopic * cy) / iyy,
        (per_torque * tz - gyroscopic * cz) / izz,
    )
    if ingredients.euler_rates == 0.0:
        roll_now = (roll, p, omega_rate[0])
        pitch_now = (pitch, q, omega_rate[1])
        yaw_now = (yaw, r, omega_rate[2])
    else:
        d_roll, d_pitch, d_yaw, dd_roll, dd_pitch, dd_yaw = euler_derivatives(
            roll, pitch, omega, omega_rate
        )
        roll_now, pitch_now = (roll, d_roll, dd_roll), (pitch, d_pitch, dd_pitch)
        yaw_now = (yaw, d_yaw, dd_yaw)

    # The position reference, and how far from it the vehicle is.
    motion = reference_derivatives(time, reference, table)
    known = ingredients.reference_derivatives
    x_ref, y_ref, z_ref, vx_ref, vy_ref, vz_ref = motion[:6]
    ax_ref, ay_ref, az_ref = known * motion[6], known * motion[7], known * motion[8]
    jx_ref, jy_ref, jz_ref = known * motion[9], known * motion[10], known * motion[11]
    sx_ref, sy_ref, sz_ref = known * motion[12], known * motion[13], known * motion[14]
    ex, ey, ez = x_ref - x, y_ref - y, z_ref - z
    evx, evy, evz = vx_ref - vx, vy_ref - vy, vz_ref - vz
    integrating = ingredients.integral_action
    of_position = integrating * parameters.integral.position
    of_altitude = integrating * parameters.integral.altitude

    # Altitude: third order, as ch. 4, Eq. (27), plus the integral.
    altitude_jerk = (
        jz_ref
        + gains.altitude_1 * (az_ref - (lift - gravity))
        + gains.altitude_2 * evz
        + gains.altitude_3 * ez
        + of_altitude * integrals[2]
    )

    # Position: the horizontal acceleration that takes the vehicle back, and how it changes.
    limit = parameters.max_acceleration
    xi_rate = yi_rate = 0.0
    roll_ref, pitch_ref = (reference.roll, 0.0, 0.0), (reference.pitch, 0.0, 0.0)
    if parameters.decoupler != NONE:
        nx, ny, nz = planned_force(time, roll, pitch, supervisor_motion, parameters, table)
        jx, jy, _ = to_world(rotation, jerk_along(nx, ny, nz, specific, omega, counted))
        k1, k2 = gains.position_1, gains.position_2
        back_x = position_feedback(
            (ex, evx, ax_ref - ax), jx_ref - jx, integrals[0], k1, k2, of_position
        )
        back_y = position_feedback(
            (ey, evy, ay_ref - ay), jy_ref - jy, integrals[1], k1, k2, of_position
        )
        xi_rate = integrator_rate(ex, back_x[0], limit)
        yi_rate = integrator_rate(ey, back_y[0], limit)
        back_x, back_y = limited_acceleration(back_x, back_y, limit)
        roll_ref, pitch_ref = exact_decoupler_jet(
            jet_sum(1.0, (ax_ref, jx_ref, sx_ref), 1.0, back_x),
            jet_sum(1.0, (ay_ref, jy_ref, sy_ref), 1.0, back_y),
            (gravity + az_ref, jz_ref, sz_ref),
            yaw_now,
            *(nx, ny, nz),
        )
        if ingredients.attitude_rates == 0.0:
            roll_ref, pitch_ref = (roll_ref[0], 0.0, 0.0), (pitch_ref[0], 0.0, 0.0)
    climb = gains.altitude_2 * evz + gains.altitude_3 * ez + of_altitude * integrals[2]
    zi_rate = integrator_rate(ez, climb, gains.altitude_1 * limit)

    # Third-order laws on the attitude, as ch. 4, Eq. (26), around references that move.
    most = parameters.max_angular_acceleration
    yaw_error = wrap_angle(reference.yaw - yaw)
    roll_jerk = attitude_jerk(roll_ref, roll_now, gains.roll_1, gains.roll_2, gains.roll_3, most)
    pitch_jerk = attitude_jerk(
        pitch_ref, pitch_now, gains.pitch_1, gains.pitch_2, gains.pitch_3, most
    )
    yaw_ref = (yaw + yaw_error, 0.0, 0.0)
    yaw_jerk = attitude_jerk(yaw_ref, yaw_now, gains.yaw_1, gains.yaw_2, gains.yaw_3, most)
    jerk = (roll_jerk, pitch_jerk, yaw_jerk)
    wanted = (
        jerk if ingredients.euler_rates == 0.0 else angular_jerk(roll_now, pitch_now, yaw_now, jerk)
    )

    # The torques must change so that omega'' comes out; what turns by itself is taken off.
    mx, my, mz = torque_rate(omega, omega_rate, wanted, (ixx, iyy, izz), gyroscopic)

    # Likewise the lift: the force turns with the body and with the pods.
    up_x, up_y, up_z = rotation[6], rotation[7], rotation[8]
    sweep_x, sweep_y, sweep_z = cross(omega, (fx, fy, fz))
    swept_lift = up_x * (sweep_x + gx) + up_y * (sweep_y + gy) + up_z * (sweep_z + gz)
    v1, v2, v3, v4 = solve_by_pairs(
        entries,
        vertical_force_entries(trig, up_x, up_y, up_z),
        (mx - per_torque * hx) / per_torque,
        (my - per_torque * hy) / per_torque,
        (mz - per_torque * hz) / per_torque,
        altitude_jerk / per_force - swept_lift,
    )
    if s1 == 0.0 or s2 == 0.0 or s3 == 0.0 or s4 == 0.0:
        v1 = v2 = v3 = v4 = nan
    else:
        v1, v2 = 0.5 * v1 / abs(s1), 0.5 * v2 / abs(s2)
        v3, v4 = 0.5 * v3 / abs(s3), 0.5 * v4 / abs(s4)
    return (
        *(v1, v2, v3, v4, xi_rate, yi_rate, zi_rate),
        *(roll_ref[0], pitch_ref[0], reference.yaw),
    )
