"""The ``[controller]`` table of a scenario: one model a law, with the keys that the law knows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Discriminator, Field, Tag

from tiltsim.scenario.controller_table import ANY_ROTORCRAFT, ControllerTable
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
from tiltsim_controllers.analysis.stability import (
    ErrorLoop,
)
from tiltsim_controllers.vehicle.parameters import Vehicle

DEFAULT_LAW: Final = "attitude_altitude"


# --- tiltrotor ---------------------------------------------------------------------------------


# --- quadrotor ---------------------------------------------------------------------------------


# --- a user's own ------------------------------------------------------------------------------


class PythonController(ControllerTable):
    """A user's own controller in Python; see `tiltsim.plants.user_controller`."""

    vehicle_model = ANY_ROTORCRAFT
    reference_kinds = ("position", "pose", "attitude_altitude")

    law: Literal["python"]
    function: str = Field(
        description="FILE.py:NAME of a function or class; the file is looked for beside the "
        "scenario's"
    )

    @property
    def file(self) -> Path | None:
        """The file; None for a controller that was given in Python."""
        path, _, _ = self.function.rpartition(":")
        return Path(path) if path.endswith(".py") else None

    @property
    def attribute(self) -> str:
        """The name within the file."""
        return self.function.rpartition(":")[2]

    def error_loops(self, vehicle: Vehicle) -> list[ErrorLoop]:
        """See `ControllerTable.error_loops`: none is known."""
        return []


# --- tilt-car ----------------------------------------------------------------------------------


# --- the table, told apart by its law ----------------------------------------------------------


def _law(value: Any) -> str:
    if isinstance(value, ControllerTable):
        return str(getattr(value, "law"))  # noqa: B009
    law = value.get("law", DEFAULT_LAW) if isinstance(value, dict) else DEFAULT_LAW
    return law if isinstance(law, str) else ""


Controller = Annotated[
    Annotated[AttitudeAltitudeController, Tag("attitude_altitude")]
    | Annotated[FullPoseController, Tag("full_pose")]
    | Annotated[YawPositionController, Tag("yaw_position")]
    | Annotated[SwitchingController, Tag("switching")]
    | Annotated[QuadrotorAttitudeAltitudeController, Tag("quadrotor_attitude_altitude")]
    | Annotated[PythonController, Tag("python")]
    | Annotated[ThirdDerivativeController, Tag("tilt_car_third_derivative")]
    | Annotated[FourthDerivativeController, Tag("tilt_car_fourth_derivative")]
    | Annotated[PlannedDirectionController, Tag("tilt_car_planned_direction")],
    Discriminator(_law),
]
"""The ``[controller]`` table, told apart by its law."""
