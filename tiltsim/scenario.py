"""Scenarios: what to fly, table by table, checked before anything moves.

`Scenario` mirrors the file; every key has its unit, bounds and default here or in the modules of
tables, and nowhere else.
`tiltsim.loading` reads the files, `tiltsim.messages` words the mistakes.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from controllers.references import ReferenceParameters
from controllers.vehicle import Vehicle
from tiltsim.controller_tables import (
    AttitudeAltitudeController,
    Controller,
)
from tiltsim.expectation_table import Expectation
from tiltsim.gait_tables import FixedGait, Gait
from tiltsim.messages import InvalidValueError
from tiltsim.reference_tables import Reference, SetpointReference
from tiltsim.scenario_checks import check_scenario
from tiltsim.surroundings_tables import AirTable, Disturbance, Fault, GroundTable, SensorTable
from tiltsim.tables import (
    Angles3,
    NonNegative,
    Positive,
    Positive2,
    Positive4,
    Table,
    Vector3,
)
from tiltsim.vehicle_tables import (
    ModelErrorTable,
    TiltCarTable,
    TiltServoTable,
    VehicleTable,
    VehicleUnion,
)

MAX_STEPS: Final = 100_000_000
"""Physics steps of a flight, more than a day at one millisecond."""

MAX_LATENCY_STEPS: Final = 20
"""Control samples on their way at once; each is eight states of the simulation."""

# --- [simulation] and [initial] ----------------------------------------------------------------


class SimulationTable(Table):
    """How the flight is computed."""

    duration: Positive = Field(40.0, description="s")
    timestep: Annotated[float, Field(ge=1e-6, le=0.1)] = Field(0.001, description="s, physics")
    control_timestep: NonNegative = Field(
        0.0, description="s; 0 evaluates the law at every integrator stage, else sample and hold"
    )
    control_latency: NonNegative = Field(
        0.0, description="s from a reading to its command; a multiple of control_timestep"
    )
    record_timestep: Positive | None = Field(
        None, description="s between recorded samples; default: the multiple of timestep near 0.01"
    )
    engine: Literal["auto", "python", "native"] = "auto"
    plant: Literal["mujoco", "thesis"] = "mujoco"
    integrator: Literal["RK4", "implicitfast", "implicit", "Euler"] = "RK4"
    seed: Annotated[int, Field(ge=0)] = 0

    @property
    def steps(self) -> int:
        """Number of physics steps of the flight."""
        return round(self.duration / self.timestep)

    @property
    def control_steps(self) -> int:
        """Physics steps between control samples; 0 where control is continuous."""
        return round(self.control_timestep / self.timestep)

    @property
    def latency_steps(self) -> int:
        """Control samples between a reading and its command; 0 where there is no latency."""
        return round(self.control_latency / self.control_timestep) if self.control_latency else 0

    @property
    def record_steps(self) -> int:
        """Physics steps between recorded samples."""
        wanted = 0.01 if self.record_timestep is None else self.record_timestep
        return max(1, round(wanted / self.timestep))

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key in ("duration", "control_timestep", "record_timestep"):
            value = getattr(self, key)
            if value is None or value == 0.0:
                continue
            steps = value / self.timestep
            if steps > MAX_STEPS:
                raise InvalidValueError(
                    f"simulation.{key}", value, f"more than {MAX_STEPS:.0e} steps of timestep"
                )
            if value > self.duration:
                raise InvalidValueError(
                    f"simulation.{key}", value, f"longer than the flight, {self.duration} s"
                )
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-6 * steps:
                raise InvalidValueError(
                    f"simulation.{key}", value, f"must be a multiple of timestep = {self.timestep}"
                )
        self._check_latency()
        return self

    def _check_latency(self) -> None:
        latency, period = self.control_latency, self.control_timestep
        if latency == 0.0:
            return
        if period == 0.0:
            raise InvalidValueError(
                "simulation.control_latency",
                latency,
                "needs a control_timestep, of which it is a multiple",
            )
        steps = latency / period
        if abs(steps - round(steps)) > 1e-6 * steps or not 1 <= round(steps) <= MAX_LATENCY_STEPS:
            raise InvalidValueError(
                "simulation.control_latency",
                latency,
                f"must be 1 to {MAX_LATENCY_STEPS} times control_timestep = {period}",
            )


class InitialTable(Table):
    """The state at time zero; the tilt angles and their rates are the gait's."""

    position: Vector3 = Field((0.0, 0.0, 0.0), description="m, world")
    velocity: Vector3 = Field((0.0, 0.0, 0.0), description="m/s, world")
    attitude: Angles3 = Field((0.0, 0.0, 0.0), description="roll, pitch, yaw, rad")
    angular_velocity: Vector3 = Field((0.0, 0.0, 0.0), description="p, q, r, rad/s, body")
    rotor_speed: Positive | Positive4 | Positive2 = Field(
        300.0, description="absolute value, rad/s; one for all rotors, or one each"
    )

    def rotor_speeds(self, rotors: int) -> tuple[float, ...]:
        """Absolute rotor speeds of so many rotors, one each."""
        speed = self.rotor_speed
        return speed if isinstance(speed, tuple) else (speed,) * rotors


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
    def does_as_told(self) -> bool:
        """Whether pods and rotors do what they are told and no air acts, as in the thesis.

        Else `tiltsim.loops.on_equations` flies the scenario on the thesis plant.
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
        """What `tiltsim.loops.actuation` is for: key, value and what the ideal would be."""
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
            ("sensors", self.sensors.are_imperfect, False),
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

    def reference_and_table(self) -> tuple[ReferenceParameters, tuple[float, ...]]:
        """The reference's record, and the table of the flight: the gait's and the reference's."""
        gait = self.gait.plan(self.vehicle.resolve())
        return self.reference.placed(gait.table)


class Variant(Table):
    """One member of a family: a name, what differs from the base, and its own expectations."""

    model_config = ConfigDict(extra="allow")

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+$")]
