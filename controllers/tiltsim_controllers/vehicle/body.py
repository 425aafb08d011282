"""A rigid body: its state by name, its mass and inertia, its motion, and the loads on it."""

from collections.abc import Iterable
from math import inf
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.records import Matrix3, Vector3

ROLL, PITCH = 6, 7  # places in `BODY_FIELDS`

ROTORS: Final = (1, 2, 3, 4)
"""Numbers of the rotors of tiltrotor and quadrotor."""

BODY_FIELDS: Final = ("x", "y", "z", "vx", "vy", "vz", "roll", "pitch", "yaw", "p", "q", "r")
"""A rigid body: position (m) and velocity (m/s), world axes; rad; body rates, rad/s."""

ROTATION_NAMES: Final = ("rotation_x", "rotation_y", "rotation_z")
"""A small turn about the body axes, rad; at level attitude roll, pitch and yaw."""

TILT_FIELDS: Final = ("alpha_1", "alpha_2", "alpha_3", "alpha_4")
"""Tilt angles, rad."""

ROTOR_FIELDS: Final = ("rotor_speed_1", "rotor_speed_2", "rotor_speed_3", "rotor_speed_4")
"""Rotor speeds, rad/s, signed."""

TILTROTOR_FIELDS: Final = (*BODY_FIELDS, *TILT_FIELDS, *ROTOR_FIELDS)
"""The state of the tiltrotor: one float per name, in this order."""

EXTENDED_QUADROTOR_FIELDS: Final = (*BODY_FIELDS, "thrust", "thrust_rate")
"""The state of the quadrotor and of the dynamic extension of ch. 2, [zeta] N and [xi] N/s."""


class RotorcraftState(NamedTuple):
    """The state of a vehicle with N rotors and M tilts."""

    position: Any  # m, world axes, shape (3,)
    velocity: Any  # m/s, world axes, shape (3,)
    attitude: Any  # roll, pitch and yaw, rad, shape (3,)
    omega: Any  # body rates, rad/s, shape (3,)
    tilts: Any  # rad, shape (M,)
    speeds: Any  # of the rotors, rad/s, signed, shape (N,)


def state_of(values: Any, tilt_of_rotor: tuple[int, ...]) -> RotorcraftState:
    """The state by name, of its fields one after the other, shape (12 + M + N,).

    The layout is the number of each rotor's tilt, from 0; -1 for a fixed rotor.
    """
    first = 12 + max(tilt_of_rotor) + 1
    body = values[0:3], values[3:6], values[6:9], values[9:12]
    return RotorcraftState(*body, values[12:first], values[first : first + len(tilt_of_rotor)])


class Body(NamedTuple):
    """A rigid body; its inertia is taken about the center of mass in body axes."""

    mass: float  # kg
    gravity: float  # m/s^2
    inertia: Matrix3  # kg m^2
    inverse: Matrix3  # of the inertia, 1/(kg m^2)


def body_of(mass: float, inertia: ArrayLike, gravity: float) -> Body:
    """The body of a mass (kg) and an inertia matrix (kg m^2), shape (3, 3)."""
    matrix = np.asarray(inertia, float)
    symmetric = (np.triu(m) + np.triu(m, 1).T for m in (matrix, np.linalg.inv(matrix)))
    return Body(mass, gravity, *(tuple(m.ravel().tolist()) for m in symmetric))


def inertia_matrix(body: Any) -> Any:
    """The inertia matrix (kg m^2), shape (3, 3), of a `Body`."""
    return xp.array(body.inertia).reshape(3, 3)


def inverse_inertia_matrix(body: Any) -> Any:
    """The inverse of `inertia_matrix`, 1/(kg m^2)."""
    return xp.array(body.inverse).reshape(3, 3)


def angular_acceleration(body: Any, torque: Any, omega: Any, gyroscopic: float) -> Any:
    """Euler's equation: ``I^-1 (torque - gyroscopic omega x I omega)``, rad/s^2, shape (3,).

    Args:
        body: Body of the vehicle.
        torque: N m, body axes, shape (3,).
        omega: Body rates, rad/s, shape (3,).
        gyroscopic: Factor of the gyroscopic torque, 1 or 0.
    """
    momentum = inertia_matrix(body) @ omega
    return inverse_inertia_matrix(body) @ (torque - gyroscopic * cross(omega, momentum))


