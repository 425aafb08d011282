"""Feedback linearization of any rotorcraft: attitude, and the force as far as possible.

At zero torque the rotors push anywhere in ``V = F ker tau`` (body axes), of dimension 1, 2 or 3. So
the outputs are the attitude and 1, 2 or 3 components of force:

- 1: along world up. The horizontal position is controlled by leaning; with four rotors this is the
  attitude-altitude controller of ch. 3 and 4;
- 2: along world up, and across it within V. The rest is controlled by leaning. A vehicle with all
  three that is to use two (``forward``) pushes within its x-z plane;
- 3: all of it. The attitude is free: the vehicle flies level, or as the reference says.

The decoupling matrix ``[tau; b^T F]`` with the directions ``b`` of the force has rank 3 + dimension
wherever the margin is positive, for any number of rotors. Among the inputs that give the desired
third derivatives, the controller takes the ones nearest to zero or, with ``restoring``, to a motion
toward the least power; the part that no output sees would otherwise drift where the pods move. The
norm measures rotor accelerations (``speed``), in which no rotor comes to rest while the others can
do its part, or rates of ``w = varpi |varpi|`` (``thrust``), for rotors that reverse; ``restoring``
then leads to the least sum of ``w^2``.

The decoupler, as with four rotors, uses the side of the torque-free force that points up in body
axes. So the z axis of a vehicle has to be its upper side.

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

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.laws.attitude_altitude import PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.feedback import (
    EXACT,
    NO_DECOUPLER,
    angular_jerk,
    attitude_jerk,
    attitude_motion,
    body_rate_matrix,
    decoupled,
    force_control,
    integrator_rate,
    limited_acceleration,
    position_feedback,
    swept,
)
from tiltsim_controllers.laws.force_directions import (
    factors,
    jerk_along,
    moving_direction,
    nearest_in_plane,
    share,
)
from tiltsim_controllers.laws.multirotor_keys import ROTATION, Form
from tiltsim_controllers.laws.observed import UNHARMED, Seen, Step, working
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix, wrapped
from tiltsim_controllers.mathematics.linear import cross, nearest_solution
from tiltsim_controllers.mathematics.moving import Moving, at_rest, cosine, sine, stacked, value_of
from tiltsim_controllers.references.trajectories import POSES, reference_attitude, reference_motion
from tiltsim_controllers.vehicle.body import (
    RotorcraftState,
    angular_acceleration,
    state_of,
    torque_rate,
)
from tiltsim_controllers.vehicle.rotors import (
    TiltOfRotor,
    airframe,
    moving_wrench_map,
    rotor_accelerations,
)

NULL_PART: Final = "null_part"
"""A signal: the share of the rotors' ``varpi |varpi|`` that neither force nor torque show."""

SIGNALS: Final = ("roll_ref", "pitch_ref", "yaw_ref", NULL_PART)
"""Signals of the law: the attitude that it tracks, rad, and the null part."""


class Present(NamedTuple):
    """The vehicle as the law sees it."""

    state: RotorcraftState  # state of the vehicle
    rotation: Any  # body to world, shape (3, 3)
    omega_rate: Any  # rates of the body rates, rad/s^2, shape (3,)
    specific: Moving  # force per mass, m/s^2, body axes, with its rate by the motion of the pods
    direction: Any  # the ``direction`` of `force_directions`, moving or not


def turned(time: Any, angle: Any, duration: Any) -> Any:
    """An angle (rad) that is reached from zero within a duration (s), with continuous acceleration.

    ``angle s^3 (10 - 15 s + 6 s^2)``; without a duration the angle itself.
    """
    turns = time < duration
    period = xp.where(turns, duration, 1.0)
    s = Moving(xp.where(turns, time / period, 1.0), xp.where(turns, 1.0 / period, 0.0), 0.0)
    return angle * (s * s * s * (10.0 + s * (6.0 * s - 15.0)))


class Tracking(NamedTuple):
    """Motion to track, world axes."""

    error: Moving  # position error, m
    acceleration: Moving  # acceleration of the reference, m/s^2, as far as the law passes it on


def _tracking(now: RotorcraftState, reference: Any, specific: Any, p: Any) -> Tracking:
    """The motion to track; reference (5, 3) and force per mass (3,) are in world axes, m and s."""
    ahead = p.terms.reference_derivatives * reference[2:]
    fall = xp.array([0.0, 0.0, p.vehicle.gravity])
    error = Moving(
        reference[0] - now.position, reference[1] - now.velocity, ahead[0] - (specific - fall)
    )
    return Tracking(error, Moving(ahead[0], ahead[1], ahead[2]))


