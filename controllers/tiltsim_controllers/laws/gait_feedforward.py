"""Attitude-altitude linearization with feed-forward of the gait's motion and integral action.

The published controller (`tiltsim_controllers.laws.attitude_altitude`) treats the tilt angles and
the references of roll and pitch as constant, so it lags behind a moving gait. But the gait is
planned: its rates are known, and with them the derivatives of all that depends on it. This
controller

* includes the tilt rates in ``Ma``: torque and force change with the tilt, ``(d tau / d alpha)
  alpha' w`` and ``(d F / d alpha) alpha' w``;
* gives roll and pitch the velocity and acceleration with which the exact decoupler's solution moves
  as the torque-free force ``n(alpha(t))`` turns in the body;
* follows the position reference up to its snap;
* differentiates Euler angles exactly, where ch. 3, Eq. (8), uses body rates for their rates, and
  includes the gyroscopic torque;
* integrates the position error, so that a constant disturbance leaves no steady error. The
  integrators stop where the desired acceleration is at its limit (anti-windup).

Each of these terms can be omitted, to measure its effect.
"""

from __future__ import annotations

from math import nan
from typing import Any, Final, NamedTuple

from tiltsim_controllers.gaits.anticipation import anticipated_tilts
from tiltsim_controllers.gaits.parameters import NO_KNOTS, GaitParameters
from tiltsim_controllers.gaits.tilts import moving_tilts
from tiltsim_controllers.laws.attitude_altitude import Gains
from tiltsim_controllers.laws.decouplers import NONE
from tiltsim_controllers.laws.feedback import (
    attitude_jerk,
    attitude_motion,
    force_control,
    integrator_rate,
    limited_acceleration,
    position_feedback,
)
from tiltsim_controllers.laws.force_motion import (
    exact_decoupler_jet,
    jerk_along,
    torque_free_force_jet,
)
from tiltsim_controllers.laws.gains import IntegralGains
from tiltsim_controllers.laws.rotor_spin import spin_momentum, spin_torques
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST, Supervisor, gait_time
from tiltsim_controllers.laws.tiltrotor_supervisor import SUPERVISION
from tiltsim_controllers.mathematics.jets import Jet, Jets3, jet_sum
from tiltsim_controllers.mathematics.rotation import rotation_from_euler, to_world, wrap_angle
from tiltsim_controllers.mathematics.scalar import Pair, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    body_torque,
    sines_and_cosines,
    solve_by_pairs,
    torque_entries,
    trigonometric_rates,
    vertical_force_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio
from tiltsim_controllers.vehicle.rigid_body import (
    angular_acceleration,
    angular_jerk,
    cross,
    torque_rate,
)


class FeedforwardTerms(NamedTuple):
    """The terms that the controller includes: 1 or 0 each."""

    gait_rates: float = 1.0  # tilt rates in Ma
    attitude_rates: float = 1.0  # velocity and acceleration of the roll and pitch references
    reference_derivatives: float = 1.0  # acceleration, jerk and snap of the position reference
    euler_rates: float = 1.0  # exact derivatives of the Euler angles, else the body rates
    gyroscopic_torque: float = 1.0  # omega x I omega
    integral_action: float = 1.0


class Parameters(NamedTuple):
    """Parameters of the controller."""

    vehicle: Vehicle
    gains: Gains
    integral: IntegralGains
    max_acceleration: float  # m/s^2 of the feedback, horizontally; integrators stop there
    max_angular_acceleration: float  # rad/s^2, desired, per axis
    anticipation: float  # s before and after a corner of the gait in which the body turns
    terms: FeedforwardTerms
    gait: GaitParameters
    reference: ReferenceParameters
    decoupler: float  # NONE or EXACT
    supervisor: Supervisor = Supervisor()
    rotor_inertia: float = 0.0  # kg m^2, of a rotor about its axis, as far as it is known


INTEGRAL_FIELDS: Final = ("integral_x", "integral_y", "integral_z")
"""The controller's own states: integrals of the position error, m s, world axes."""


# --- the gait ----------------------------------------------------------------------------------


_gait_scale, _supervised_tilts = SUPERVISION.gait_scale, SUPERVISION.tilts