def torque_rate(body: Any, omega: Any, omega_rate: Any, jerk: Any, gyroscopic: float) -> Any:
    """Torque rate (N m/s), shape (3,), that gives an angular jerk.

    It is the derivative of ``I omega' + gyroscopic omega x I omega``.

    Args:
        body: Body of the vehicle.
        omega, omega_rate, jerk: Body rates (rad/s) with two derivatives, shape (3,) each.
        gyroscopic: Factor of the gyroscopic torque, 1 or 0.
    """
    inertia = inertia_matrix(body)
    carried = cross(omega_rate, inertia @ omega) + cross(omega, inertia @ omega_rate)
    return inertia @ jerk + gyroscopic * carried


BODY_STATES: Final = 18
"""Numbers of a state before the rotor speeds."""


class RigidState(NamedTuple):
    """The motion of a rigid body, in the order of a state's first `BODY_STATES` numbers."""

    position: Any  # m, world axes, shape (3,)
    velocity: Any  # m/s, world axes, shape (3,)
    rotation: Any  # body to world, shape (3, 3)
    omega: Any  # body rates, rad/s, shape (3,)


def rigid_state(state: Any) -> RigidState:
    """The parts of a state, shape (`BODY_STATES` + any, )."""
    return RigidState(state[:3], state[3:6], state[6:15].reshape(3, 3), state[15:BODY_STATES])


def joined(parts: Iterable[Any]) -> Any:
    """Parts of a state, arrays of any shape, as one vector."""
    return xp.hstack([part.ravel() for part in parts])


def rotation_rate(rotation: Any, omega: Any) -> Any:
    """``R' = R omega^`` (ch. 3, Eq. 7), 1/s, shape (3, 3), at body rates (rad/s)."""
    return xp.array([cross(row, omega) for row in rotation])


def accelerations(
    body: Body, rotation: Any, omega: Any, wrench: Any, disturbance: Any, gyroscopic: float
) -> tuple[Any, Any]:
    """Acceleration (m/s^2, world axes) and angular acceleration (rad/s^2, body axes).

    Args:
        body: The body.
        rotation: Body to world, shape (3, 3).
        omega: Body rates, rad/s, shape (3,).
        wrench: Force (N) and torque (N m) without weight, body axes, shape (6,).
        disturbance: A further acceleration, m/s^2, world axes, shape (3,).
        gyroscopic: Factor of the gyroscopic torque, 1 or 0.
    """
    weight = xp.array([0.0, 0.0, body.gravity])
    acceleration = rotation @ wrench[:3] / body.mass - weight + disturbance
    return acceleration, angular_acceleration(body, wrench[3:], omega, gyroscopic)


ROUNDING: Final = 1e-9
"""s by which a time may be rounded: a load begins and ends at equal steps on all plants."""


class Load(NamedTuple):
    """A force at a point, or a torque, from ``start`` to ``end``."""

    start: float = 0.0  # s
    end: float = inf  # s
    in_body: float = 0.0  # 1 if force and torque are in body axes, 0 if they are in the world's
    force: Vector3 = (0.0, 0.0, 0.0)  # N
    torque: Vector3 = (0.0, 0.0, 0.0)  # N m
    point: Vector3 = (0.0, 0.0, 0.0)  # m from the center of mass, body axes


def wrench_of_loads(time: Any, rotation: Any, loads: Iterable[Load]) -> Any:
    """Force (N) and torque (N m) about the center of mass, body axes, shape (6,), at a time (s).

    The rotation is from body to world, shape (3, 3); a load acts from its start until before its
    end.
    """
    total = xp.zeros(6)
    for load in loads:
        later = time + ROUNDING
        acts = xp.where((later >= load.start) & (later < load.end), 1.0, 0.0)

        def in_body(value: Any, load: Load = load) -> Any:
            return xp.where(load.in_body > 0.0, value, rotation.T @ value)

        force = in_body(load.force)
        torque = in_body(load.torque) + cross(load.point, force)
        total = total + acts * xp.hstack([force, torque])
    return total
