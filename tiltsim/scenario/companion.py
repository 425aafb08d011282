"""Further vehicles in the world of a scenario: ``[[companion]]``.

Each names a scenario whose vehicle, controller, gait and reference it takes, or takes them from the
file that it is in. Time steps, ground and objects are the file's.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, Field

from tiltsim.errors import InputError
from tiltsim.scenario.controller import OwnFunctionController
from tiltsim.scenario.documents import merge
from tiltsim.scenario.interaction import RESERVED
from tiltsim.scenario.library import find_scenario_file, read_toml
from tiltsim.scenario.messages import InvalidValueError, choose
from tiltsim.scenario.table import ZEROS, Name, Positive, Table, Vector3, default, example, required
from tiltsim.system.public import public

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
    if len(scenario.companion) > MAX_COMPANIONS:
        count = len(scenario.companion)
        raise InvalidValueError("companion", count, f"at most {MAX_COMPANIONS} of them")
    if scenario.downwash is not None and not scenario.companion:
        raise scenario.mistake("downwash", "needs a [[companion]]; remove it")
    names = [table.name for table in (*scenario.companion, *scenario.object)]
    for table in scenario.companion:
        if names.count(table.name) > 1 or table.name in RESERVED:
            raise table.mistake("name", "is taken; choose another")
    if scenario.companion and (reason := _conflict(scenario, scenario)):
        raise InvalidValueError("companion", names[0], f"with companions {reason}")
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
    if _accelerations(scenario) != _accelerations(first):
        return "a disturbance by an acceleration acts on all: give all vehicles the same"
    return ""


def _accelerations(scenario: Any) -> list[Any]:
    return [each for each in scenario.disturbance if each.type == "acceleration"]
