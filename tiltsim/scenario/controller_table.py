"""What the tables of all control laws share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Final, Literal

from pydantic import Field

from tiltsim.scenario.table import Table
from tiltsim_controllers.analysis.stability import (
    ErrorLoop,
)

ANY_ROTORCRAFT: Final = "tiltrotor or quadrotor"
"""The vehicle of a law that flies either."""


ReferenceKind = Literal["position", "attitude_altitude", "pose"]
"""What a law can follow: position and yaw, attitude and altitude, or position and attitude."""


class ControllerTable(Table, ABC):
    """What every law can be told."""

    vehicle_model: ClassVar[str]
    reference_kinds: ClassVar[tuple[ReferenceKind, ...]]
    gait_types: ClassVar[tuple[str, ...]] = ("fixed",)  # of laws around the tilt-car

    allow_unstable: bool = Field(False, description="fly gains that fail the Routh condition")

    @abstractmethod
    def error_loops(self, vehicle: Any) -> list[ErrorLoop]:
        """The linear closed loops that the gains make."""

    @property
    def linearization(self) -> str:
        """Under what the closed loops are linear, in words."""
        return "the exact decoupling matrix"

    @property
    def loop_name(self) -> str:
        """The name of the loop that flies the law, in `tiltsim.laws.assembling.LOOPS`."""
        return str(getattr(self, "law"))  # noqa: B009


def _gain_kind(value: object) -> str:
    return "named" if isinstance(value, str) else "table"
