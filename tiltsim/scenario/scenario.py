"""Scenarios: what to fly, table by table, checked before anything moves.

`Scenario` mirrors the file; every key has its unit, bounds and default here or in the modules of
tables, and nowhere else.
`tiltsim.scenario.loading` reads the files, `tiltsim.scenario.messages` words the mistakes.
"""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from tiltsim.scenario.consistency import check_scenario
from tiltsim.scenario.controller import Controller
from tiltsim.scenario.expectation import Expectation
from tiltsim.scenario.gait import FixedGait, Gait
from tiltsim.scenario.reference import Reference, SetpointReference
from tiltsim.scenario.simulation_table import InitialTable, SimulationTable
from tiltsim.scenario.surroundings import AirTable, Disturbance, Fault, GroundTable, SensorTable
from tiltsim.scenario.table import (
    Table,
)
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.scenario.vehicle import (
    ModelErrorTable,
    TiltCarTable,
    TiltServoTable,
    VehicleTable,
    VehicleUnion,
)
from tiltsim_controllers.vehicle.parameters import Vehicle

# --- [simulation] and [initial] ----------------------------------------------------------------


# --- the whole ---------------------------------------------------------------------------------


class Scenario(Table):
    """One flight, fully specified."""

    title: str = ""
    source: str = ""
    without: str = Field(
        "",
        description="address of the same flight without what this one shows, #NAME in the same "
        "file: tiltsim report sets them side by side",
    )
    vehicle: VehicleUnion = VehicleTable()
    model_error: ModelErrorTable = ModelErrorTable()
    simulation: SimulationTable = SimulationTable()
    initial: InitialTable = InitialTable()
    controller: Controller = AttitudeAltitudeController()
    gait: Gait = FixedGait()
    reference: Reference = SetpointReference()
    ground: GroundTable | None = None
    disturbance: Annotated[tuple[Disturbance, ...], Field(strict=False)] = ()
    air: AirTable = AirTable()
    sensors: SensorTable = SensorTable()
    fault: Annotated[tuple[Fault, ...], Field(strict=False)] = ()
    expect: Annotated[tuple[Expectation, ...], Field(strict=False)] = ()

    _address: str = PrivateAttr("")

    @property
    def address(self) -> str:
        """How the scenario is called on the command line; empty when it was built in Python."""
        return self._address

    @property
    def has_real_actuators(self) -> bool:
        """Whether anything between law and vehicle is less than ideal; see `real_actuators`."""
        return any(value != ideal for _, value, ideal in self.real_actuators())

    @property
    def has_air(self) -> bool:
        """Whether the air does anything to the vehicle."""
        return self.air != AirTable()

    @property
    def has_ideal_actuators_in_still_air(self) -> bool:
        """Whether pods and rotors do what they are told and no air acts, as in the thesis.

        Else `tiltsim.laws.layers.on_equations` flies the scenario on the thesis plant.
        """
        vehicle = self.vehicle
        if not isinstance(vehicle, VehicleTable):
            return True
        return (
            vehicle.min_rotor_speed is None
            and vehicle.max_rotor_speed is None
            and vehicle.tilt_servo == TiltServoTable()
            and self.model_error == ModelErrorTable()
            and getattr(self.controller, "supervisor", None) is None
            and not self.has_real_actuators
            and not self.has_air
        )

    def real_actuators(self) -> list[tuple[str, object, object]]:
        """What `tiltsim.laws.layers.actuation` is for: key, value and what the ideal would be."""
        controller = self.controller
        servo = getattr(self.vehicle, "tilt_servo", None)
        return [
            (
                "vehicle.rotor_time_constant",
                getattr(self.vehicle, "rotor_time_constant", None),
                None,
            ),
            ("vehicle.tilt_servo.max_rate", getattr(servo, "max_rate", None), None),
            ("simulation.control_latency", self.simulation.control_latency, 0.0),
            ("sensors", self.sensors.have_errors, False),
            ("fault", [fault.type for fault in self.fault], []),
            ("controller.allocation", getattr(controller, "allocation", "inversion"), "inversion"),
        ]

    @property
    def rotorcraft(self) -> VehicleTable:
        """The vehicle of a tiltrotor or quadrotor. Raises TypeError for other vehicles."""
        if not isinstance(self.vehicle, VehicleTable):
            raise TypeError(f"the {self.vehicle.model} is no rotorcraft")
        return self.vehicle

    @property
    def true_rotorcraft(self) -> Vehicle:
        """The vehicle that flies; the law knows ``rotorcraft.resolve()``."""
        return self.model_error.apply(self.rotorcraft.resolve())

    @property
    def tilt_car(self) -> TiltCarTable:
        """The vehicle of a tilt-car. Raises TypeError for other vehicles."""
        if not isinstance(self.vehicle, TiltCarTable):
            raise TypeError(f"the {self.vehicle.model} is no tilt-car")
        return self.vehicle

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_scenario(self)
        return self


class Variant(Table):
    """One member of a family: a name, what differs from the base, and its own expectations."""

    model_config = ConfigDict(extra="allow")

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+$")]