def _horizontal_control(motion: Tracking, jerk: Any, integrals: Any, p: Any) -> tuple[Moving, Any]:
    """Desired acceleration along x and y (m/s^2), and integrator rates (m), at a jerk (m/s^3)."""
    k3 = p.terms.integral_action * p.integral.position
    error, ahead = motion.error[:2], motion.acceleration[:2]
    back = position_feedback(error, ahead.rate - jerk[:2], integrals[:2], (*p.gains.position, k3))
    rates = integrator_rate(error.value, back.value, p.max_acceleration)
    return ahead + limited_acceleration(back, p.max_acceleration), rates


def side_control(motion: Tracking, integrals: Any, p: Any) -> tuple[Any, Any]:
    """Desired jerk (m/s^3) of x and y as far as force moves them, and integrator rates (m)."""
    k4 = p.terms.integral_action * p.side_integral
    gains = (*p.side_gains, k4)
    error, limit = motion.error[:2], p.max_acceleration
    return force_control(error, motion.acceleration.rate[:2], integrals[:2], gains, limit)


def _altitude_control(motion: Tracking, integrals: Any, p: Any) -> tuple[Any, Any]:
    """Desired vertical jerk (m/s^3; ch. 4, Eq. 27, with an integral), and integrator rate (m)."""
    k4 = p.terms.integral_action * p.integral.altitude
    gains, limit = (*p.gains.altitude, k4), p.max_acceleration
    return force_control(motion.error[2], motion.acceleration.rate[2], integrals[2], gains, limit)


def _euler_control(roll: Moving, pitch: Moving, attitude: Moving, p: Any) -> Any:
    """Desired second derivatives (rad/s^3) of the body rates by Euler angles; yaw is at rest."""
    yaw = attitude.value[2]
    desired = stacked(roll, pitch, yaw + wrapped(p.reference.yaw - yaw))
    jerk = attitude_jerk(desired, attitude, p.gains.attitude, p.max_angular_acceleration)
    return angular_jerk(attitude, jerk) if p.terms.euler_rates else jerk


def rotation_control(
    attitude: Sequence[Moving], rotation: Any, omega: Any, omega_rate: Any, p: Any
) -> Any:
    """Desired second derivatives (rad/s^3) of the body rates, by the rotation that remains.

    Args:
        attitude: References of roll, pitch and yaw, rad.
        rotation: Body to world, shape (3, 3).
        omega, omega_rate: Body rates (rad/s) and their rates (rad/s^2), shape (3,) each.
        p: Parameters of the controller.
    """
    desired = rotation_matrix(xp.array([angle.value for angle in attitude]))
    # Rates of the desired attitude in its own axes, then in body axes.
    rates = stacked(*(Moving(angle.rate, angle.acceleration, 0.0) for angle in attitude))
    turning = rotation.T @ (desired @ (body_rate_matrix(*attitude[:2]) @ rates))
    second = turning.rate - cross(omega, turning.value)
    return attitude_jerk(
        Moving(attitude_error(rotation, desired), turning.value, second),
        Moving(0.0, omega, omega_rate),
        p.gains.attitude,
        p.max_angular_acceleration,
    )


def _target(time: Any, p: Any, knots: Any) -> tuple[Moving, Moving, Moving]:
    """References of roll, pitch and yaw, rad."""
    target, duration = p.reference, p.turn_time
    if target.type == POSES:
        roll, pitch, yaw = reference_attitude(time, target, knots)[:3].T
        return Moving(*roll), Moving(*pitch), Moving(*yaw)
    roll, pitch = (turned(time, angle, duration) for angle in (target.roll, target.pitch))
    return roll, pitch, at_rest(target.yaw)


def _leaning(
    present: Present, motion: Tracking, yaw: Any, integrals: Any, p: Any, form: Form
) -> tuple[Moving, Moving, Any]:
    """References of roll and pitch (rad) that move the vehicle, and integrator rates (m)."""
    force, specific, omega = present.direction, present.specific, present.state.omega
    gravity, body_jerk = p.vehicle.gravity, xp.zeros(3)  # counts only for the attitude's rates
    if form.dimension == 2:
        body_jerk = cross(omega, specific.value) + specific.rate
    elif p.terms.attitude_rates:
        body_jerk = jerk_along(force, specific.value, omega, p.terms.gait_rates)
    leaning, rates = _horizontal_control(motion, present.rotation @ body_jerk, integrals, p)
    along = stacked(leaning[0], leaning[1], motion.acceleration[2])
    if form.dimension == 2:  # in axes of the yaw
        (x, y, z), s, c = (along[0], along[1], along[2]), sine(yaw), cosine(yaw)
        force = nearest_in_plane(stacked(x * c + y * s, y * c - x * s, gravity + z), force)
    if p.decoupler == EXACT and p.terms.attitude_rates != 0.0:
        roll, pitch = decoupled(p.decoupler, along, yaw, gravity, force)
        return roll, pitch, rates
    roll, pitch = decoupled(p.decoupler, along.value, value_of(yaw), gravity, value_of(force))
    return at_rest(roll), at_rest(pitch), rates


