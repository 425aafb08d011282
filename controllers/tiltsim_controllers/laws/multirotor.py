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
its part, or of the rates of ``w = varpi |varpi|`` (``thrust``), for rotors that reverse.

The decoupler is that of four rotors: the side of the torque-free force is used that points up in
body axes. So the z axis of a vehicle has to be its upper side.

The rest is that of `tiltsim_controllers.laws.gait_feedforward`, with its terms.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from tiltsim_controllers.gaits.parameters import FIXED, NO_KNOTS
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
from tiltsim_controllers.laws.multirotor_allocation import limited_of
from tiltsim_controllers.laws.multirotor_inputs import (
    null_part_of,
    pushing_of,
    scaled_rows_of,
    solution_of,
)
from tiltsim_controllers.laws.multirotor_steps import (
    ROTATION,
    desired_direction,
    lean,
    rotation_control,
    side_control,
    turned,
)
from tiltsim_controllers.mathematics.jets import Jet, Jets3
from tiltsim_controllers.mathematics.rotation import rotation_from_euler, to_body, to_world
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import entries_of, vectors_of
from tiltsim_controllers.vehicle.effectiveness import Layout, effectiveness_of, tilts_of
from tiltsim_controllers.vehicle.multirotor import body_acceleration, body_torque_rate
from tiltsim_controllers.vehicle.rigid_body import cross
from tiltsim_controllers.vehicle.states import PITCH, ROLL, YAW, P, Q, R

Forces = tuple[Triple, Triple]
"""Force per mass (m/s^2, body axes), and its rate by the pods' motion."""

Motion = tuple[Values, Triple, Triple]
"""Rotation (body to world, rows first), body rates (rad/s) and their rates (rad/s^2)."""

Tracking = tuple[Jets3, Jets3]
"""What `tracking_errors` returns: errors of position, and the reference's accelerations."""

Horizontal = tuple[Jet, Jet, float, float, float, float]
"""References of roll and pitch, desired jerk of x and y (m/s^3), integrator rates of x and y."""


@scalar
def told_attitude(time: float, parameters: Any) -> tuple[Jet, Jet]:
    """References of roll and pitch with derivatives where nothing else needs the attitude."""
    reference, duration = parameters.reference, parameters.turn_time
    return turned(time, reference.roll, duration), turned(time, reference.pitch, duration)


@scalar
def direction_at_rest(
    time: float, up: Triple, present: Triple, parameters: Any, knots: Vector
) -> Jets3:
    """The present ``direction``, for pods that do not move, or whose motion does not count.

    Args:
        time, up, parameters, knots: as the planned one has them, without use here
        present: the ``direction`` of the factors
    """
    return (present[0], 0.0, 0.0), (present[1], 0.0, 0.0), (present[2], 0.0, 0.0)


@cache
def _direction_of(
    layout: Layout, dimension: int, forward: bool, losses: bool
) -> Callable[..., Jets3]:
    """Scalar code of the ``direction`` with derivatives, as `direction_at_rest`."""
    if dimension == 3 or forward or not tilts_of(layout):
        return direction_at_rest
    planned = direction_jet_of(layout, dimension, losses)

    @scalar
    def over_gait(
        time: float, up: Triple, present: Triple, parameters: Any, knots: Vector
    ) -> Jets3:
        gait = parameters.gait
        if parameters.terms.attitude_rates == 0.0 or gait.type == FIXED:
            return direction_at_rest(time, up, present, parameters, knots)
        half, at = parameters.anticipation, int(parameters.rotors)
        return planned(time, up, gait, knots, half, at, parameters.failure)

    return over_gait


