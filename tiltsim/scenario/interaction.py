"""The world of a scenario beside its vehicle: objects, a tool, a load, cables, further vehicles.

Each ``[[companion]]`` names a scenario whose vehicle, controller, gait and reference it takes, or
takes them from the file that it is in. Time steps, ground and objects are the file's.
"""

from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final

from pydantic import BeforeValidator, Field

from tiltsim.errors import InputError
from tiltsim.models.cables import Cable
from tiltsim.models.mjcf_editing import MAX_BYTES
from tiltsim.models.objects import Body, Load, Objects, Tool
from tiltsim.scenario.controller import OwnFunctionController
from tiltsim.scenario.documents import merge
from tiltsim.scenario.library import find_scenario_file, read_toml
from tiltsim.scenario.messages import InvalidValueError, choose
from tiltsim.scenario.table import ZEROS, Name, Positive, Table, Vector3, default, example, required
from tiltsim.system.files import is_file
from tiltsim.system.public import public

SIZES: Final = {"wall": 2, "box": 3, "sphere": 1, "mesh": 1}
"""Numbers of the size of each type of object."""

MESHES: Final = (".stl", ".obj")

RESERVED: Final = frozenset({"vehicle", "payload", "contact_force", "air", "tilt", "law"})
"""Names that columns and parts of the vehicle already have."""


class ObjectTable(Body, Table):
    """Something to touch: fixed in the world, on a hinge, or free."""

    table_name = "object"
    only_with: ClassVar = {
        ("file",): ("type", "mesh"),
        ("mass",): ("joint", "hinged", "free"),
        ("hinge", "axis", "damping"): ("joint", "hinged"),
        ("velocity", "floating"): ("joint", "free"),
    }

    def _check_values(self) -> None:
        if len(self.size) != SIZES[self.type]:
            raise self.mistake("size", f"a {self.type} has {SIZES[self.type]} of them")
        if self.name in RESERVED:
            raise self.mistake("name", "is taken; choose another")
        if self.joint != "fixed" and self.mass is None:
            raise self.mistake("mass", f"must be given, as joint = {self.joint}")
        if not any(self.axis):
            raise self.mistake("axis", "must not be zero")
        if self.type == "mesh":
            self._check_file()

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
    only_with: ClassVar = {("swing", "swing_damping"): ("rigid", False)}

    swing: Annotated[float, Field(ge=-0.5 * pi, le=0.5 * pi)] = default(
        0.0, "angle of the cable at time zero, from straight down toward +x [rad]"
    )

    swing_damping: Annotated[float, Field(ge=0.0, le=1.0)] = default(
        0.0,
        "damping ratio that a law gives the swing: its vehicle goes after the load, by the "
        "measured angle of the cable; not with python; 0 does not [-]",
        0.5,
    )


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


def check_objects(scenario: Any) -> None:
    """Refuse objects, tools and loads where nothing could fly with them, or push them."""
    _check_cables(scenario)
    controller, vehicle = scenario.controller, scenario.vehicle
    if scenario.reference.type == "push":
        scenario.reference.after_gait((), scenario)
        if controller.position_stiffness is None and not controller.is_external:
            able = (
                "choose full_pose, vectoring with position_bandwidth, geometric with tilts = free, "
                "numpy with push_stiffness, or python"
            )
            scenario.refuse("reference.type", f"the {controller.law} law cannot push; {able}")
        scenario.reference.check_impedance(scenario)
    damps = scenario.payload is not None and scenario.payload.swing_damping
    if damps and not controller.is_external:
        if not controller.damps_swing:
            able = "choose full_pose, vectoring, geometric, pid, indi or numpy"
            reason = f"the {controller.law} law does not follow a reference's acceleration; {able}"
            scenario.refuse("payload.swing_damping", reason)
        if scenario.reference.kind == "attitude_altitude":
            scenario.refuse("payload.swing_damping", "needs a reference of position")
    keys = ("object", "tool", "payload", "companion")
    key = next((name for name in keys if getattr(scenario, name)), None)
    if key is None:
        return
    if vehicle.is_planar:
        scenario.refuse("vehicle.model", f"[{key}] is for rotorcraft only; remove it")
    if scenario.simulation.plant != "mujoco":
        reason = f"its equations have no contacts and no [{key}]; use mujoco"
        scenario.refuse("simulation.plant", reason)
    if scenario.simulation.integrator != "implicitfast":
        reason = f'must be "implicitfast" with [{key}]: the others gain energy at contacts and'
        scenario.refuse("simulation.integrator", f"{reason} cables")
    if controller.measures_angular_acceleration:
        reason = f"does not know the forces of [{key}]; choose model"
        scenario.refuse("controller.angular_acceleration", reason)
    names = [table.name for table in scenario.object]
    least = 2.0 * scenario.simulation.timestep
    for table in scenario.object:
        if names.count(table.name) > 1:
            scenario.refuse("object.name", "there are two of this name", table.name)
        if table.softness < least:
            scenario.refuse(
                "object.softness", f"must be at least two time steps, {least:g}", table.softness
            )
    file = scenario.any_rotorcraft.user_vehicle
    bare = scenario.tool is None and file is not None and not file.has_contact_geoms
    if scenario.object and bare:
        reason = "add a [tool], or name geoms that end in 'collision'"
        scenario.refuse("object", f"nothing of vehicle.mjcf can touch it: {reason}")


