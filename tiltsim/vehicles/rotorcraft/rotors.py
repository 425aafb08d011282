"""The rotors of the vehicle inside a layer."""

from typing import Any

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.scenario import Scenario
from tiltsim.vehicles.rotorcraft.layout import layout_of
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.body import Body, body_of, principal_body
from tiltsim_controllers.vehicle.craft import craft_parameters, craft_record
from tiltsim_controllers.vehicle.parameters import Vehicle


def rotors_record(loop: ClosedLoop) -> Any:
    """The type of the parameters of a model's vehicle; see `true_rotors`."""
    return craft_record(*layout_of(loop)) if loop.tilt_of_rotor else Vehicle


def true_rotors(scenario: Scenario) -> Any:
    """The parameters of the simulated vehicle, not the controller's.

    `tiltsim_controllers.vehicle.craft.craft_of` makes its arrays.
    """
    vehicle = scenario.true_vehicle
    if not isinstance(vehicle, Multirotor):
        return vehicle
    body = body_of(vehicle.mass, np.reshape(vehicle.inertia, (3, 3)), vehicle.gravity)
    return craft_parameters(body, vehicle.rotors)


def body_less(scenario: Scenario, inertias: Values) -> Body:
    """The simulated vehicle's body without inertias (kg m^2) about its hinges."""
    vehicle = scenario.true_vehicle
    if isinstance(vehicle, Multirotor):
        inertia = np.reshape(vehicle.inertia, (3, 3)).copy()
        for tilt, own in enumerate(inertias):
            axis = next(rotor.hinge_axis for rotor in vehicle.rotors if rotor.tilt == tilt)
            inertia -= own * np.outer(axis, axis)
        return body_of(vehicle.mass, inertia, vehicle.gravity)
    # two hinges lie along each axis; a quadrotor has none
    about_x, about_y = (2.0 * own for own in inertias[:2] or (0.0, 0.0))
    return principal_body(
        vehicle._replace(
            inertia_xx=vehicle.inertia_xx - about_x, inertia_yy=vehicle.inertia_yy - about_y
        )
    )