@scalar
def _planned_force(
    time: float, attitude: Pair, supervisor_motion: Triple, parameters: Parameters, knots: Vector
) -> Jets3:
    """The torque-free force ``n`` of the commanded gait with its derivatives, body axes.

    That is the planned gait, or the supervised one.
    """
    gait, supervisor = parameters.gait, parameters.supervisor
    roll, pitch = attitude
    ratio = drag_ratio(parameters.vehicle)
    clock = gait_time(time, supervisor_motion, supervisor)
    planned, _ = moving_tilts(clock, gait, knots)
    scale = _gait_scale(planned, roll, pitch, supervisor, ratio, knots)
    tilts = anticipated_tilts(clock, gait, knots, parameters.anticipation)
    a1, a2, a3, a4 = _supervised_tilts(tilts, scale, supervisor_motion, supervisor, ratio)
    return torque_free_force_jet((a1, a2, a3, a4), ratio)


# --- steps of the control law ------------------------------------------------------------------


@scalar
def tracking_errors(
    time: float, state: Values, specific: Triple, parameters: Any, knots: Vector
) -> tuple[Jets3, Jets3]:
    """Position errors along x, y and z, and the reference's accelerations, with derivatives.

    Args:
        time: s
        state: begins with position (m) and velocity (m/s), world axes
        specific: force per mass, m/s^2, world axes
        parameters, knots: of the controller, and of gait and reference
    """
    known = parameters.terms.reference_derivatives
    x, y, z, vx, vy, vz = state[:6]
    motion = reference_derivatives(time, parameters.reference, knots)
    x_ref, y_ref, z_ref, vx_ref, vy_ref, vz_ref, ax, ay, az, jx, jy, jz, sx, sy, sz = motion
    ax_ref, ay_ref, az_ref = known * ax, known * ay, known * az
    errors = (
        (x_ref - x, vx_ref - vx, ax_ref - specific[0]),
        (y_ref - y, vy_ref - vy, ay_ref - specific[1]),
        (z_ref - z, vz_ref - vz, az_ref - (specific[2] - parameters.vehicle.gravity)),
    )
    accelerations = (
        (ax_ref, known * jx, known * sx),
        (ay_ref, known * jy, known * sy),
        (az_ref, known * jz, known * sz),
    )
    return errors, accelerations


@scalar
def horizontal_control(
    errors: Jets3, accelerations: Jets3, jerk: Triple, integrals: Triple, parameters: Any
) -> tuple[Jet, Jet, float, float]:
    """Desired horizontal acceleration with derivatives, and integrator rates of x and y.

    Args:
        errors, accelerations: as `tracking_errors` returns them
        jerk: of the body, m/s^3, world axes
        integrals: `INTEGRAL_FIELDS`
        parameters: of the controller
    """
    terms, limit = parameters.terms, parameters.max_acceleration
    k3 = terms.integral_action * parameters.integral.position
    gains = (parameters.gains.position_1, parameters.gains.position_2, k3)
    error_x, error_y, _ = errors
    along_x, along_y, _ = accelerations
    back_x = position_feedback(error_x, along_x[1] - jerk[0], integrals[0], gains)
    back_y = position_feedback(error_y, along_y[1] - jerk[1], integrals[1], gains)
    x_rate = integrator_rate(error_x[0], back_x[0], limit)
    y_rate = integrator_rate(error_y[0], back_y[0], limit)
    back_x, back_y = limited_acceleration(back_x, back_y, limit)
    return jet_sum(1.0, along_x, 1.0, back_x), jet_sum(1.0, along_y, 1.0, back_y), x_rate, y_rate


@scalar
def decoupled_attitude(
    x: Jet, y: Jet, z: Jet, yaw: Jet, force: Jets3, parameters: Any
) -> tuple[Jet, Jet]:
    """References of roll and pitch with derivatives, from a desired acceleration.

    Args:
        x, y, z: the desired acceleration, m/s^2, world axes
        yaw: rad
        force: the torque-free force, of arbitrary unit, body axes
        parameters: of the controller
    """
    lift = (parameters.vehicle.gravity + z[0], z[1], z[2])
    roll, pitch = exact_decoupler_jet(x, y, lift, yaw, force)
    if parameters.terms.attitude_rates == 0.0:
        return (roll[0], 0.0, 0.0), (pitch[0], 0.0, 0.0)
    return roll, pitch


