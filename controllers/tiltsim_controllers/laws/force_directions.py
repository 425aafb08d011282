"""Directions in which any number of rotors push without torque, and how they move with the pods.

The ``direction`` is the torque-free force that goes with lift for one component of force, and the
normal of the plane of torque-free forces for two; see `tiltsim_controllers.laws.multirotor`.
"""

from typing import Any, NamedTuple

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.linear import (
    cross,
    nearest_solution,
    orthonormal_rows,
    rejection,
)
from tiltsim_controllers.mathematics.moving import Moving, square_root, value_of
from tiltsim_controllers.mathematics.moving import cross as moving_cross

SIDE = (0.0, 1.0, 0.0)
"""The direction across a vehicle that is to push within its x-z plane, body axes."""


class Factors(NamedTuple):
    """Orthogonal factors of the decoupling matrix of N rotors and D components of force."""

    axes: Any  # directions of the force, body axes, shape (D, 3)
    rows: Any  # the force along them per unknown, shape (D, N)
    units: Any  # orthonormal rows that span the torque, then also these, 3 + D of shape (N,)
    direction: Any  # see this module, body axes, shape (3,)


def unit_vector(vector: Any) -> Any:
    """A vector divided by its length; NaN for zero."""
    square = vector @ vector
    return vector / xp.sqrt(xp.where(square > 0.0, square, xp.nan))


def normal_of_plane(columns: Any) -> Any:
    """The unit vector across the plane that columns span, shape (3, N) to (3,)."""
    a, b, c = columns @ columns.T
    best = cross(a, b)
    for other in (cross(b, c), cross(c, a)):
        best = xp.where(other @ other > best @ best, other, best)
    return unit_vector(best)


def without_torque(rows: Any, units: Any) -> Any:
    """Rows (3, N) without their components along unit rows of the torque."""
    for unit in units[:3]:
        rows = xp.array([rejection(row, unit) for row in rows])
    return rows


def factors(wrench: Any, pushes: Any, up: Any, dimension: int, forward: bool = False) -> Factors:
    """Orthogonal factors of the decoupling matrix; NaN where its rank is too low.

    Args:
        wrench: Force and torque per unknown, body axes, shape (6, N).
        pushes: The force in the unknowns of the torque, which differ in the published matrix,
            shape (3, N).
        up: World up in body axes, shape (3,).
        dimension: Components of force that are outputs, 1 to 3.
        forward: Whether two components are in the body's x-z plane, of rotors that push in all
            directions without torque; else in the plane of torque-free forces.
    """
    force, torque = wrench[:3], wrench[3:]
    axes, direction = xp.array([up]), up
    if dimension == 2:
        direction = xp.array(SIDE)
        if not forward:
            direction = normal_of_plane(without_torque(force, orthonormal_rows(torque)))
        axes = xp.array([up, unit_vector(cross(direction, up))])
    rows = force if dimension == 3 else axes @ force
    units = orthonormal_rows(xp.vstack([torque, rows]))
    if dimension == 1:
        direction = pushes @ units[-1]
    return Factors(xp.eye(3) if dimension == 3 else axes, rows, units, direction)


def nearest_in_plane(desired: Moving, normal: Any) -> Any:
    """The part of a moving vector in the plane across a normal of any length."""
    return desired - normal * ((desired @ normal) / (normal @ normal))


def torque_free_force(axis: Any, wrench: Moving) -> Any:
    """A torque-free force that moves with the pods, body axes, shape (3,).

    Its inputs push along an axis (3,) of the body, without their part that makes torque; their
    derivatives are the least that keep the torque zero. ``wrench`` is per rotor, shape (6, N).
    """
    force, torque = wrench[:3], wrench[3:]
    units = orthonormal_rows(torque.value)
    inputs = axis @ force.value
    for unit in units:
        inputs = rejection(inputs, unit)
    still = xp.zeros(len(inputs))
    rate = nearest_solution(torque.value, -(torque.rate @ inputs), still, units)
    lacking = -(torque.acceleration @ inputs) - 2.0 * (torque.rate @ rate)
    second = nearest_solution(torque.value, lacking, still, units)
    return force @ Moving(inputs, rate, second)


def moving_direction(wrench: Moving, up: Any, dimension: int) -> Any:
    """The ``direction`` of one or two components of force as the pods move, of any length.

    ``wrench`` is force and torque per rotor, shape (6, N), ``up`` world up, body axes, shape (3,).
    """
    if dimension == 1:
        return torque_free_force(up, wrench)
    units = orthonormal_rows(wrench.value[3:])
    across = normal_of_plane(without_torque(wrench.value[:3], units))
    one = unit_vector(cross(across, up))
    first = torque_free_force(cross(one, across), wrench)
    return moving_cross(first, torque_free_force(one, wrench))


def jerk_along(force: Any, specific: Any, omega: Any, factor: Any) -> Any:
    """Jerk (m/s^3, body axes), shape (3,), of a body whose force stays along the torque-free force.

    Args:
        force: The torque-free force, moving, of any unit.
        specific: The present force per mass, m/s^2, body axes.
        omega: Body rates, rad/s: the force rotates with the body.
        factor: Weight of the torque-free force's motion in the body, 1 or 0.
    """
    size = xp.sqrt(specific @ specific) * xp.where(value_of(force)[2] < 0.0, -factor, factor)
    along = force * (1.0 / square_root(force @ force))
    return cross(omega, specific) + (size * along.rate if isinstance(along, Moving) else 0.0)


def share(row: Any, unit: Any) -> Any:
    """The share of a row (N,) that lies along a unit row; 0 for a row of zeros."""
    square = row @ row
    return xp.where(square > 0.0, row @ unit / xp.sqrt(xp.where(square > 0.0, square, 1.0)), 0.0)
