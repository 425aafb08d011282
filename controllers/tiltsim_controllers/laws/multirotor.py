"""Feedback linearization of any multirotor: attitude, and as much of the force as it has.

At zero torque the rotors push anywhere in ``V = F ker tau`` (body axes), of dimension 1, 2 or 3. So
the outputs are the attitude and that many components of force:

- 1: along world up. The horizontal position is controlled by leaning; with four rotors this is the
  attitude-altitude controller of ch. 3 and 4;
- 2: along world up, and across it within V. What V leaves is controlled by leaning. A vehicle with
  all three that is to use two (``forward``) pushes within its x-z plane;
- 3: all of it. The attitude is free: the vehicle flies level, or as the reference says.

The decoupling matrix ``[tau; b^T F]`` with the directions ``b`` of the force has rank 3 + dimension
wherever the margin is positive, for any number of rotors. Of all inputs that give the desired third
derivatives, the controller takes those nearest to zero or, with ``restoring``, to a motion towards
the least power; what the outputs do not see would otherwise drift where the pods move. The norm is
that of the rotor accelerations (``speed``), in which no rotor comes to rest while the others can do
its part, or of the rates of ``w = varpi |varpi|`` (``thrust``), for rotors that reverse;
``restoring`` then leads to the least sum of ``w^2``.

The decoupler is that of four rotors: the side of the torque-free force is used that points up in
body axes. So the z axis of a vehicle has to be its upper side.

The rest is that of `tiltsim_controllers.laws.gait_feedforward`, with its terms.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from tiltsim_controllers.gaits.any_tilts import Jets, tilt_motion_of
from tiltsim_controllers.gaits.parameters import FIXED, NO_KNOTS
from tiltsim_controllers.laws.allocation import limited_of
from tiltsim_controllers.laws.decouplers import NONE
from tiltsim_controllers.laws.failures import health_of, masked_of
from tiltsim_controllers.laws.feedback import attitude_motion
from tiltsim_controllers.laws.force_directions import direction_jet_of, factors_of, nearest_in_plane
from tiltsim_controllers.laws.force_motion import jerk_along
from tiltsim_controllers.laws.gait_feedforward import (
    altitude_control,
    attitude_control,
    horizontal_control,
    tracking_errors,
)
from tiltsim_controllers.laws.multirotor_inputs import (
    null_part_of,
    pushing_of,
    scaled_rows_of,
    solution_of,
)
from tiltsim_controllers.laws.multirotor_steps import (
    ROTATION,
    Form,
    desired_direction,
    lean,
    rotation_control,
    side_control,
    turned,
)
from tiltsim_controllers.laws.multirotor_supervisor import multirotor_supervision_of, watched_at
from tiltsim_controllers.laws.supervisor import SUPERVISOR_AT_REST, gait_time
from tiltsim_controllers.mathematics.jets import Jet, Jets3
from tiltsim_controllers.mathematics.rotation import rotation_from_euler, to_body, to_world
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of, vectors_of
from tiltsim_controllers.vehicle.effectiveness import Rows, TiltOfRotor, effectiveness_of, tilts_of
from tiltsim_controllers.vehicle.multirotor import body_acceleration, body_torque_rate
from tiltsim_controllers.vehicle.rigid_body import cross
from tiltsim_controllers.vehicle.states import PITCH, ROLL, YAW, P, Q, R

Forces = tuple[Triple, Triple]
"""Force per mass (m/s^2, body axes), and its rate by the pods' motion."""

Motion = tuple[Values, Triple, Triple]
"""Rotation (body to world, rows first), body rates (rad/s) and their rates (rad/s^2)."""

Tracking = tuple[Jets3, Jets3]
"""What `tracking_errors` returns: errors of position, and the reference's accelerations."""

Watching = tuple[float, float, Triple]
"""Roll and pitch (rad) and the supervisor's state with its rate and acceleration."""

Horizontal = tuple[Jet, Jet, float, float, float, float]
"""References of roll and pitch, desired jerk of x and y (m/s^3), integrator rates of x and y."""


