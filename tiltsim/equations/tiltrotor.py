"""The tiltrotor as ch. 3 models it (Eqs. 1-7): massless pods, no gyroscopic torque.

The state begins with position, velocity, the rotation (rows first), body rates and rotor speeds.
Tilt angles follow the gait exactly, or are further states where the controller moves them.
"""

from __future__ import annotations

from math import asin, atan2
from typing import TYPE_CHECKING

from tiltsim_controllers.mathematics.rotation import rotation_from_euler
from tiltsim_controllers.mathematics.scalar import Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    body_torque,
    sines_and_cosines,
    torque_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario


VX, VY, VZ, R11, R12, R13, R21, R22, R23, R31, R32, R33, P, Q, R = range(3, 18)
SPEED_1, SPEED_2, SPEED_3, SPEED_4 = range(18, 22)


@scalar
def rotation_of(state: Vector) -> Values:
    """The nine entries, rows first, of the body-to-world rotation."""
    return (
        state[R11], state[R12], state[R13],
        state[R21], state[R22], state[R23],
        state[R31], state[R32], state[R33],
    )  # fmt: skip


@scalar
def velocity_of(state: Vector) -> Values:
    """Velocity (m/s, world axes) and body rates (rad/s)."""
    return state[VX], state[VY], state[VZ], state[P], state[Q], state[R]


@scalar
def body_fields(state: Vector) -> Values:
    """The rigid body's numbers, `tiltsim_controllers.vehicle.states.BODY_FIELDS`."""
    sin_pitch = min(1.0, max(-1.0, -state[R31]))  # rounding may carry the sine past one
    roll, pitch, yaw = atan2(state[R32], state[R33]), asin(sin_pitch), atan2(state[R21], state[R11])
    return (
        state[0], state[1], state[2], state[VX], state[VY], state[VZ],
        roll, pitch, yaw, state[P], state[Q], state[R],
    )  # fmt: skip


@scalar
def rigid_body(
    state: Vector,
    tilts: Quad,
    squares: Quad,
    vehicle: Vehicle,
    extra_acceleration: Triple,
    extra_angular_acceleration: Triple,
) -> Values:
    """Time derivative of position, velocity, rotation and body rates.

    Args:
        state: These eighteen numbers, and any more.
        tilts: rad.
        squares: ``varpi |varpi|`` of the rotors, (rad/s)^2.
        vehicle: The vehicle that flies.
        extra_acceleration: By all but weight and rotors, m/s^2, world axes.
        extra_angular_acceleration: By all but the rotors, rad/s^2, body axes.
    """
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_of(state)
    vx, vy, vz, p, q, r = velocity_of(state)
    w1, w2, w3, w4 = squares
    trig = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])

    # Eq. (1): force in body axes, rotated to the world, weight and the rest.
    extra_x, extra_y, extra_z = extra_acceleration
    fx, fy, fz = body_force(trig, w1, w2, w3, w4)
    per_force = vehicle.thrust_coefficient / vehicle.mass
    ax = per_force * (r11 * fx + r12 * fy + r13 * fz) + extra_x
    ay = per_force * (r21 * fx + r22 * fy + r23 * fz) + extra_y
    az = per_force * (r31 * fx + r32 * fy + r33 * fz) - vehicle.gravity + extra_z

    # Eq. (4): torque only, no gyroscopic term.
    tx, ty, tz = body_torque(torque_entries(trig, drag_ratio(vehicle)), w1, w2, w3, w4)
    per_torque = vehicle.arm_length * vehicle.thrust_coefficient
    p_rate = per_torque * tx / vehicle.inertia_xx
    q_rate = per_torque * ty / vehicle.inertia_yy
    r_rate = per_torque * tz / vehicle.inertia_zz

    extra_p, extra_q, extra_r = extra_angular_acceleration
    return (
        vx, vy, vz, ax, ay, az,
        r12 * r - r13 * q, r13 * p - r11 * r, r11 * q - r12 * p,  # Eq. (7): R' = R omega^
        r22 * r - r23 * q, r23 * p - r21 * r, r21 * q - r22 * p,
        r32 * r - r33 * q, r33 * p - r31 * r, r31 * q - r32 * p,
        p_rate + extra_p, q_rate + extra_q, r_rate + extra_r,
    )  # fmt: skip


@scalar
def equations_of_motion(
    state: Vector, tilts: Quad, inputs: Quad, vehicle: Vehicle, disturbance: Triple
) -> Values:
    """Time derivative of the state.

    Args:
        state: 22 numbers, and any more.
        tilts: rad.
        inputs: Rotor accelerations, rad/s^2.
        vehicle: The vehicle that flies.
        disturbance: An acceleration unknown to the controller, m/s^2, world axes.
    """
    s1, s2, s3, s4 = state[SPEED_1], state[SPEED_2], state[SPEED_3], state[SPEED_4]
    squares = s1 * abs(s1), s2 * abs(s2), s3 * abs(s3), s4 * abs(s4)
    body = rigid_body(state, tilts, squares, vehicle, disturbance, (0.0, 0.0, 0.0))
    return (*body, inputs[0], inputs[1], inputs[2], inputs[3])


def initial_state(scenario: Scenario, rotor_speeds: Vector) -> Values:
    """The state at time zero, with signed rotor speeds (rad/s)."""
    initial = scenario.initial
    rotation = rotation_from_euler(*initial.attitude)
    motion = (*initial.position, *initial.velocity)
    return (*motion, *rotation, *initial.angular_velocity, *rotor_speeds)
