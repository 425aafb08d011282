"""What all ``[gait]`` tables have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Annotated, ClassVar

from pydantic import Field

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.table import Factor, Table
from tiltsim_controllers.gaits.plans import Gait as PlannedGait
from tiltsim_controllers.tilt_car.vehicle import TiltCar
from tiltsim_controllers.vehicle.parameters import Vehicle

AnyVehicle = Vehicle | Multirotor | TiltCar


def tilts_of(vehicle: AnyVehicle) -> int:
    """How many tilt angles a gait of a vehicle plans; the quadrotor's are idle."""
    if isinstance(vehicle, Multirotor):
        return vehicle.tilts
    return 4 if isinstance(vehicle, Vehicle) else 1


class GaitTable(Table, ABC):
    """The keys of every gait: a common scale, and a bias on the two rear angles."""

    table_name = "gait"
    size_key: ClassVar[str]

    scale: Annotated[float, Field(ge=1e-3, le=1e3)] = Field(
        1.0, description="multiplies all tilt angles (ch. 5: 1/n) [-]", examples=[0.5]
    )
    bias: Factor = Field(
        1.0, description="eta, multiplies alpha_3 and alpha_4 (ch. 6) [-]", examples=[0.8]
    )

    def plan(self, vehicle: AnyVehicle) -> PlannedGait:
        """The gait for a vehicle. Raises ValueError if the numbers do not define one."""
        needed = tilts_of(vehicle)
        if self.tilts not in {None, needed} and not isinstance(vehicle, TiltCar):
            raise ValueError(f"has {self.tilts} tilt angles; the vehicle has {needed}")
        if self.bias != 1.0 and needed not in {1, 4}:
            raise ValueError(f"gait.bias needs four tilt angles; the vehicle has {needed}")
        return self._unscaled(vehicle).scaled(1.0 / self.scale).biased(self.bias)

    @property
    def tilts(self) -> int | None:
        """Number of tilt angles; None for a gait of any number."""
        return 4

    @abstractmethod
    def _unscaled(self, vehicle: AnyVehicle) -> PlannedGait:
        """The gait before scale and bias."""

    @property
    def size(self) -> tuple[str, object]:
        """The key that sets how far the gait tilts, and its value."""
        return self.size_key, dict(self)[self.size_key]
