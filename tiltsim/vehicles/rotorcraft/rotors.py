"""The rotors of the vehicle inside a layer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.models.rotor_table import Multirotor
from tiltsim_controllers.vehicle.multirotor import body_of
from tiltsim_controllers.vehicle.rotor_code import (
    TILTING_CROSS,
    UPRIGHT_CROSS,
    RotorCode,
    RotorlessBody,
    rotor_code_of,
    rotors_of,
)

if TYPE_CHECKING:
    from tiltsim.closed_loop.loop import Dynamics
    from tiltsim.scenario.scenario import Scenario
    from tiltsim_controllers.mathematics.scalar import Values

CROSSES: Final = {"tiltrotor": TILTING_CROSS, "quadrotor": UPRIGHT_CROSS}
"""Those of vehicles whose rotors lie on a cross, by the model's name."""


def rotor_code(dynamics: Dynamics) -> RotorCode:
    """The scalar functions of a model's rotors."""
    if dynamics.tilt_of_rotor:
        return rotor_code_of(dynamics.tilt_of_rotor)
    return CROSSES[dynamics.model]


def true_rotors(scenario: Scenario) -> Any:
    """The record that these functions read: of the simulated vehicle, not the controller's."""
    vehicle = scenario.true_vehicle
    if not isinstance(vehicle, Multirotor):
        return vehicle
    body = body_of(vehicle.mass, np.reshape(vehicle.inertia, (3, 3)), vehicle.gravity)
    return rotors_of(body, vehicle.rotors)


def body_less(scenario: Scenario, inertias: Values) -> Any:
    """The simulated vehicle's `RotorCode.body` without inertias (kg m^2) about its hinges."""
    vehicle = scenario.true_vehicle
    if isinstance(vehicle, Multirotor):
        inertia = np.reshape(vehicle.inertia, (3, 3)).copy()
        for tilt, own in enumerate(inertias):
            axis = next(rotor.hinge_axis for rotor in vehicle.rotors if rotor.tilt == tilt)
            inertia -= own * np.outer(axis, axis)
        return RotorlessBody(body_of(vehicle.mass, inertia, vehicle.gravity))
    about_x, about_y = (2.0 * own for own in inertias[:2])  # two hinges lie along each
    return vehicle._replace(
        inertia_xx=vehicle.inertia_xx - about_x, inertia_yy=vehicle.inertia_yy - about_y
    )
