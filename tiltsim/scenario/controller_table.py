"""The common part of the tables of all controllers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Literal

from pydantic import Field

from tiltsim.scenario.supervisor_table import SupervisorTable
from tiltsim.scenario.table import Table
from tiltsim_controllers.analysis.stability import ErrorLoop

ReferenceKind = Literal["position", "attitude_altitude", "pose"]
"""What a controller tracks: position and yaw, attitude and altitude, or position and attitude."""


class ControllerTable(Table, ABC):
    """What every controller has; properties are neutral where a controller lacks the feature."""

    table_name = "controller"
    vehicle_models: ClassVar[tuple[str, ...]]
    reference_kinds: ClassVar[tuple[ReferenceKind, ...]]
    gait_types: ClassVar[tuple[str, ...]] = ("fixed",)  # of the tilt-car's controllers
    is_external: ClassVar[bool] = False  # commands come from Python code, not from a built-in law
    commands_tilts: ClassVar[bool] = False  # the tilt angles are inputs, not planned by a gait

    allow_unstable: bool = Field(False, description="accept gains that fail the Routh condition")
    law: str

    @abstractmethod
    def error_loops(self, vehicle: Any) -> list[ErrorLoop]:
        """The linear closed loops that the gains make around a vehicle's parameters."""

    @property
    def linearization(self) -> str:
        """The condition under which the closed loops are linear, for messages."""
        return "the exact decoupling matrix"

    @property
    def loop_name(self) -> str:
        """The name of the controller's closed loop in `tiltsim.laws.assembling.LOOPS`."""
        return self.law

    @property
    def supervision(self) -> SupervisorTable | None:
        """The supervisor of the gait, if there is one."""
        return None

    @property
    def omits_reference_acceleration(self) -> bool:
        """Whether the law leaves the reference's acceleration out unless the reference says so."""
        return False

    @property
    def prioritizes_attitude(self) -> bool:
        """Whether rotor limits are shared out with attitude first."""
        return False

    @property
    def allocation_window(self) -> float:
        """Time (s) for which prioritized allocation keeps within the rotor limits."""
        return 1.0

    @property
    def rotors_stop_at_zero(self) -> bool:
        """Whether rotor speeds that the law integrates stop at zero."""
        return True


def gain_kind(value: object) -> str:
    """The tag of a controller's gains: ``named`` for a set, ``table`` for numbers."""
    return "named" if isinstance(value, str) else "table"
