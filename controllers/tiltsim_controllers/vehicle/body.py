"""A rigid body: its mass and inertia, and Euler's equation."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.vehicle.parameters import Vehicle


class Body(NamedTuple):
    """A rigid body; its inertia is taken about the center of mass in body axes."""

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
    """The body of a vehicle whose principal axes are the body axes."""
    moments = vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz
    xx, yy, zz = moments
    none = (0.0, 0.0, 0.0)
    return Body(vehicle.mass, vehicle.gravity, *moments, *none, 1.0 / xx, 1.0 / yy, 1.0 / zz, *none)


def inertia_matrix(body: Any) -> Any:
    """The inertia matrix (kg m^2), shape (3, 3), of a `Body`."""
    b = body
    return xp.array(
        [
            [b.inertia_xx, b.inertia_xy, b.inertia_xz],
            [b.inertia_xy, b.inertia_yy, b.inertia_yz],
            [b.inertia_xz, b.inertia_yz, b.inertia_zz],
        ]
    )


def inverse_inertia_matrix(body: Any) -> Any:
    """The inverse of `inertia_matrix`, 1/(kg m^2)."""
    b = body
    return xp.array(
        [
            [b.inverse_xx, b.inverse_xy, b.inverse_xz],
            [b.inverse_xy, b.inverse_yy, b.inverse_yz],
            [b.inverse_xz, b.inverse_yz, b.inverse_zz],
        ]
    )


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
