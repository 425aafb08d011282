"""Rotor speeds with which a multirotor hovers, from statics."""

import numpy as np

from tiltsim.errors import InputError
from tiltsim.models.rotor_table import Multirotor
from tiltsim_controllers.analysis.torque_free import (
    LEVEL,
    controlled_axes,
    hover_direction,
    torque_free_forces,
)
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.rotors import force_and_torque

TOLERANCE = 1e-9  # relative tolerance of the singular values of force and torque and of the limits
NEARLY = 1e-3  # share of the weight by which the force of fewer than four rotors may miss it
REST = 1e-12  # a rotor with this part of the largest input is at rest


def hover_speeds(
    vehicle: Multirotor, tilts: Values, limits: tuple[float, float], dimension: int = 3
) -> Values:
    """Signed rotor speeds (rad/s) without torque, whose force carries the weight.

    The force is as large as the weight, and as nearly along the body's z axis as the tilt angles
    allow; a controller of fewer components of force leans instead of forcing the rest. Among all
    inputs ``varpi |varpi|`` that make it, these have the least norm, or the least largest one where
    the limits exclude those.

    Args:
        vehicle: The vehicle.
        tilts: rad.
        limits: Lowest and highest speed (rad/s) along the spin, the first negative for rotors that
            reverse.
        dimension: Number of components of the force that are controlled.

    Raises:
        InputError: If there are none within the limits.
    """
    force, torque = force_and_torque(vehicle.table, tilts)
    weight = vehicle.mass * vehicle.gravity
    forces = torque_free_forces(force, torque)
    if dimension < forces.dimension:
        axes = controlled_axes(forces, LEVEL, dimension)
        desired = force @ _least_inputs(axes @ force, torque, weight * axes[:, 2])
        direction = desired / np.linalg.norm(desired)
    elif forces.dimension:
        direction = hover_direction(forces)
    else:  # too few rotors for all torques; some make none, nearly so at tilts in decimals
        direction = np.array(LEVEL)
    ends = np.outer(vehicle.spins, [speed * abs(speed) for speed in limits])
    lower, upper = ends.min(axis=1), ends.max(axis=1)
    inputs = _least_inputs(force, torque, weight * direction)
    nearly = np.linalg.norm(force @ inputs / weight - direction) <= NEARLY
    if not (_within(inputs, lower, upper) and (forces.dimension or nearly)):
        from tiltsim_controllers.analysis.attainable import TiltedRotors
        from tiltsim_controllers.analysis.hover import evenest_inputs

        rotors = TiltedRotors(force, torque, lower, upper, weight)
        found = evenest_inputs(rotors, weight * direction)
        if found is None:
            needed = f", which takes {max(map(abs, _speeds(inputs))):.4g} rad/s" if nearly else ""
            raise InputError(
                "initial.rotor_speed: no rotor speeds within the limits hold the vehicle at its "
                f"initial tilts{needed}; give the speeds, or change vehicle.min_rotor_speed, "
                "vehicle.max_rotor_speed or the gait"
            )
        inputs = found
    return _speeds(inputs)


def _speeds(inputs: Floats) -> Values:
    """Signed speeds (rad/s) of inputs ``varpi |varpi|``, shape (N,)."""
    # Otherwise rounding, which depends on the processor, decides whether a rotor is at rest.
    inputs = np.where(np.abs(inputs) > REST * np.abs(inputs).max(), inputs, 0.0)
    return tuple((np.sign(inputs) * np.sqrt(np.abs(inputs))).tolist())


def _least_inputs(force: Floats, torque: Floats, desired: Floats) -> Floats:
    """The shortest ``varpi |varpi|`` that make a force, or components of it, without torque."""
    # Rows of one size: a force in N and a torque in N m do not compare.
    sizes = np.abs(force).max(), np.abs(torque).max()
    rows = np.vstack([force / sizes[0], torque / sizes[1]])
    values = np.concatenate([desired / sizes[0], np.zeros(3)])
    inputs: Floats = np.linalg.pinv(rows, rcond=TOLERANCE) @ values
    return inputs


def _within(inputs: Floats, lower: Floats, upper: Floats) -> bool:
    slack = TOLERANCE * np.abs(inputs).max()
    return bool(((inputs >= lower - slack) & (inputs <= upper + slack)).all())