def _control(
    present: Present, reference: Any, target: Any, integrals: Any, p: Any, form: Form
) -> tuple[Any, ...]:
    """Desired jerk (m/s^3, world), second derivatives of body rates, integral rates, lean (rad)."""
    now, rotation, terms = present.state, present.rotation, p.terms
    attitude = attitude_motion(
        now.attitude, now.omega, present.omega_rate, exact=terms.euler_rates != 0.0
    )
    (roll, pitch, yaw_ref), yaw = target, attitude[2]
    if p.attitude_error == ROTATION or not (terms.attitude_rates or form.own_yaw):
        yaw = yaw_ref if p.reference.type == POSES else p.reference.yaw
    motion = _tracking(now, reference, rotation @ present.specific.value, p)
    jerk, rates = xp.zeros(2), xp.zeros(2)
    if form.dimension > 1:
        jerk, rates = side_control(motion, integrals, p)
    if form.dimension < 3 and p.decoupler != NO_DECOUPLER:
        roll, pitch, rates = _leaning(present, motion, yaw, integrals, p, form)
    climb, climb_rate = _altitude_control(motion, integrals, p)
    if p.attitude_error == ROTATION:
        leaning = roll, pitch, yaw_ref
        angular = rotation_control(leaning, rotation, now.omega, present.omega_rate, p)
    else:
        angular = _euler_control(roll, pitch, attitude, p)
    jerk, rates = xp.hstack([jerk, climb]), xp.hstack([rates, climb_rate])
    return jerk, angular, rates, xp.array([roll.value, pitch.value])


def _per_unknown(wrench: Any, speeds: Any, published: bool, form: Form) -> tuple[Any, Any]:
    """Force and torque per unknown of the norm, and the force with the torque's factor.

    A rotor acceleration changes ``w`` by ``2 |varpi|``. Ch. 3 prints that factor in rows of the
    force only.
    """
    if form.norm == "thrust":
        return wrench, wrench[:3]
    gain = 2.0 * abs(speeds)
    turns = xp.ones(len(speeds)) if published else gain
    return xp.vstack([wrench[:3] * gain, wrench[3:] * turns]), wrench[:3] * turns


def _start(w: Any, speeds: Any, p: Any, form: Form) -> Any:
    """Unknowns to which the solution is nearest: zero, or a motion toward the least power.

    The power is proportional to the sum of ``|varpi|^3``.
    """
    count = len(speeds)
    if count == 3 + form.dimension:
        return xp.zeros(count)  # there is one solution
    if form.norm == "thrust":
        return -p.restoring * w
    total = abs(speeds).sum()
    return -p.restoring * count / xp.where(total == 0.0, xp.inf, total) * w


def _null_part(wrench: Any, up: Any, w: Any, form: Form) -> Any:
    """The share of ``w`` that the outputs do not see, whatever the norm, from 0 to 1."""
    # In the norm of accelerations a rotor that comes to rest would take the share with it.
    if len(w) <= 3 + form.dimension:
        return 0.0
    units = factors(wrench, wrench[:3], up, form.dimension, form.forward).units
    seen, whole = xp.array([unit @ w for unit in units]), w @ w
    rest = 1.0 - seen @ seen / xp.where(whole > 0.0, whole, 1.0)
    return xp.where(whole > 0.0, xp.sqrt(xp.maximum(rest, 0.0)), 0.0)


@traceable
def independence(wrench: Any, up: Any, side: Any, form: Form) -> Any:
    """How independent the outputs are: 1 at best, 0 where the decoupling matrix is singular.

    It is the share of the force's rows that remains without the rows of the torque, and without
    each other. With one component of force the number is negative where lift pushes against a side.

    Args:
        wrench: Force and torque per unit of ``w``, shape (6, N).
        up: World up in body axes, shape (3,).
        side: A direction of the force, body axes, shape (3,).
        form: Options of the law.
    """
    found = factors(wrench, wrench[:3], up, form.dimension, form.forward)
    product = 1.0
    for row, unit in zip(found.rows, found.units[3:]):
        product = product * share(row, unit)
    if form.dimension == 1:
        against = found.units[3] @ (side @ wrench[:3]) < 0.0
        return xp.where(product > 0.0, xp.where(against, -product, product), 0.0)
    return xp.where(product > 0.0, product, 0.0)