def unknown_vehicle(name: str, companions: Sequence[str]) -> str:
    """The vehicles there are, if none has this name; empty if one has, or it is the first's, ""."""
    if not name or name in companions:
        return ""
    return choose(name, companions) if companions else "there is no [[companion]]"


def _check_cables(scenario: Any) -> None:
    objects = {table.name: table.joint for table in scenario.object}
    vehicles = ["", *(table.name for table in scenario.companion)]
    names = [table.name for table in scenario.cable] + ["cable"] * (scenario.payload is not None)
    free = [name for name, joint in objects.items() if joint == "free"]
    for table in scenario.cable:
        if names.count(table.name) > 1 or table.name in (*RESERVED, *objects, *vehicles):
            scenario.refuse("cable.name", "is taken; choose another", table.name)
        if table.object not in free:
            reason = choose(table.object, free) if free else "there is no free [[object]]"
            scenario.refuse("cable.object", reason, table.object)
        if reason := unknown_vehicle(table.vehicle, vehicles[1:]):
            scenario.refuse("cable.vehicle", reason, table.vehicle)


TAKEN: Final = (
    "vehicle",
    "model_error",
    "initial",
    "controller",
    "gait",
    "reference",
    "tool",
    "disturbance",
    "air",
    "sensors",
    "fault",
)
"""Tables of a scenario that belong to its vehicle; the others are the world's."""

MAX_COMPANIONS: Final = 7


def _tables_at(value: Any) -> Any:
    """The tables of a scenario in place of its address."""
    if not isinstance(value, str) or not value:
        return {} if value == "" else value
    try:
        named = public("load_scenario")(value, {"companion": []})
    except InputError as error:
        reason = str(error).removeprefix(f"{value}: ")
        raise InvalidValueError("companion.scenario", value, reason) from None
    if named.payload is not None:
        raise InvalidValueError("companion.scenario", value, "a companion carries no load")
    name, _, variant = value.partition("#")
    document = read_toml(find_scenario_file(name))
    chosen = [one for one in document.get("variant", ()) if one["name"] == variant] or [document]
    if chosen[0].get("companion", document.get("companion")):
        raise InvalidValueError("companion.scenario", value, "a companion has no companions")
    tables = named.model_dump(mode="json", exclude_unset=True)
    return {key: tables[key] for key in TAKEN if key in tables}


class CompanionTable(Table):
    """A further vehicle in the same world, under its own controller."""

    model_config = example(name="wing", offset=[2.0, 0.0, 0.0])
    table_name = "companion"

    name: Name = required("its name, which begins the names of its columns", "wing")
    scenario: Annotated[dict[str, Any], BeforeValidator(_tables_at)] = Field(
        {},
        description="address of the scenario whose vehicle, controller, gait, reference and the "
        "like it takes: a name of the library, or a .toml file relative to the scenario's folder; "
        "default: this file's",
        examples=["fleet/hexarotor#hover"],
        json_schema_extra={"type": "string"},
    )
    offset: Vector3 = default(
        ZEROS, "of its start and of its reference, in the world [m]", [2.0, 0.0, 0.0]
    )
    changes: dict[str, Any] = default(
        {},
        "tables and keys in place of its scenario's",
        {"reference": {"type": "setpoint", "yaw": 0.5}},
    )

    def tables(self, own: Mapping[str, Any], world: Mapping[str, Any]) -> dict[str, Any]:
        """The document of its scenario.

        Args:
            own: The tables of the file that it is in.
            world: The tables of the world.

        Raises:
            InvalidValueError: If it changes a table that is not its vehicle's.
        """
        for key, value in self.changes.items():
            if key not in TAKEN:
                raise InvalidValueError(f"companion.changes.{key}", value, choose(key, TAKEN))
        taken = self.scenario or {key: own[key] for key in TAKEN if key in own}
        document = merge(taken, self.changes)
        if any(self.offset):
            self._shift(document)
        return {**document, **world}

    def _shift(self, document: dict[str, Any]) -> None:
        """Add the offset to the start and the reference in a document."""

        def shifted(position: Any) -> list[float]:
            return [a + b for a, b in zip(position, self.offset, strict=True)]

        origin = (0.0, 0.0, 0.0)
        initial = dict(document.get("initial", {}))
        reference = dict(document.get("reference", {"type": "setpoint"}))
        initial["position"] = shifted(initial.get("position", origin))
        kind = reference.get("type")
        if kind == "attitude_altitude":
            reference["altitude"] = reference.get("altitude", 0.0) + self.offset[2]
        elif kind == "waypoints":
            reference["positions"] = [shifted(point) for point in reference.get("positions", ())]
        elif kind == "table" and reference.get("file"):
            raise self.mistake("offset", "cannot move a reference from a file; give its rows")
        elif kind == "table":
            rows = reference.get("rows") or ()
            reference["rows"] = [[row[0], *shifted(row[1:4]), *row[4:]] for row in rows]
        else:
            reference["position"] = shifted(reference.get("position", origin))
        document |= {"initial": initial, "reference": reference}


