"""The tables of objects, of a tool and of a load: ``[[object]]``, ``[tool]``, ``[payload]``."""

from collections.abc import Sequence
from math import pi
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field

from tiltsim.models.cables import Cable
from tiltsim.models.mjcf_editing import MAX_BYTES
from tiltsim.models.objects import Body, Load, Objects, Tool
from tiltsim.scenario.messages import choose
from tiltsim.scenario.table import Refusals, Table, default
from tiltsim.system.files import is_file

SIZES: Final = {"wall": 2, "box": 3, "sphere": 1, "mesh": 1}
"""Numbers of the size of each type of object."""

MESHES: Final = (".stl", ".obj")

RESERVED: Final = frozenset({"vehicle", "payload", "contact_force", "air", "tilt", "law"})
"""Names that columns and parts of the vehicle already have."""


class ObjectTable(Body, Table):
    """Something to touch: fixed in the world, on a hinge, or free."""

    table_name = "object"

    def _check_values(self) -> None:
        if len(self.size) != SIZES[self.type]:
            raise self.mistake("size", f"a {self.type} has {SIZES[self.type]} of them")
        if self.type == "mesh":
            self._check_file()
        else:
            self.require("file", None, f"a {self.type} has none; set type = mesh, or remove it")
        if self.name in RESERVED:
            raise self.mistake("name", "is taken; choose another")
        if self.joint == "fixed":
            self.require("mass", None, "it is fixed; set joint = free or hinged, or remove it")
        elif self.mass is None:
            raise self.mistake("mass", f"must be given, as joint = {self.joint}")
        if self.joint != "hinged":
            needs = "needs joint = hinged"
            self.require_defaults(("hinge", "axis", "damping"), needs)
        elif not any(self.axis):
            raise self.mistake("axis", "must not be zero")
        if self.joint != "free":
            self.require_defaults(("velocity", "floating"), "needs joint = free")

    def _check_file(self) -> None:
        file = Path(self.file or "")
        if file.suffix.lower() not in MESHES:
            raise self.mistake("file", f"a mesh needs one of {' or '.join(MESHES)}")
        if not is_file(file):
            raise self.mistake("file", "is not a file")
        if file.stat().st_size > MAX_BYTES:
            raise self.mistake("file", f"has more than {MAX_BYTES // 2**20} MiB")


class ToolTable(Tool, Table):
    """A tool that the vehicle carries; the controller does not know its mass."""

    table_name = "tool"

    def _check_values(self) -> None:
        if not any(self.direction):
            raise self.mistake("direction", "must not be zero")
        if self.type == "stick" and self.length <= 2.0 * self.radius:
            raise self.mistake("length", f"must exceed twice the radius = {self.radius}")


class PayloadTable(Load, Table):
    """A load below the vehicle, on a cable that may be slack; the controller does not know it."""

    table_name = "payload"

    swing: Annotated[float, Field(ge=-0.5 * pi, le=0.5 * pi)] = default(
        0.0, "angle of the cable at time zero, from straight down toward +x [rad]"
    )

    swing_damping: Annotated[float, Field(ge=0.0, le=1.0)] = default(
        0.0,
        "damping ratio that a law gives the swing: its vehicle goes after the load, by the "
        "measured angle of the cable; not with python; 0 does not [-]",
        0.5,
    )

    def _check_values(self) -> None:
        if self.rigid:
            keys = ("swing", "swing_damping")
            self.require_defaults(keys, "a rigid load does not swing; remove it")


class CableTable(Cable, Table):
    """A cable from a vehicle to a free object, taut or slack, from one time to another."""

    table_name = "cable"

    def _check_values(self) -> None:
        if self.end is not None and self.end <= self.start:
            raise self.mistake("end", f"must be after start = {self.start}")


def objects_of(scenario: Any) -> Objects | None:
    """All that a scenario adds to its vehicle's model; None for a vehicle alone."""
    if not scenario.has_objects:
        return None
    return Objects(scenario.object, scenario.tool, scenario.payload, scenario.cable)


def object_refusals(scenario: Any) -> Refusals:
    """Objects, tools and loads where nothing could fly with them, or push them."""
    yield from _cable_refusals(scenario)
    controller, vehicle = scenario.controller, scenario.vehicle
    if scenario.reference.type == "push":
        scenario.reference.after_gait((), scenario)
        if controller.position_stiffness is None and not controller.is_external:
            able = (
                "choose full_pose, vectoring with position_bandwidth, geometric with tilts = free, "
                "numpy with push_stiffness, or python"
            )
            yield "reference.type", f"the {controller.law} law cannot push; {able}"
        scenario.reference.check_impedance(scenario)
    damps = scenario.payload is not None and scenario.payload.swing_damping
    if damps and not controller.is_external:
        if not controller.damps_swing:
            able = "choose full_pose, vectoring, geometric, pid, indi or numpy"
            reason = f"the {controller.law} law does not follow a reference's acceleration; {able}"
            yield "payload.swing_damping", reason
        if scenario.reference.kind == "attitude_altitude":
            yield "payload.swing_damping", "needs a reference of position"
    keys = ("object", "tool", "payload", "companion")
    key = next((name for name in keys if getattr(scenario, name)), None)
    if key is None:
        return
    if vehicle.is_planar:
        yield "vehicle.model", f"[{key}] is for rotorcraft only; remove it"
    if scenario.simulation.plant != "mujoco":
        reason = f"its equations have no contacts and no [{key}]; use mujoco"
        yield "simulation.plant", reason
    if scenario.simulation.integrator != "implicitfast":
        reason = f'must be "implicitfast" with [{key}]: the others gain energy at contacts and'
        yield "simulation.integrator", f"{reason} cables"
    if controller.measures_angular_acceleration:
        reason = f"does not know the forces of [{key}]; choose model"
        yield "controller.angular_acceleration", reason
    names = [table.name for table in scenario.object]
    least = 2.0 * scenario.simulation.timestep
    for table in scenario.object:
        if names.count(table.name) > 1:
            yield "object.name", "there are two of this name", table.name
        if table.softness < least:
            yield "object.softness", f"must be at least two time steps, {least:g}", table.softness
    file = scenario.any_rotorcraft.user_vehicle
    bare = scenario.tool is None and file is not None and not file.has_contact_geoms
    if scenario.object and bare:
        reason = "add a [tool], or name geoms that end in 'collision'"
        yield "object", f"nothing of vehicle.mjcf can touch it: {reason}"


def unknown_vehicle(name: str, companions: Sequence[str]) -> str:
    """The vehicles there are, if none has this name; empty if one has, or it is the first's, ""."""
    if not name or name in companions:
        return ""
    return choose(name, companions) if companions else "there is no [[companion]]"


def _cable_refusals(scenario: Any) -> Refusals:
    objects = {table.name: table.joint for table in scenario.object}
    vehicles = ["", *(table.name for table in scenario.companion)]
    names = [table.name for table in scenario.cable] + ["cable"] * (scenario.payload is not None)
    free = [name for name, joint in objects.items() if joint == "free"]
    for table in scenario.cable:
        if names.count(table.name) > 1 or table.name in (*RESERVED, *objects, *vehicles):
            yield "cable.name", "is taken; choose another", table.name
        if table.object not in free:
            reason = choose(table.object, free) if free else "there is no free [[object]]"
            yield "cable.object", reason, table.object
        if reason := unknown_vehicle(table.vehicle, vehicles[1:]):
            yield "cable.vehicle", reason, table.vehicle
