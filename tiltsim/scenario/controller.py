"""The ``[controller]`` table of a scenario: one model per law, with the keys of that law.

Installed packages bring further laws: an entry point of the group ``tiltsim.controllers`` names a
law and its table, a `tiltsim.LawController`. An entry that cannot be used is left out with a
warning, so that a broken package does not stop flights that do not need it.
"""

from collections.abc import Container
from contextlib import suppress
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points
from inspect import isabstract
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, get_args

from pydantic import Field, model_validator

from tiltsim.scenario import baseline_controllers, linearizing_controllers, vectoring_controller
from tiltsim.scenario.controller_table import ControllerTable
from tiltsim.scenario.kinds import KINDS, tables_of, union_of
from tiltsim.scenario.law_controller import EveryRotorcraft, LawController, TiltingTable
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import Positive, default, example, required
from tiltsim.system.arguments import warn_user
from tiltsim.system.interrupts import defer_interrupts
from tiltsim.system.text import error_text, printable

GROUP: Final = "tiltsim.controllers"


def installed_controllers(built_in: Container[str]) -> dict[str, type[ControllerTable]]:
    """The tables of all installed packages by the names of their laws.

    If several packages have the same law, the first package by name is taken.
    """
    found: dict[str, type[ControllerTable]] = {}
    owners: dict[str, str] = {}
    entries = [(entry.name, _package(entry.dist), entry) for entry in _entries()]
    for name, package, entry in sorted(entries, key=lambda one: one[:2]):
        with defer_interrupts():  # so that one raised within is the package's own
            loaded = _loaded(entry, built_in)
        if name in owners:
            loaded = f"the package {owners[name]} has a controller of this name"
        if isinstance(loaded, str):
            _warn(f"the controller {name} of the package {package} is left out: {loaded}")
        else:
            found[name], owners[name] = loaded, package
    return found


def _entries() -> list[EntryPoint]:
    """Entries of all packages; a package whose list cannot be read is left out with a warning."""
    try:
        return [*entry_points(group=GROUP)]
    except Exception:
        pass
    found: dict[str, list[EntryPoint]] = {}
    for distribution in distributions():
        package = _package(distribution)
        try:
            found.setdefault(package, [*distribution.entry_points.select(group=GROUP)])
        except Exception as error:
            _warn(f"the package {package} is left out: its entry_points.txt: {error_text(error)}")
    return [entry for entries in found.values() for entry in entries]


def _package(distribution: Distribution | None) -> str:
    """The name of a package, as far as its files tell."""
    with suppress(Exception):
        assert distribution is not None
        return str(distribution.name)
    return "?"


def _warn(text: str) -> None:
    """Warn once, not in the processes that this one starts."""
    from multiprocessing import parent_process  # costs start-up time

    if parent_process() is None:
        warn_user(printable(text))


def _loaded(entry: EntryPoint, built_in: Container[str]) -> type[ControllerTable] | str:
    """The table of an entry point, or why it cannot be used, whatever its code raises."""
    try:
        table = entry.load()
        if not (isinstance(table, type) and issubclass(table, LawController)):
            return f"{entry.value} is no subclass of tiltsim.LawController"
        if entry.name in built_in:
            return "tiltsim has a law of this name"
        if isabstract(table):
            return f"{entry.value} has no method {', '.join(sorted(table.__abstractmethods__))}"
        if get_args(table.model_fields["law"].annotation) != (entry.name,):
            return f'{entry.value} needs the field law: Literal["{entry.name}"]'
        table.model_json_schema()  # completes the table; tiltsim schema needs it
    except BaseException as error:
        return error_text(error)
    return table


DEFAULT_LAW: Final = "attitude_altitude"

StateUnits = dict[Annotated[str, Field(pattern="^state_[a-z0-9_]+$")], str]
"""Names and units of states."""


class OwnFunctionController(ControllerTable):
    """A function of the user's."""

    follows_turns = True
    needs_four_rotors = False

    function: str = required(
        "FILE.py:NAME of a function or class; FILE in the scenario's folder",
        "my_controller.py:hover",
    )

    @model_validator(mode="before")
    @classmethod
    def _require_function(cls, value: Any) -> Any:
        if isinstance(value, dict) and "function" not in value:
            raise InvalidValueError(
                "controller.law",
                value.get("law"),
                "needs controller.function = FILE.py:NAME; a controller of your own in Python is "
                "the argument controller= of tiltsim.load_scenario and simulate",
            )
        return value

    @property
    def file(self) -> Path | None:
        """The file; None for a controller that was given in Python."""
        path, _, _ = self.function.rpartition(":")
        return Path(path) if path.endswith(".py") else None

    @property
    def attribute(self) -> str:
        """The name within the file."""
        return self.function.rpartition(":")[2]


class PythonController(OwnFunctionController):
    """A user's own controller in Python; see `tiltsim.plants.commanded_plant`."""

    vehicle_models = EveryRotorcraft()
    reference_kinds = ("position", "pose", "attitude_altitude")
    is_external = True
    rotors_have_speeds = True
    leans_unrecorded = True

    law: Literal["python"] = required("a user's own controller")


class NumpyController(OwnFunctionController, TiltingTable):
    """A user's own law on NumPy arrays; see docs/own_controller.md."""

    model_config = example(law="numpy", function="my_law.py:hover")

    reference_kinds = ("position", "pose", "attitude_altitude")

    law: Literal["numpy"] = required(
        "your own law, a function of NumPy arrays, which flies as compiled code"
    )
    parameters: dict[str, Any] = default(
        {}, "keys of the law, where it is a class, a tiltsim.LawController", {"stiffness": 4.0}
    )
    states: StateUnits = default(
        {}, "the law's own states: their names and units", {"state_integral": "m s"}
    )
    discrete_states: StateUnits = default(
        {},
        "states that the law sets at control samples, such as flags and queues: their names and "
        "units; needs simulation.control_timestep > 0",
        {"state_flag": "1"},
    )
    push_stiffness: Positive | None = default(
        None,
        "force per mass and per error of position that the law makes at rest, for a reference "
        "that pushes; default: it does not push [1/s^2]",
        4.0,
    )

    @property
    def position_stiffness(self) -> float | None:  # type: ignore[override]
        return self.push_stiffness


_MODULES: Final = (
    linearizing_controllers.__name__,
    baseline_controllers.__name__,
    vectoring_controller.__name__,
    __name__,
    *KINDS,
)

_BUILT_IN: Final = tables_of(ControllerTable, "law", _MODULES)

CONTROLLERS: Final = _BUILT_IN | installed_controllers(_BUILT_IN)
"""The tables of all laws by their names: built-in laws, then laws of installed packages."""

if TYPE_CHECKING:
    Controller = ControllerTable
else:
    Controller = union_of(CONTROLLERS, "law", DEFAULT_LAW)
"""The ``[controller]`` table, discriminated by its law."""


def laws_for(model: str) -> list[str]:
    """The laws that control a vehicle, given ``vehicle.model``."""
    return [law for law, table in CONTROLLERS.items() if model in table.vehicle_models]
