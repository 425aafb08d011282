"""Building the plant of a flight."""

import mujoco

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.base import EngineName
from tiltsim.plants.equations_plant import EquationsPlant
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.plants.plant import Plant
from tiltsim.plants.user_controller import UserControlledPlant


def make_plant(
    assembly: Assembly, engine: EngineName | None = None, model: mujoco.MjModel | None = None
) -> Plant:
    """The plant that a scenario requests, at its initial state.

    Args:
        assembly: The flight.
        engine: Engine in place of the scenario's.
        model: Model for MuJoCo; default: the one that `flight_model` compiles.

    Raises:
        InputError: If MuJoCo cannot compile the vehicle, or the user's controller cannot be loaded.
    """
    if assembly.scenario.controller.is_external:
        return UserControlledPlant(assembly, model)
    if assembly.scenario.simulation.plant == "mujoco":
        return MujocoPlant(assembly, model, engine)
    return EquationsPlant(assembly, engine)
