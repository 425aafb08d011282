"""Any multirotor as a rigid body with massless pods, whose tilts follow the gait exactly.

The rotors are those of a table (`tiltsim_controllers.vehicle.effectiveness`). Of the state, a body
has eighteen numbers: position and velocity (world axes), the body-to-world rotation, rows first,
and body rates; the rotor speeds, signed, follow.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.mathematics.rotation import to_world
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import entries_of
from tiltsim_controllers.vehicle.effectiveness import TiltOfRotor, effectiveness_of
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.rigid_body import cross

BODY_STATES: Final = 18
"""Numbers of a state before the rotor speeds."""


class Body(NamedTuple):
    """A rigid body; its inertia is taken about the centre of mass in body axes."""

    mass: float  # kg
    gravity: float  # m/s^2
    inertia_xx: float  # kg m^2
    inertia_yy: float
    inertia_zz: float
    inertia_xy: float  # of the matrix: minus the product of inertia
    inertia_xz: float
    inertia_yz: float
    inverse_xx: float  # 1/(kg m^2), of the inverse matrix
    inverse_yy: float
    inverse_zz: float
    inverse_xy: float
    inverse_xz: float
    inverse_yz: float


def body_of(mass: float, inertia: ArrayLike, gravity: float) -> Body:
    """The body of a mass (kg) and an inertia matrix (kg m^2), shape (3, 3)."""
    matrix = np.asarray(inertia, float)
    inverse = np.linalg.inv(matrix)
    entries = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return Body(mass, gravity, *(float(m[entry]) for m in (matrix, inverse) for entry in entries))


def principal_body(vehicle: Vehicle) -> Body:
    """The body of a vehicle whose principal axes are those of the body."""
    moments = vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz
    xx, yy, zz = moments
    none = (0.0, 0.0, 0.0)
    return Body(vehicle.mass, vehicle.gravity, *moments, *none, 1.0 / xx, 1.0 / yy, 1.0 / zz, *none)


@scalar
def inertia_times(body: Body, vector: Triple) -> Triple:
    """The inertia matrix times a vector."""
    x, y, z = vector
    return (
        body.inertia_xx * x + body.inertia_xy * y + body.inertia_xz * z,
        body.inertia_xy * x + body.inertia_yy * y + body.inertia_yz * z,
        body.inertia_xz * x + body.inertia_yz * y + body.inertia_zz * z,
    )


@scalar
def inverse_inertia_times(body: Body, vector: Triple) -> Triple:
    """The inverse of the inertia matrix times a vector."""
    x, y, z = vector
    return (
        body.inverse_xx * x + body.inverse_xy * y + body.inverse_xz * z,
        body.inverse_xy * x + body.inverse_yy * y + body.inverse_yz * z,
        body.inverse_xz * x + body.inverse_yz * y + body.inverse_zz * z,
    )


@scalar
def body_acceleration(body: Body, torque: Triple, omega: Triple, gyroscopic: float) -> Triple:
    """The angular acceleration ``I^-1 (torque - gyroscopic omega x I omega)`` (rad/s^2).

    Args:
        body: its inertia counts
        torque: N m, body axes
        omega: body rates, rad/s
        gyroscopic: factor of the gyroscopic torque, 1 or 0
    """
    cx, cy, cz = cross(omega, inertia_times(body, omega))
    x, y, z = torque
    return inverse_inertia_times(
        body, (x - gyroscopic * cx, y - gyroscopic * cy, z - gyroscopic * cz)
    )


@scalar
def body_torque_rate(
    body: Body, omega: Triple, omega_rate: Triple, jerk: Triple, gyroscopic: float
) -> Triple:
    """Torque rate (N m/s) that gives an angular jerk: derivative of ``I omega' + omega x I omega``.

    Args:
        body: its inertia counts
        omega, omega_rate, jerk: body rates (rad/s) and their first two derivatives
        gyroscopic: factor of the gyroscopic torque, 1 or 0
    """
    x, y, z = inertia_times(body, jerk)
    mx, my, mz = cross(omega_rate, inertia_times(body, omega))
    lx, ly, lz = cross(omega, inertia_times(body, omega_rate))
    return x + gyroscopic * (mx + lx), y + gyroscopic * (my + ly), z + gyroscopic * (mz + lz)


@scalar
def body_rates(
    state: Vector,
    wrench: Values,
    body: Body,
    extra_acceleration: Triple,
    extra_angular_acceleration: Triple,
    gyroscopic: float,
) -> Values:
    """Time derivative of position, velocity, rotation and body rates.

    Args:
        state: these `BODY_STATES` numbers, and any more
        wrench: force (N) and torque (N m) of the rotors, body axes
        body: the body that flies
        extra_acceleration: by all but weight and rotors, m/s^2, world axes
        extra_angular_acceleration: by all but the rotors, rad/s^2, body axes
        gyroscopic: factor of the gyroscopic torque, 1 or 0
    """
    vx, vy, vz = state[3], state[4], state[5]
    r11, r12, r13 = state[6], state[7], state[8]
    r21, r22, r23 = state[9], state[10], state[11]
    r31, r32, r33 = state[12], state[13], state[14]
    p, q, r = state[15], state[16], state[17]
    fx, fy, fz, tx, ty, tz = wrench
    ax, ay, az = to_world((r11, r12, r13, r21, r22, r23, r31, r32, r33), (fx, fy, fz))
    extra_x, extra_y, extra_z = extra_acceleration
    p_rate, q_rate, r_rate = body_acceleration(body, (tx, ty, tz), (p, q, r), gyroscopic)
    extra_p, extra_q, extra_r = extra_angular_acceleration
    return (
        vx, vy, vz,
        ax / body.mass + extra_x, ay / body.mass + extra_y, az / body.mass - body.gravity + extra_z,
        r12 * r - r13 * q, r13 * p - r11 * r, r11 * q - r12 * p,  # R' = R omega^
        r22 * r - r23 * q, r23 * p - r21 * r, r21 * q - r22 * p,
        r32 * r - r33 * q, r33 * p - r31 * r, r31 * q - r32 * p,
        p_rate + extra_p, q_rate + extra_q, r_rate + extra_r,
    )  # fmt: skip


@cache
def equations_of_motion_of(layout: TiltOfRotor) -> Callable[..., Values]:
    """The equations of motion of vehicles of a layout.

    They are a scalar function ``(state, tilts, inputs, body, table, at, disturbance, gyroscopic)
    -> derivative`` of a state of `BODY_STATES` + N numbers. ``inputs`` are the N rotor
    accelerations (rad/s^2), first of a vector that may have more; ``disturbance`` an acceleration
    unknown to the controller (m/s^2, world axes); the rest as in `body_rates` and
    `tiltsim_controllers.vehicle.effectiveness`.
    """
    functions = effectiveness_of(layout)
    squares, wrench = functions.squares, functions.wrench
    speeds = entries_of(BODY_STATES, len(layout))
    accelerations = entries_of(0, len(layout))

    @scalar
    def equations_of_motion(
        state: Vector,
        tilts: Values,
        inputs: Vector,
        body: Body,
        table: Vector,
        at: int,
        disturbance: Triple,
        gyroscopic: float,
    ) -> Values:
        pushed = wrench(tilts, squares(speeds(state)), table, at)
        rates = body_rates(state, pushed, body, disturbance, (0.0, 0.0, 0.0), gyroscopic)
        return (*rates, *accelerations(inputs))

    return equations_of_motion
