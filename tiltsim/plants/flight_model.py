"""The MuJoCo model that a flight integrates."""

from typing import Final

import mujoco

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import HEADER_SIZE
from tiltsim.errors import InputError
from tiltsim.models.parts import Visuals
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.scenario_tables import DESCRIPTIVE

_TABLES_WITHOUT_EFFECT: Final = frozenset(
    (*DESCRIPTIVE, "simulation", "initial", "gait", "reference", "sensors")
)
"""Tables of a scenario that do not change the model, except for two keys of ``simulation``."""


def flight_model(
    assembly: Assembly, knots: int | None = None, *, visuals: bool = False
) -> mujoco.MjModel:
    """The model that a flight integrates; see `build_model`.

    With ``visuals`` the flight is equal bit for bit and the model also has drawn and measured
    parts, unless there is something to touch.
    """
    visuals = visuals and not assembly.scenario.has_contacts
    model = build_model(assembly, knots=knots, visuals=visuals)
    if visuals:
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    # A diverged state must stay visible; by default MuJoCo would silently start over.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


def model_cache_key(scenario: Scenario) -> str:
    """Equal only for scenarios whose models are equal, provided that they fly the same loop."""
    simulation = scenario.simulation
    tables = [value for name, value in scenario if name not in _TABLES_WITHOUT_EFFECT]
    return repr((tables, simulation.timestep, simulation.integrator))


def evaluations_per_step(model: mujoco.MjModel) -> int:
    """Number of evaluations of the controls per step of MuJoCo's integrator."""
    return 4 if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4 else 1


def build_model(
    assembly: Assembly, *, knots: int | None = None, visuals: Visuals = False
) -> mujoco.MjModel:
    """Compile the vehicle of a flight. Raises `InputError` if MuJoCo cannot.

    Args:
        assembly: The flight.
        knots: Room for knots in ``userdata``, where several flights share the model; default: its
            own.
        visuals: Whether the model has the parts that are only drawn; see `Visuals`.
    """
    loop, scenario = assembly.loop, assembly.scenario
    size = HEADER_SIZE + loop.record_size + (len(assembly.setup.knots) if knots is None else knots)
    try:
        model = loop.kind.compile(
            scenario, loop.controller_states, loop.extra_actuators, size, visuals
        )
    except ValueError as error:
        raise InputError(f"{scenario.address or 'scenario'}: vehicle: {error}") from error
    model.opt.gravity += scenario.disturbance_acceleration
    return model
