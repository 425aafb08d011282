"""What the thesis's laws of the tiltrotor have in common, in closed form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ControlSetup
from tiltsim.engines.sample_evaluation import flights_in
from tiltsim.equations.tiltrotor import equations_of_motion
from tiltsim.laws.rotor_loop import RotorLayout
from tiltsim.laws.rotorcraft import rotor_stops, singular_attitude
from tiltsim_controllers.analysis.singularity import determinant, margin_over_gait
from tiltsim_controllers.mathematics.rotation import world_up_in_body
from tiltsim_controllers.mathematics.scalar import Floats, Quad, Triple, Values, Vector, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import (
    sines_and_cosines,
    torque_entries,
    torque_free_force,
)
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle, drag_ratio
from tiltsim_controllers.vehicle.states import ALPHA_1, PITCH, ROLL, ROTORS, SPEED_1, TILT_FIELDS

TILT_REFERENCE_COLUMNS: Final = tuple(f"alpha_ref_{rotor}" for rotor in ROTORS)


TILTROTOR_LAYOUT: Final = RotorLayout((0, 1, 2, 3), SPIN, "tiltrotor")


@scalar
def four(values: Vector, first: int) -> Quad:
    """Four consecutive values."""
    return values[first], values[first + 1], values[first + 2], values[first + 3]


@scalar
def tiltrotor_motion(
    state: Vector, tilts: Quad, inputs: Vector, parameters: Any, knots: Vector, disturbance: Triple
) -> Values:
    """The thesis's equations.

    Args:
        state, tilts, inputs, parameters, knots, disturbance: As of `RotorLaw.motion`.
    """
    return equations_of_motion(state, tilts, four(inputs, 0), parameters.law.vehicle, disturbance)


def singularity_columns(samples: Mapping[str, Floats], vehicle: Vehicle) -> dict[str, Floats]:
    """Determinant of the attitude-altitude law, and the margin (rad) to a singular attitude."""
    tilts = np.stack([samples[name] for name in TILT_FIELDS], axis=-1)
    attitude = samples["roll"], samples["pitch"]
    return {
        "singularity_margin": margin_over_gait(
            tilts, vehicle, *attitude, flights=flights_in(samples["time"])
        ),
        "determinant": determinant(tilts, *attitude, vehicle),
    }


@scalar
def watched_vehicle(time: float, parameters: Any) -> float:
    """What the tiltrotor's supervisor reads of it."""
    return drag_ratio(parameters.law.vehicle)


def singularity_margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """`singularity_columns` of a flight; see `RotorLaw.margins`."""
    return singularity_columns(samples, setup.parameters.law.vehicle)


ROTOR_STOPS: Final = rotor_stops(4)
"""Causes for `rotor_speeds_along_spin`: the decoupling matrix has the factor ``2 |varpi|``."""


@scalar
def rotor_speeds_along_spin(values: Vector) -> Quad:
    """Rotor speeds (rad/s) along their spin, of a sample's ``values``."""
    s1, s2, s3, s4 = four(values, SPEED_1)
    return -s1, s2, -s3, s4


@scalar
def scaled_determinant(values: Vector, vehicle: Vehicle) -> float:
    """Determinant of the decoupling matrix without the rotor speeds, of a sample's ``values``."""
    ratio = drag_ratio(vehicle)
    a1, a2, a3, a4 = four(values, ALPHA_1)
    trig = sines_and_cosines(a1, a2, a3, a4)
    nx, ny, nz = torque_free_force(trig, torque_entries(trig, ratio), ratio)
    ux, uy, uz = world_up_in_body(values[ROLL], values[PITCH])
    return nx * ux + ny * uy + nz * uz


@scalar
def determinant_and_speeds(time: float, values: Vector, parameters: Any, knots: Vector) -> Values:
    """`scaled_determinant` and `rotor_speeds_along_spin`."""
    determinant = scaled_determinant(values, parameters.law.vehicle)
    return (determinant, *rotor_speeds_along_spin(values))


def determinant_and_speed_causes(
    sample: Mapping[str, float], _setup: ControlSetup
) -> tuple[str, ...]:
    """Causes for `determinant_and_speeds`."""
    return (singular_attitude(sample, TILT_FIELDS), *ROTOR_STOPS)