def present_wrench(seen: Seen, p: Any, knots: Any, layout: TiltOfRotor) -> tuple[Any, Any]:
    """Force and torque per unit of ``w`` (6, N) without failed rotors, and world up in body axes.

    Args:
        seen, p, knots, layout: See `attitude_force`.
    """
    now, (_, rotors) = state_of(seen.state, layout), airframe(p, knots, layout)
    works = working(seen.time, getattr(p, "failure", UNHARMED), len(layout))
    wrench = moving_wrench_map(rotors.masked(works), at_rest(now.tilts)).value
    return wrench, rotation_matrix(now.attitude)[2]


def attitude_force(
    seen: Seen, plan: Any, p: Any, knots: Any, layout: TiltOfRotor, form: Form
) -> Step:
    """Rotor accelerations (rad/s^2), integrator rates (m), and as signals (`SIGNALS`) the rest.

    NaN where the decoupling matrix is singular. The null part is the share, from 0 to 1, of ``w``
    that the outputs do not see; ``restoring`` keeps it near its least.

    Args:
        seen: Its states are the `INTEGRAL_FIELDS`.
        plan: Tilt angles (rad) with two derivatives by which the body is to turn, shape (M, 3);
            None for pods that do not move, or whose motion does not count.
        p: `Parameters` of `multirotor_keys` or of `gait_feedforward`.
        knots: Table data of the flight, with the table of the rotors.
        layout: Tilts of the rotors.
        form: Options of the law.
    """
    time, measured = seen.time, seen.measured
    now, (body, rotors) = state_of(seen.state, layout), airframe(p, knots, layout)
    reference = reference_motion(time, p.reference, knots)
    terms, omega, w = p.terms, now.omega, now.speeds * abs(now.speeds)
    if form.losses:
        works = working(time, p.failure, len(layout))
        rotors, w = rotors.masked(works), works * w

    # Force and torque, and their rates as the pods turn at constant rotor speeds.
    turning = moving_wrench_map(rotors, Moving(now.tilts, terms.gait_rates * seen.tilt_rates, 0.0))
    rows, wrench, change = turning.value, turning.value @ w, turning.rate @ w
    force, torque = wrench[:3], wrench[3:]
    momentum = Moving(*xp.zeros((3, 3)))  # of the rotors' spin
    if form.spin:
        per_rotor = p.rotor_inertia / p.vehicle.thrust_coefficient
        momentum = turning[:3] @ (per_rotor * rotors.spins * now.speeds)

    # Newton and Euler.
    rotation = rotation_matrix(now.attitude)
    omega_rate = measured
    if measured is None:
        remaining = torque - swept(momentum, omega, xp.zeros(3)).value
        omega_rate = angular_acceleration(body, remaining, omega, terms.gyroscopic_torque)
    spin = swept(momentum, omega, omega_rate)
    published = p.decoupling == PUBLISHED_DECOUPLING
    unknown, pushes = _per_unknown(rows, now.speeds, published, form)
    found = factors(unknown, pushes, rotation[2], form.dimension, form.forward)
    direction = found.direction
    if plan is not None:
        planned = moving_wrench_map(rotors, Moving(plan[:, 0], plan[:, 1], plan[:, 2]))
        direction = moving_direction(planned, rotation[2], form.dimension)
    specific = Moving(force / body.mass, change[:3] / body.mass, 0.0)
    present = Present(now, rotation, omega_rate, specific, direction)
    target = _target(time, p, knots)
    jerk, omega_jerk, rates, lean_ref = _control(present, reference, target, seen.states, p, form)

    # Rates of torque and force that remain for the rotors.
    twist = torque_rate(body, omega, omega_rate, omega_jerk, terms.gyroscopic_torque) + spin.rate
    push = body.mass * (rotation.T @ jerk) - cross(omega, force)
    desired = xp.hstack([twist - change[3:], found.axes @ (push - change[:3])])
    matrix, start = xp.vstack([unknown[3:], found.rows]), _start(w, now.speeds, p, form)
    inputs = nearest_solution(matrix, desired, start, found.units)
    if form.norm == "thrust":
        inputs = rotor_accelerations(inputs, now.speeds, p.slowest_rotor)
    unseen = _null_part(rows, rotation[2], w, form)
    return Step(inputs, rates, xp.hstack([lean_ref, target[2].value, unseen]))
