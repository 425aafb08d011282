"""The ``[controller]`` table of a scenario: one model per law, with the keys of that law."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final, Literal, get_args

from pydantic import Discriminator, Field, Tag, model_validator

from tiltsim.scenario.controller_table import ControllerTable
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.multirotor_controllers import AttitudeForceController
from tiltsim.scenario.quadrotor_controllers import (
    QuadrotorAttitudeAltitudeController,
    SwitchingController,
    YawPositionController,
)
from tiltsim.scenario.tilt_car_controllers import (
    FourthDerivativeController,
    PlannedDirectionController,
    ThirdDerivativeController,
)
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController, FullPoseController

DEFAULT_LAW: Final = "attitude_altitude"


class PythonController(ControllerTable):
    """A user's own controller in Python; see `tiltsim.plants.user_controller`."""

    vehicle_models = ("tiltrotor", "quadrotor", "multirotor")
    reference_kinds = ("position", "pose", "attitude_altitude")
    is_external = True

    law: Literal["python"] = Field(description="your own controller")
    function: str = Field(
        description="FILE.py:NAME of a function or class; FILE in the scenario's folder",
        examples=["my_controller.py:hover"],
    )

    @model_validator(mode="before")
    @classmethod
    def _require_function(cls, value: Any) -> Any:
        if isinstance(value, dict) and "function" not in value:
            raise InvalidValueError(
                "controller.law",
                "python",
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


def _law(value: Any) -> str:
    if isinstance(value, ControllerTable):
        return value.law
    law = value.get("law", DEFAULT_LAW) if isinstance(value, dict) else DEFAULT_LAW
    return law if isinstance(law, str) else ""


Controller = Annotated[
    Annotated[AttitudeAltitudeController, Tag("attitude_altitude")]
    | Annotated[FullPoseController, Tag("full_pose")]
    | Annotated[YawPositionController, Tag("yaw_position")]
    | Annotated[SwitchingController, Tag("switching")]
    | Annotated[QuadrotorAttitudeAltitudeController, Tag("quadrotor_attitude_altitude")]
    | Annotated[AttitudeForceController, Tag("attitude_force")]
    | Annotated[PythonController, Tag("python")]
    | Annotated[ThirdDerivativeController, Tag("tilt_car_third_derivative")]
    | Annotated[FourthDerivativeController, Tag("tilt_car_fourth_derivative")]
    | Annotated[PlannedDirectionController, Tag("tilt_car_planned_direction")],
    Discriminator(_law),
]
"""The ``[controller]`` table, discriminated by its law."""


def laws_for(model: str) -> list[str]:
    """The laws that control a vehicle, given ``vehicle.model``."""
    options = [get_args(option) for option in get_args(get_args(Controller)[0])]
    return [tag.tag for table, tag in options if model in table.vehicle_models]