@cache
def _horizontal_of(
    layout: Layout, dimension: int, forward: bool, losses: bool
) -> Callable[..., Horizontal]:
    """Scalar code of what moves x and y: force as far as it is controlled, and leaning."""
    moving_direction = _direction_of(layout, dimension, forward, losses)

    @scalar
    def horizontal(
        time: float,
        motion: Motion,
        direction: Triple,
        tracking: Tracking,
        forces: Forces,
        yaw: Jet,
        integrals: Triple,
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
        force = moving_direction(time, up, direction, parameters, knots)
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
def _control_of(
    layout: Layout, dimension: int, forward: bool, losses: bool
) -> Callable[..., tuple[Any, ...]]:
    """Scalar code of position and attitude control.

    ``(time, state, motion, direction, forces, integrals, parameters, knots)``; it returns the
    desired jerk (m/s^3, world axes), the desired second derivatives of the body rates (rad/s^3),
    the rates of the integrals (m) and the references of roll and pitch (rad).
    """
    horizontal = _horizontal_of(layout, dimension, forward, losses)

    @scalar
    def control(
        time: float,
        state: Values,
        motion: Motion,
        direction: Triple,
        forces: Forces,
        integrals: Triple,
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
        roll, pitch, jerk_x, jerk_y, x_rate, y_rate = horizontal(
            time, motion, direction, tracking, forces, yaw, integrals, parameters, knots
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
def multirotor_law_of(
    layout: Layout,
    dimension: int,
    norm: str = "speed",
    forward: bool = False,
    losses: bool = False,
    prioritized: bool = False,
) -> Callable[..., Values]:
    """The control law of vehicles of a layout.

    A scalar function ``(time, state, tilt_rates, integrals, parameters, knots, measured)``:

    - ``state``: twelve numbers of the body (`tiltsim_controllers.vehicle.states.BODY_FIELDS`), the
      tilt angles (rad) and the rotor speeds (rad/s, signed); ``tilt_rates`` in rad/s;
    - ``integrals`` of the position errors (m s, world axes);
    - ``parameters``: `tiltsim_controllers.laws.multirotor_steps.Parameters`; ``knots`` of the gait
      (from the first on), the reference and the table of the rotors, each where the parameters say;
    - ``measured``: the angular acceleration (rad/s^2, body axes); None takes the model's.

    It returns the rotor accelerations (rad/s^2), the rates of the integrals (m), the references of
    roll, pitch and yaw (rad) and the null part: the share, from 0 to 1, of ``w`` that the outputs
    do not see; ``restoring`` keeps it near its least. NaN where the decoupling matrix is singular.

    Args:
        layout: of the table of rotors, four or more
        dimension: how many components of force are outputs, 1 to 3
        norm: in `NORMS`
        forward: two components are those along x and z, of a vehicle that has three
        losses: whether the controller knows of failures
        prioritized: whether it keeps within rotor limits (`multirotor_allocation`)
    """
    length, tilts = len(layout), tilts_of(layout)
    tilts_in, speeds_in = entries_of(12, tilts), entries_of(12 + tilts, length)
    squares, pushing = effectiveness_of(layout).squares, pushing_of(layout)
    scaled_rows, factors_of_rows = (
        scaled_rows_of(length, norm),
        factors_of(length, dimension, forward),
    )
    control, solution = (
        _control_of(layout, dimension, forward, losses),
        solution_of(length, dimension, norm),
    )
    null_part = null_part_of(length, dimension, forward)
    health, masked, product = health_of(length), masked_of(length), vectors_of(length).product
    limited = limited_of(length)

    @scalar
    def inputs(
        time: float,
        state: Values,
        tilt_rates: Values,
        integrals: Triple,
        parameters: Any,
        knots: Vector = NO_KNOTS,
        measured: Triple | None = None,
    ) -> Values:
        body, terms = parameters.vehicle, parameters.terms
        mass, omega, speeds = body.mass, (state[P], state[Q], state[R]), speeds_in(state)
        rotation = rotation_from_euler(state[ROLL], state[PITCH], state[YAW])

        # What the rotors do now, and how it changes as the pods turn.
        w = squares(speeds)
        if losses:
            works = health(time, parameters.failure)
            w = product(works, w)
        rows, wrench, change = pushing(
            tilts_in(state), tilt_rates, w, knots, int(parameters.rotors)
        )
        if losses:
            rows = masked(works, rows)
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