@scalar
def altitude_control(
    error: Jet, acceleration: Jet, integral: float, parameters: Any
) -> tuple[float, float]:
    """Desired vertical jerk (ch. 4, Eq. 27, plus the integral), and the integrator's rate.

    Args:
        error, acceleration: the altitude's, and that of its reference, with derivatives
        integral: of the error, m s
        parameters: of the controller
    """
    gains = parameters.gains
    k4 = parameters.terms.integral_action * parameters.integral.altitude
    return force_control(
        error,
        acceleration,
        integral,
        (gains.altitude_1, gains.altitude_2, gains.altitude_3, k4),
        parameters.max_acceleration,
    )


@scalar
def attitude_control(roll_ref: Jet, pitch_ref: Jet, attitude: Jets3, parameters: Any) -> Triple:
    """Desired second derivatives (rad/s^3) of the body rates.

    Args:
        roll_ref, pitch_ref: references with derivatives, rad
        attitude: roll, pitch and yaw with derivatives, rad
        parameters: of the controller
    """
    gains, limit = parameters.gains, parameters.max_angular_acceleration
    roll, pitch, yaw = attitude
    yaw_error = wrap_angle(parameters.reference.yaw - yaw[0])
    yaw_ref = (yaw[0] + yaw_error, 0.0, 0.0)
    jerk = (
        attitude_jerk(roll_ref, roll, (gains.roll_1, gains.roll_2, gains.roll_3), limit),
        attitude_jerk(pitch_ref, pitch, (gains.pitch_1, gains.pitch_2, gains.pitch_3), limit),
        attitude_jerk(yaw_ref, yaw, (gains.yaw_1, gains.yaw_2, gains.yaw_3), limit),
    )
    if parameters.terms.euler_rates == 0.0:
        return jerk
    return angular_jerk(roll, pitch, yaw, jerk)


# --- the control law ---------------------------------------------------------------------------


@scalar
def _leaning(
    time: float,
    motion: tuple[Jets3, Values, Triple],
    specific: Triple,
    errors: Jets3,
    accelerations: Jets3,
    integrals: Triple,
    supervisor_motion: Triple,
    parameters: Parameters,
    knots: Vector,
) -> tuple[Jet, Jet, float, float]:
    """References of roll and pitch (rad) with derivatives, and integrator rates of x and y (m).

    Args:
        time: s
        motion: Euler angles with derivatives, rotation and body rates
        specific: force per mass, m/s^2, body axes
        errors, accelerations: as `tracking_errors` returns them
        integrals, supervisor_motion, parameters, knots: as of `tracking_inputs`
    """
    reference, (attitude, rotation, omega) = parameters.reference, motion
    if parameters.decoupler == NONE:
        return (reference.roll, 0.0, 0.0), (reference.pitch, 0.0, 0.0), 0.0, 0.0
    angles = (attitude[0][0], attitude[1][0])
    force = _planned_force(time, angles, supervisor_motion, parameters, knots)
    jerk = to_world(rotation, jerk_along(force, specific, omega, parameters.terms.gait_rates))
    along_x, along_y, x_rate, y_rate = horizontal_control(
        errors, accelerations, jerk, integrals, parameters
    )
    roll, pitch = decoupled_attitude(
        along_x, along_y, accelerations[2], attitude[2], force, parameters
    )
    return roll, pitch, x_rate, y_rate


@scalar
def _rotor_accelerations(rates: Quad, speeds: Quad) -> Quad:
    """From the rates of ``varpi |varpi|``; NaN where a rotor is at rest."""
    v1, v2, v3, v4 = rates
    s1, s2, s3, s4 = speeds
    if s1 == 0.0 or s2 == 0.0 or s3 == 0.0 or s4 == 0.0:
        return nan, nan, nan, nan
    return 0.5 * v1 / abs(s1), 0.5 * v2 / abs(s2), 0.5 * v3 / abs(s3), 0.5 * v4 / abs(s4)