@scalar
def told_attitude(time: float, parameters: Any) -> tuple[Jet, Jet]:
    """References of roll and pitch with derivatives where nothing else needs the attitude."""
    reference, duration = parameters.reference, parameters.turn_time
    return turned(time, reference.roll, duration), turned(time, reference.pitch, duration)


@scalar
def direction_at_rest(
    time: float, up: Triple, present: Triple, watching: Watching, parameters: Any, knots: Vector
) -> Jets3:
    """The present ``direction``, for pods that do not move, or whose motion does not count.

    Args:
        time, up, watching, parameters, knots: as the planned one has them, without use here
        present: the ``direction`` of the factors
    """
    return (present[0], 0.0, 0.0), (present[1], 0.0, 0.0), (present[2], 0.0, 0.0)


@cache
def _tilts_of(layout: TiltOfRotor, form: Form) -> Callable[..., Jets]:
    """Scalar code of the gait's tilts with derivatives: ``(time, watching, parameters, knots)``.

    They are the anticipated ones of the plan or, under a supervisor, of what it makes of it.
    """
    motion = tilt_motion_of(tilts_of(layout))
    planned_of, anticipated = motion.planned, motion.anticipated
    angles = componentwise("angles_of_jets", "jets", "jets#[0]", tilts_of(layout))

    @scalar
    def planned(time: float, watching: Watching, parameters: Any, knots: Vector) -> Jets:
        return anticipated(time, parameters.gait, knots, parameters.anticipation)

    if not form.supervised:
        return planned
    supervision = multirotor_supervision_of(layout, form.dimension, form.forward)
    gait_scale, supervised_tilts = supervision.gait_scale, supervision.tilts

    @scalar
    def supervised(time: float, watching: Watching, parameters: Any, knots: Vector) -> Jets:
        supervisor, vehicle = parameters.supervisor, watched_at(time, parameters)
        roll, pitch, moving = watching
        clock = gait_time(time, moving, supervisor)
        now = angles(planned_of(clock, parameters.gait, knots))
        scale = gait_scale(now, roll, pitch, supervisor, vehicle, knots)
        ahead = planned(clock, watching, parameters, knots)
        return supervised_tilts(ahead, scale, moving, supervisor, vehicle)

    return supervised


@cache
def _direction_of(layout: TiltOfRotor, form: Form) -> Callable[..., Jets3]:
    """Scalar code of the ``direction`` with derivatives, as `direction_at_rest`."""
    if form.dimension == 3 or form.forward or not tilts_of(layout):
        return direction_at_rest
    over_gait, tilts_at = (
        direction_jet_of(layout, form.dimension, form.losses),
        _tilts_of(layout, form),
    )
    supervised = form.supervised

    @scalar
    def moving_direction(
        time: float, up: Triple, present: Triple, watching: Watching, parameters: Any, knots: Vector
    ) -> Jets3:
        still = parameters.gait.type == FIXED and not supervised
        if parameters.terms.attitude_rates == 0.0 or still:
            return direction_at_rest(time, up, present, watching, parameters, knots)
        tilts, at = tilts_at(time, watching, parameters, knots), int(parameters.rotors)
        return over_gait(time, up, tilts, knots, at, parameters.failure)

    return moving_direction


