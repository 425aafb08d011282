"""The tiltrotor as ch. 3 models it (Eqs. 1-7): pods without mass, no gyroscopic torque.

The state begins with position, velocity, the rotation (rows first), body rates and rotor speeds.
Tilt angles follow the gait exactly, or are states after these where a law moves them itself.
"""

from __future__ import annotations

from math import asin, atan2
from typing import TYPE_CHECKING

from tiltsim_controllers.laws.attitude_altitude import State
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


@scalar
def law_state(state: Vector, tilts: Quad) -> State:
    """State of the laws: `tiltsim_controllers.laws.attitude_altitude.STATE_FIELDS`."""
    sin_pitch = min(1.0, max(-1.0, -state[12]))  # rounding may carry the sine past one
    return (
        *(state[0], state[1], state[2], state[3], state[4], state[5]),
        *(atan2(state[13], state[14]), asin(sin_pitch), atan2(state[9], state[6])),
        *(state[15], state[16], state[17], tilts[0], tilts[1], tilts[2], tilts[3]),
        *(state[18], state[19], state[20], state[21]),
    )


@scalar
def rigid_body(
    state: Vector, tilts: Quad, squares: Quad, vehicle: Vehicle, push: Triple, turn: Triple
) -> Values:
    """Time derivative of position, velocity, rotation and body rates, the state's first eighteen.

    Parameters
    ----------
    state
        Eighteen numbers, and whatever follows.
    tilts
        rad.
    squares
        ``varpi |varpi|`` of the rotors, (rad/s)^2.
    vehicle
        What flies.
    push, turn
        What acts besides weight and rotors: an acceleration (m/s^2, world) and an angular one
        (rad/s^2, body).
    """
    r11, r12, r13, r21, r22, r23 = state[6], state[7], state[8], state[9], state[10], state[11]
    r31, r32, r33, p, q, r = state[12], state[13], state[14], state[15], state[16], state[17]
    w1, w2, w3, w4 = squares
    trig = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])

    # Eq. (1): force in body axes, turned to the world, weight and what else pushes.
    push_x, push_y, push_z = push
    fx, fy, fz = body_force(trig, w1, w2, w3, w4)
    per_force = vehicle.thrust_coefficient / vehicle.mass
    ax = per_force * (r11 * fx + r12 * fy + r13 * fz) + push_x
    ay = per_force * (r21 * fx + r22 * fy + r23 * fz) + push_y
    az = per_force * (r31 * fx + r32 * fy + r33 * fz) - vehicle.gravity + push_z

    # Eq. (4): torque alone, no gyroscopic term.
    tx, ty, tz = body_torque(torque_entries(trig, drag_ratio(vehicle)), w1, w2, w3, w4)
    per_torque = vehicle.arm_length * vehicle.thrust_coefficient
    p_rate = per_torque * tx / vehicle.inertia_xx
    q_rate = per_torque * ty / vehicle.inertia_yy
    r_rate = per_torque * tz / vehicle.inertia_zz

    return (
        *(state[3], state[4], state[5], ax, ay, az),
        *(r12 * r - r13 * q, r13 * p - r11 * r, r11 * q - r12 * p),  # Eq. (7): R' = R omega^
        *(r22 * r - r23 * q, r23 * p - r21 * r, r21 * q - r22 * p),
        *(r32 * r - r33 * q, r33 * p - r31 * r, r31 * q - r32 * p),
        *(p_rate + turn[0], q_rate + turn[1], r_rate + turn[2]),
    )


@scalar
def equations_of_motion(
    state: Vector, tilts: Quad, inputs: Quad, vehicle: Vehicle, disturbance: Triple
) -> Values:
    """Time derivative of the state under the given rotor accelerations (rad/s^2).

    ``disturbance`` is an acceleration (m/s^2, world) that the law does not know of.
    """
    s1, s2, s3, s4 = state[18], state[19], state[20], state[21]
    squares = s1 * abs(s1), s2 * abs(s2), s3 * abs(s3), s4 * abs(s4)
    u1, u2, u3, u4 = inputs
    body = rigid_body(state, tilts, squares, vehicle, disturbance, (0.0, 0.0, 0.0))
    return (*body, u1, u2, u3, u4)


def initial_state(scenario: Scenario, rotor_speeds: Vector) -> Values:
    """The state at time zero, with signed rotor speeds (rad/s)."""
    initial = scenario.initial
    rotation = rotation_from_euler(*initial.attitude)
    motion = (*initial.position, *initial.velocity)
    return (*motion, *rotation, *initial.angular_velocity, *rotor_speeds)