@scalar
def tracking_inputs(
    time: float,
    state: Values,
    tilt_rates: Quad,
    integrals: Triple,
    parameters: Parameters,
    knots: Vector = NO_KNOTS,
    supervisor_motion: Triple = SUPERVISOR_AT_REST,
    measured: Triple | None = None,
) -> Values:
    """Rotor accelerations (rad/s^2, singular: NaN), integrator rates (m), attitude to track (rad).

    Args:
        time: s
        state: `tiltsim_controllers.vehicle.states.TILTROTOR_FIELDS`
        tilt_rates: rates of its tilt angles, rad/s
        integrals: `INTEGRAL_FIELDS`
        parameters, knots: of the controller, and of gait and reference
        supervisor_motion: the supervisor's state with its rate and acceleration
        measured: the angular acceleration (rad/s^2, body axes); None takes the model's
    """
    _, _, _, _, _, _, roll, pitch, yaw, p, q, r, a1, a2, a3, a4, s1, s2, s3, s4 = state
    vehicle, terms, reference = parameters.vehicle, parameters.terms, parameters.reference
    inertia = (vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz)
    ratio = drag_ratio(vehicle)
    per_force = vehicle.thrust_coefficient / vehicle.mass
    per_torque = vehicle.arm_length * vehicle.thrust_coefficient

    # Force and torque, and their rates as the pods turn at constant rotor speeds.
    trig = sines_and_cosines(a1, a2, a3, a4)
    (r1, r2, r3, r4), known = tilt_rates, terms.gait_rates
    rates = (known * r1, known * r2, known * r3, known * r4)
    turning = trigonometric_rates(trig, rates)
    spin = spin_momentum(trig, rates, (s1, s2, s3, s4), parameters.rotor_inertia)
    w1, w2, w3, w4 = s1 * abs(s1), s2 * abs(s2), s3 * abs(s3), s4 * abs(s4)
    entries = torque_entries(trig, ratio)
    tx, ty, tz = body_torque(entries, w1, w2, w3, w4)
    hx, hy, hz = body_torque(torque_entries(turning, ratio), w1, w2, w3, w4)
    fx, fy, fz = body_force(trig, w1, w2, w3, w4)
    gx, gy, gz = body_force(turning, w1, w2, w3, w4)

    # Newton and Euler: accelerations of the body and of its Euler angles.
    omega = (p, q, r)
    (kx, ky, kz), _ = spin_torques(spin, omega, (0.0, 0.0, 0.0))
    torque = (per_torque * tx - kx, per_torque * ty - ky, per_torque * tz - kz)
    if measured is None:
        omega_rate = angular_acceleration(torque, omega, inertia, terms.gyroscopic_torque)
    else:
        omega_rate = measured
    attitude = attitude_motion((roll, pitch, yaw), omega, omega_rate, terms.euler_rates)
    rotation = rotation_from_euler(roll, pitch, yaw)
    specific = (per_force * fx, per_force * fy, per_force * fz)

    # Position and attitude control.
    errors, accelerations = tracking_errors(
        time, state, to_world(rotation, specific), parameters, knots
    )
    roll_ref, pitch_ref, x_rate, y_rate = _leaning(
        time, (attitude, rotation, omega), specific, errors, accelerations, integrals,
        supervisor_motion, parameters, knots,
    )  # fmt: skip
    lift_jerk, z_rate = altitude_control(errors[2], accelerations[2], integrals[2], parameters)
    desired = attitude_control(roll_ref, pitch_ref, attitude, parameters)

    # Rates of torque and lift that remain for the rotors.
    mx, my, mz = torque_rate(omega, omega_rate, desired, inertia, terms.gyroscopic_torque)
    _, (kx, ky, kz) = spin_torques(spin, omega, omega_rate)
    up_x, up_y, up_z = rotation[6], rotation[7], rotation[8]
    sweep_x, sweep_y, sweep_z = cross(omega, (fx, fy, fz))
    swept_lift = up_x * (sweep_x + gx) + up_y * (sweep_y + gy) + up_z * (sweep_z + gz)
    rates_of_w = solve_by_pairs(
        entries,
        vertical_force_entries(trig, up_x, up_y, up_z),
        (mx + kx - per_torque * hx) / per_torque,
        (my + ky - per_torque * hy) / per_torque,
        (mz + kz - per_torque * hz) / per_torque,
        lift_jerk / per_force - swept_lift,
    )
    found = _rotor_accelerations(rates_of_w, (s1, s2, s3, s4))
    return (*found, x_rate, y_rate, z_rate, roll_ref[0], pitch_ref[0], reference.yaw)
