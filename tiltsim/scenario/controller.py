"""The ``[controller]`` table of a scenario: one model per law, with the keys of that law."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import reduce
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, get_args

from pydantic import Discriminator, Field, Tag, model_validator

from tiltsim.scenario import (
    baseline_controllers,
    lqr_controller,
    multirotor_controllers,
    quadrotor_controllers,
    tilt_car_controllers,
    tiltrotor_controllers,
    vectoring_controller,
)
from tiltsim.scenario.controller_packages import installed_controllers
from tiltsim.scenario.controller_table import ControllerTable
from tiltsim.scenario.law_controller import TiltingTable
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import Positive, default, example, required

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
    """A user's own controller in Python; see `tiltsim.plants.user_controller`."""

    vehicle_models = ("tiltrotor", "quadrotor", "multirotor")
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
    def position_stiffness(self) -> float | None:
        return self.push_stiffness


def _law(value: Any) -> str:
    if isinstance(value, ControllerTable):
        return value.law
    law = value.get("law", DEFAULT_LAW) if isinstance(value, dict) else DEFAULT_LAW
    return law if isinstance(law, str) else ""


def _tables(*modules: str) -> Iterator[tuple[str, type[ControllerTable]]]:
    """The tables that modules define, each with its law."""
    for module in modules:
        for table in vars(sys.modules[module]).values():
            if getattr(table, "__module__", "") == module and hasattr(table, "model_fields"):
                law = get_args(table.model_fields["law"].annotation)
                yield from ((name, table) for name in law)


_BUILT_IN: Final = dict(
    _tables(
        tiltrotor_controllers.__name__,
        quadrotor_controllers.__name__,
        multirotor_controllers.__name__,
        baseline_controllers.__name__,
        lqr_controller.__name__,
        vectoring_controller.__name__,
        __name__,
        tilt_car_controllers.__name__,
    )
)

CONTROLLERS: Final = _BUILT_IN | installed_controllers(_BUILT_IN)
"""The tables of all laws by their names: built-in laws, then laws of installed packages."""

if TYPE_CHECKING:
    Controller = ControllerTable
else:
    tagged = (Annotated[table, Tag(law)] for law, table in CONTROLLERS.items())
    Controller = Annotated[reduce(or_, tagged), Discriminator(_law)]
"""The ``[controller]`` table, discriminated by its law."""


def laws_for(model: str) -> list[str]:
    """The laws that control a vehicle, given ``vehicle.model``."""
    return [law for law, table in CONTROLLERS.items() if model in table.vehicle_models]