class DownwashTable(Table):
    """The wake of each vehicle on the vehicles below: a jet with the momentum of its weight."""

    table_name = "downwash"

    rotor_radius: Positive = required("of the rotors of all vehicles [m]", 0.1)
    drag_area: Positive = required(
        "drag coefficient times area of a vehicle in the wake from above [m^2]", 0.02
    )


def companions_of(scenario: Any) -> tuple[Any, ...]:
    """The scenarios of the companions of a scenario, each in its world.

    Raises:
        InvalidValueError: If one of them is no valid scenario.
    """
    if not scenario.companion:
        return ()
    own = scenario.model_dump(mode="json", exclude_unset=True, exclude={"companion"})
    simulation, found = own.get("simulation", {}), []
    for number, table in enumerate(scenario.companion, start=1):
        seed = scenario.simulation.seed + number  # or sensors would have equal noise
        world = {"simulation": {**simulation, "seed": seed}, "ground": own.get("ground")}
        try:
            tables = table.tables(own, world)
            found.append(type(scenario).model_validate(tables, address=f"companion {table.name}"))
        except InputError as error:
            reason = str(error).removeprefix(f"companion {table.name}: ")
            raise InvalidValueError("companion.name", table.name, reason) from None
        except (TypeError, ValueError) as error:  # of numbers that are none
            if isinstance(error, InvalidValueError):
                raise
            raise table.mistake("changes", "does not fit its scenario") from None
    return tuple(found)


def check_companions(scenario: Any) -> None:
    """Refuse companions of equal names, or whose scenario does not fly beside the others."""
    if (count := len(scenario.companion)) > MAX_COMPANIONS:
        scenario.refuse("companion", f"at most {MAX_COMPANIONS} of them", count)
    if scenario.downwash is not None and not scenario.companion:
        scenario.refuse("downwash", "needs a [[companion]]; remove it")
    names = [table.name for table in (*scenario.companion, *scenario.object)]
    for table in scenario.companion:
        if names.count(table.name) > 1 or table.name in RESERVED:
            raise table.mistake("name", "is taken; choose another")
    if scenario.companion and (reason := _conflict(scenario, scenario)):
        scenario.refuse("companion", f"with companions {reason}", names[0])
    for table, each in zip(scenario.companion, companions_of(scenario), strict=True):
        if reason := _conflict(each, scenario):
            raise table.mistake("name", reason)


def _conflict(scenario: Any, first: Any) -> str:
    """The reason for which a scenario cannot fly in the world of the first; empty for none."""
    if scenario.vehicle.is_planar:
        return "every vehicle has to be a rotorcraft"
    if isinstance(scenario.controller, OwnFunctionController):
        law = scenario.controller.law
        return f"controller.law = {law!r} cannot fly; choose a built-in law or a package's"
    if scenario.controller.measures_angular_acceleration:
        return "controller.angular_acceleration must be model: measured knows no contacts"
    if scenario.sensors.instruments:
        return "instruments in [sensors] know no contacts; remove them"
    gravity, world = (one.vehicle.resolve().gravity for one in (scenario, first))
    if gravity != world:
        return f"vehicle.gravity = {gravity:g}, and the first vehicle's is {world:g}; change one"
    if scenario.disturbance_acceleration != first.disturbance_acceleration:
        return "a disturbance by an acceleration acts on all: give all vehicles the same"
    return ""