@cache
def _horizontal_of(layout: TiltOfRotor, form: Form) -> Callable[..., Horizontal]:
    """Scalar code of what moves x and y: force as far as it is controlled, and leaning."""
    moving_direction, dimension = _direction_of(layout, form), form.dimension

    @scalar
    def horizontal(
        time: float,
        motion: Motion,
        direction: Triple,
        tracking: Tracking,
        forces: Forces,
        yaw: Jet,
        integrals: Triple,
        watching: Watching,
        parameters: Any,
        knots: Vector,
    ) -> Horizontal:
        """The attitude that is asked for, and what force does at this attitude.

        Args:
            time: s
            motion: of the body
            direction: the ``direction`` of the factors, where the dimension is below 3
            tracking: errors and accelerations
            forces: of the rotors
            yaw: rad, with derivatives, for the decoupler
            integrals: of the position errors, m s
            watching: what the supervisor goes by
            parameters, knots: of the controller
        """
        errors, accelerations = tracking
        jerk_x = jerk_y = x_rate = y_rate = 0.0
        if dimension > 1:
            jerk_x, jerk_y, x_rate, y_rate = side_control(
                errors, accelerations, integrals, parameters
            )
        if dimension == 3 or parameters.decoupler == NONE:
            roll, pitch = told_attitude(time, parameters)
            return roll, pitch, jerk_x, jerk_y, x_rate, y_rate
        rotation, omega, _ = motion
        up = (rotation[6], rotation[7], rotation[8])
        force = moving_direction(time, up, direction, watching, parameters, knots)
        jerk = (0.0, 0.0, 0.0)  # counts only for the attitude's rates
        if dimension == 2:
            x, y, z = cross(omega, forces[0])
            jerk = (x + forces[1][0], y + forces[1][1], z + forces[1][2])
        elif parameters.terms.attitude_rates != 0.0:
            jerk = jerk_along(force, forces[0], omega, parameters.terms.gait_rates)
        along_x, along_y, x_rate, y_rate = horizontal_control(
            errors, accelerations, to_world(rotation, jerk), integrals, parameters
        )
        along_z = accelerations[2]
        if dimension == 2:
            gravity = parameters.vehicle.gravity
            desired = desired_direction(along_x, along_y, along_z, yaw, gravity)
            force = nearest_in_plane(desired, force)
        roll, pitch = lean(force, along_x, along_y, along_z, yaw, parameters)
        return roll, pitch, jerk_x, jerk_y, x_rate, y_rate

    return horizontal


@cache
def _control_of(layout: TiltOfRotor, form: Form) -> Callable[..., tuple[Any, ...]]:
    """Scalar code of position and attitude control.

    ``(time, state, motion, direction, forces, integrals, supervisor_motion, parameters, knots)``;
    it returns the desired jerk (m/s^3, world axes), the desired second derivatives of the body
    rates (rad/s^3), the rates of the integrals (m) and the references of roll and pitch (rad).
    """
    horizontal = _horizontal_of(layout, form)

    @scalar
    def control(
        time: float,
        state: Values,
        motion: Motion,
        direction: Triple,
        forces: Forces,
        integrals: Triple,
        supervisor_motion: Triple,
        parameters: Any,
        knots: Vector,
    ) -> tuple[Triple, Triple, Triple, float, float]:
        rotation, omega, omega_rate = motion
        terms = parameters.terms
        attitude = attitude_motion(
            (state[ROLL], state[PITCH], state[YAW]), omega, omega_rate, terms.euler_rates
        )
        yaw = attitude[2]
        if parameters.attitude == ROTATION or terms.attitude_rates == 0.0:
            yaw = (parameters.reference.yaw, 0.0, 0.0)
        tracking = tracking_errors(time, state, to_world(rotation, forces[0]), parameters, knots)
        watching = (state[ROLL], state[PITCH], supervisor_motion)
        roll, pitch, jerk_x, jerk_y, x_rate, y_rate = horizontal(
            time, motion, direction, tracking, forces, yaw, integrals, watching, parameters, knots
        )
        errors, accelerations = tracking
        jerk_z, z_rate = altitude_control(errors[2], accelerations[2], integrals[2], parameters)
        if parameters.attitude == ROTATION:
            angular = rotation_control(roll, pitch, rotation, omega, omega_rate, parameters)
        else:
            angular = attitude_control(roll, pitch, attitude, parameters)
        rates = (x_rate, y_rate, z_rate)
        return (jerk_x, jerk_y, jerk_z), angular, rates, roll[0], pitch[0]

    return control


@cache
def _present_of(layout: TiltOfRotor, form: Form) -> Callable[..., tuple[Any, ...]]:
    """Scalar code of what the rotors do now, and how it changes as the pods turn.

    ``(time, state, tilt_rates, parameters, knots)``; it returns ``w``, the rows of F and tau, the
    wrench and its rate.
    """
    length, tilts, losses = len(layout), tilts_of(layout), form.losses
    tilts_in, speeds_in = entries_of(12, tilts), entries_of(12 + tilts, length)
    squares, pushing = effectiveness_of(layout).squares, pushing_of(layout)
    health, masked, product = health_of(length), masked_of(length), vectors_of(length).product

    @scalar
    def present(
        time: float, state: Values, tilt_rates: Values, parameters: Any, knots: Vector
    ) -> tuple[Values, Rows, Values, Values]:
        w = squares(speeds_in(state))
        if losses:
            works = health(time, parameters.failure)
            w = product(works, w)
        rows, wrench, change = pushing(
            tilts_in(state), tilt_rates, w, knots, int(parameters.rotors)
        )
        if losses:
            rows = masked(works, rows)
        return w, rows, wrench, change

    return present


