"""Shapes that lie in each other at the start of a flight: refused before anything moves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np

from tiltsim.errors import InputError

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario

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
