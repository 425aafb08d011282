"""Common parts of closed loops with rotorcraft of any number of rotors and tilt hinges."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from tiltsim.vehicles.rotorcraft.layout import Layout
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.analysis.torque_free import (
    controlled_axes,
    decoupling_condition,
    margin_over_flight,
    torque_free_forces,
)
from tiltsim_controllers.laws.failures import UNHARMED, Failure
from tiltsim_controllers.mathematics.scalar import Floats, Vector
from tiltsim_controllers.vehicle.effectiveness import force_and_torque

REFERENCE_COLUMNS: Final = ("x_ref", "y_ref", "z_ref", "roll_ref", "pitch_ref", "yaw_ref")

CONDITION: Final = "decoupling_condition"
"""A column: smallest over largest singular value of the decoupling matrix."""


def torque_free_columns(
    layout: Layout,
    table: Vector,
    samples: Mapping[str, Floats],
    dimension: int | None = None,
    failure: Failure = UNHARMED,
) -> dict[str, Floats]:
    """Angle (rad) to the nearest singular attitude, and how well the decoupling matrix inverts.

    Args:
        layout: Layout of the vehicle.
        table: Table of its rotors.
        samples: By field.
        dimension: How many components of force the controller controls; None for a controller
            without a decoupling matrix.
        failure: A rotor that the controller knows to have failed, which is left out from then on.
    """
    names = layout.names("alpha")
    angles = np.reshape([samples[name] for name in names], (len(names), len(samples["time"]))).T
    time, rotors = samples["time"], np.arange(1, layout.rotors + 1)
    known = time >= failure.known_from
    lost = known[:, np.newaxis] & (rotors == np.reshape(failure.rotor, (-1, 1)))
    works = ~lost[:, np.newaxis]
    force, torque = force_and_torque(table, angles)
    pushing, up = (force * works, torque * works), world_up(samples["roll"], samples["pitch"])
    forces = torque_free_forces(*pushing)
    begins = (time == time[:1]) | (known != np.roll(known, 1))
    columns = {"singularity_margin": margin_over_flight(forces, up, begins)}
    if dimension is not None:
        axes = controlled_axes(forces, up, dimension)
        columns[CONDITION] = decoupling_condition(*pushing, axes)
    return columns


def rotor_stops(rotors: int, remedy: str = "") -> tuple[str, ...]:
    """Causes of an end where the speed of a rotor reaches zero, one a rotor.

    Args:
        rotors: Their number.
        remedy: A key that also helps.
    """
    remedies = ["vehicle.min_rotor_speed = 100", *[remedy] * bool(remedy)]
    advice = ", ".join(remedies) + ", or a smaller step of the reference may help"
    return tuple(
        f"the decoupling matrix became singular: rotor {rotor} came to a stop; {advice}"
        for rotor in range(1, rotors + 1)
    )


def singular_attitude(sample: Mapping[str, float], tilts: tuple[str, ...]) -> str:
    """Cause of an end at an attitude and tilt angles, which have these names."""
    angles = ", ".join(f"{sample[name]:.3g}" for name in tilts)
    return (
        f"the decoupling matrix became singular at roll = {sample['roll']:.3g} rad, "
        f"pitch = {sample['pitch']:.3g} rad" + (f", tilt angles ({angles}) rad" if tilts else "")
    )
