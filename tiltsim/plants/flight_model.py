"""The compiled MuJoCo model of a scenario."""

from __future__ import annotations

from typing import Final

import mujoco

from tiltsim.closed_loop.userdata import HEADER_SIZE
from tiltsim.errors import InputError
from tiltsim.laws.assembling import loop_of
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.scalar import Triple


def flight_model(scenario: Scenario, parameters: int) -> mujoco.MjModel:
    """The model that a scenario flies, with room for as many floats of parameters.

    Raises `InputError` where MuJoCo cannot build it.
    """
    model = build_model(scenario, userdata_size=HEADER_SIZE + parameters)
    # A diverged state must stay visible; by default MuJoCo would silently start over.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


_FLOWN_IN_ANY_MODEL: Final = frozenset(
    {
        *("title", "source", "without", "simulation", "initial", "gait", "reference", "sensors"),
        "expect",
    }
)
"""Tables of a scenario that are parameters or initial state of a flight, or no part of it."""


def model_cache_key(scenario: Scenario) -> str:
    """Equal only for scenarios that `flight_model` builds equal models for, if one loop flies."""
    simulation = scenario.simulation
    tables = [value for name, value in scenario if name not in _FLOWN_IN_ANY_MODEL]
    return repr((tables, simulation.timestep, simulation.integrator))


def evaluations_per_step(model: mujoco.MjModel) -> int:
    """How often MuJoCo's integrator asks for controls in a step."""
    return 4 if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4 else 1


def disturbing_acceleration(scenario: Scenario) -> Triple:
    """The sum of a scenario's disturbances, m/s^2, world."""
    x, y, z = (sum(d.value[axis] for d in scenario.disturbance) for axis in range(3))
    return float(x), float(y), float(z)


def build_model(
    scenario: Scenario, *, userdata_size: int = 0, visuals: bool = False
) -> mujoco.MjModel:
    """Compile the scenario's vehicle, with what is drawn of it only if asked.

    Raises `InputError` where MuJoCo cannot build it.
    """
    loop = loop_of(scenario)
    try:
        model = loop.kind.compile(
            scenario, loop.law_states, loop.extra_actuators, userdata_size, visuals
        )
    except ValueError as error:
        raise InputError(f"{scenario.address or 'scenario'}: vehicle: {error}") from error
    model.opt.gravity += disturbing_acceleration(scenario)
    return model
