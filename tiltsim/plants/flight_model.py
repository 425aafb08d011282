"""The MuJoCo model that a flight integrates, and a check of its start."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import HEADER_SIZE
from tiltsim.errors import InputError
from tiltsim.models.parts import Visuals
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.scenario_tables import DESCRIPTIVE

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario

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


OVERLAP: Final = 1e-4
"""Depth (m) from which shapes count as lying in each other."""


def check_start(scenario: Scenario, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Refuse an overlap.

    Raises:
        InputError: In one line, if an object lies in another thing, or the tool in a rotor.
    """
    where = scenario.address or "scenario"
    for contact in data.contact:
        if contact.dist < -OVERLAP:
            names = sorted(_name(model, geom) for geom in (contact.geom1, contact.geom2))
            raise InputError(
                f"{where}: {names[0]} and {names[1]} overlap by {-contact.dist:.3g} m at the "
                "start; move one of them"
            )
    for table in scenario.cable:
        tendon = model.tendon(table.name)
        apart = float(data.ten_length[tendon.id])
        if table.start == 0.0 and apart > table.length + OVERLAP:
            raise InputError(
                f"{where}: cable {table.name}: its ends are {apart:.4g} m apart at the start, and "
                f"cable.length = {table.length:g}"
            )
    prefixes = ("", *(f"{table.name}_" for table in scenario.companion))
    for prefix, each in zip(prefixes, (scenario, *scenario.companions), strict=True):
        rotor = None if each.tool is None else _touched_rotor(model, data, prefix)
        if rotor is not None:
            raise InputError(
                f"{where}: tool: touches {rotor} of its own vehicle; change tool.position, "
                "tool.direction or tool.length"
            )


def _touched_rotor(model: mujoco.MjModel, data: mujoco.MjData, prefix: str) -> str | None:
    """A rotor that the tool of a vehicle touches, the names of whose parts have a prefix."""
    tool = model.geom(f"{prefix}tool_collision").id
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        turns = name.startswith((f"{prefix}pod_", f"{prefix}rotor_")) and name.endswith("collision")
        if turns and mujoco.mj_geomDistance(model, data, tool, geom, 1.0, np.zeros(6)) < 0.0:
            return str(name.removesuffix("_collision"))
    return None


def _name(model: mujoco.MjModel, geom: int) -> str:
    name = model.geom(geom).name or "a shape of the vehicle"
    if name.startswith("object_"):
        return f"object {name.removeprefix('object_')}"
    return name.removesuffix("_collision")