@cache
def multirotor_law_of(layout: TiltOfRotor, form: Form) -> Callable[..., Values]:
    """The control law of vehicles of a layout.

    It is a scalar function as `tiltsim_controllers.laws.gait_feedforward.tracking_inputs`, with the
    parameters of `tiltsim_controllers.laws.multirotor_steps` and the table of the rotors in the
    knots. It also returns the null part: the share, from 0 to 1, of ``w`` that the outputs do not
    see; ``restoring`` keeps it near its least.

    Args:
        layout: of the table of rotors
        form: what the code is made for
    """
    length, dimension, norm, forward = len(layout), form.dimension, form.norm, form.forward
    present, speeds_in = _present_of(layout, form), entries_of(12 + tilts_of(layout), length)
    scaled_rows = scaled_rows_of(length, norm)
    factors_of_rows = factors_of(length, dimension, forward)
    control, solution = _control_of(layout, form), solution_of(length, dimension, norm)
    null_part, limited = null_part_of(length, dimension, forward), limited_of(length)
    prioritized = form.prioritized

    @scalar
    def inputs(
        time: float,
        state: Values,
        tilt_rates: Values,
        integrals: Triple,
        parameters: Any,
        knots: Vector = NO_KNOTS,
        supervisor_motion: Triple = SUPERVISOR_AT_REST,
        measured: Triple | None = None,
    ) -> Values:
        body, terms = parameters.vehicle, parameters.terms
        mass, omega, speeds = body.mass, (state[P], state[Q], state[R]), speeds_in(state)
        rotation = rotation_from_euler(state[ROLL], state[PITCH], state[YAW])
        w, rows, wrench, change = present(time, state, tilt_rates, parameters, knots)
        fx, fy, fz, tx, ty, tz = wrench
        known = terms.gait_rates
        gx, gy, gz = known * change[0], known * change[1], known * change[2]
        if measured is None:
            omega_rate = body_acceleration(body, (tx, ty, tz), omega, terms.gyroscopic_torque)
        else:
            omega_rate = measured
        up = (rotation[6], rotation[7], rotation[8])
        unseen = null_part(rows, up, w)
        unknown_rows, pushes = scaled_rows(rows, speeds, parameters.decoupling)
        factors = factors_of_rows(unknown_rows, pushes, up)
        jerk, angular_jerk, rates, roll_ref, pitch_ref = control(
            time,
            state,
            (rotation, omega, omega_rate),
            factors[3],
            ((fx / mass, fy / mass, fz / mass), (gx / mass, gy / mass, gz / mass)),
            integrals,
            supervisor_motion,
            parameters,
            knots,
        )

        # Rates of torque and force that remain for the rotors.
        mx, my, mz = body_torque_rate(
            body, omega, omega_rate, angular_jerk, terms.gyroscopic_torque
        )
        jx, jy, jz = to_body(rotation, (mass * jerk[0], mass * jerk[1], mass * jerk[2]))
        sx, sy, sz = cross(omega, (fx, fy, fz))
        accelerations = solution(
            unknown_rows,
            factors,
            (mx - known * change[3], my - known * change[4], mz - known * change[5]),
            (jx - sx - gx, jy - sy - gy, jz - sz - gz),
            w,
            speeds,
            parameters,
        )
        if prioritized:
            limits, at = parameters.limits, int(parameters.rotors)
            accelerations = limited(accelerations, rows, up, speeds, limits, knots, at)
        references = (roll_ref, pitch_ref, parameters.reference.yaw)
        return (*accelerations, *rates, *references, unseen)

    return inputs
