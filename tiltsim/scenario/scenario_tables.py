"""The tables of a scenario together, and properties that follow from several of them."""

from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Final

from pydantic import Field, PrivateAttr, model_validator

from tiltsim.errors import InputError
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario import gait
from tiltsim.scenario.controller import Controller
from tiltsim.scenario.expectation import ClaimName, ClaimTable, Expectation, Origin
from tiltsim.scenario.gait import FixedGait, GaitTable
from tiltsim.scenario.interaction import (
    CableTable,
    CompanionTable,
    DownwashTable,
    ObjectTable,
    PayloadTable,
    ToolTable,
)
from tiltsim.scenario.kinds import KINDS, tables_of
from tiltsim.scenario.linearizing_controllers import AttitudeAltitudeController
from tiltsim.scenario.reference import Reference, SetpointReference
from tiltsim.scenario.rotorcraft import RotorcraftTable, TiltServoTable
from tiltsim.scenario.simulation_table import (
    AutopilotTable,
    InitialTable,
    SimulationTable,
    with_controller,
)
from tiltsim.scenario.surroundings import (
    Acceleration,
    AirTable,
    Disturbance,
    Fault,
    Force,
    GroundTable,
    SensorTable,
    Torque,
)
from tiltsim.scenario.table import Many, Table, default
from tiltsim.scenario.time_table import TimeTable
from tiltsim.scenario.vehicle import ModelErrorTable, VehicleTable, VehicleUnion
from tiltsim_controllers.vehicle.parameters import Vehicle

GAITS: Final = tables_of(
    GaitTable,  # type: ignore[type-abstract]
    "type",
    (gait.__name__, *KINDS),
)
"""The tables of all gaits by their types."""

if TYPE_CHECKING:
    Gait = GaitTable
else:
    Gait = Annotated[reduce(or_, GAITS.values()), Field(discriminator="type")]
"""The ``[gait]`` table, discriminated by its type."""

DESCRIPTIVE: Final = ("title", "source", "without", "ours", "claim", "expect")
"""Keys that describe and judge a flight, and change nothing in it."""


class ScenarioTables(Table):
    """One flight, fully specified; `tiltsim.scenario.scenario.Scenario` adds the checks."""

    title: str = default("", "one line about the flight", "My first flight")
    source: str = default("", "where the experiment is described", "ch. 4, Sec. 7, Fig. 4")
    without: str = default(
        "",
        "address of the same flight without the feature that this one shows, #NAME in the same "
        "file: tiltsim report compares the two",
        "#plain",
    )
    vehicle: VehicleUnion = default(
        VehicleTable(), "the vehicle that the controller assumes and that flies"
    )
    model_error: ModelErrorTable = default(
        ModelErrorTable(), "what the controller has wrong about the vehicle"
    )
    simulation: SimulationTable = default(
        SimulationTable(), "duration, time steps, plant and engine"
    )
    initial: InitialTable = default(InitialTable(), "the state at time zero")
    controller: Controller = default(AttitudeAltitudeController(), "the control law and its gains")
    autopilot: AutopilotTable | None = default(
        None, "a firmware that flies in place of the controller; default: none"
    )
    gait: Gait = default(
        FixedGait(), "the plan of the tilt angles: prescribed functions of time, mostly periodic"
    )
    reference: Reference = default(SetpointReference(), "the motion to track")
    ground: GroundTable | None = default(None, "ground to take off from and land on; default: none")
    object: Many[ObjectTable] = default((), "things to touch, push, open and land on")
    tool: ToolTable | None = default(None, "a tool that the vehicle carries; default: none")
    payload: PayloadTable | None = default(None, "a load to carry; default: none")
    cable: Many[CableTable] = default(
        (), "cables between vehicles and free objects, which hold for a time"
    )
    companion: Many[CompanionTable] = default((), "further vehicles in the same world")
    downwash: DownwashTable | None = default(
        None, "the force of vehicles' wakes on vehicles below; default: none"
    )
    disturbance: Many[Disturbance] = default(
        (), "accelerations, forces and torques that the controller does not know of"
    )
    air: AirTable = default(AirTable(), "wind, gusts, drag and ground effect")
    sensors: SensorTable = default(SensorTable(), "errors of the measurements")
    fault: Many[Fault] = default((), "rotors and servos that fail during the flight")
    expect: Many[Expectation] = default((), "bounds on metrics, by which the flight is judged")
    ours: Many[Origin] = default(
        (), "what of this flight is not given in its source, for tiltsim report", ["gains"]
    )
    claim: dict[ClaimName, ClaimTable] = default({}, "statements of the source")

    _with_controller = model_validator(mode="before")(with_controller)
    _address: str = PrivateAttr("")
    _own: dict[str, Any] = PrivateAttr({})  # parts given in Python, by name
    _trusted: bool = PrivateAttr(False)  # see `tiltsim.scenario.own_parts`

    @property
    def address(self) -> str:
        """The scenario's address on the command line; empty if it was built in Python."""
        return self._address

    @property
    def own_controller(self) -> Any:
        """The controller given in Python; None for a built-in one and for one in a file."""
        return self._own.get("controller")

    def __getstate__(self) -> dict[Any, Any]:
        """Without functions: other processes need not be able to import a notebook's."""
        state = super().__getstate__()
        private = {**(state["__pydantic_private__"] or {}), "_own": {}}
        return {**state, "__pydantic_private__": private}

    @property
    def has_contacts(self) -> bool:
        """Whether the vehicle can touch anything."""
        return self.ground is not None or self.has_objects or bool(self.companion)

    @property
    def has_objects(self) -> bool:
        """Whether the model has more in it than the vehicle and the ground."""
        return bool(self.object) or self.tool is not None or self.payload is not None

    def require_alone(self, analysis: str) -> None:
        """Refuse all others for an analysis. Raises `InputError` with its name."""
        tables = ("object", "companion", "tool", "payload")
        brackets = {"object": "[[object]]", "companion": "[[companion]]"}
        found = ", ".join(brackets.get(key, f"[{key}]") for key in tables if getattr(self, key))
        if found:
            where = self.address or "scenario"
            raise InputError(f"{where}: {analysis} takes a vehicle alone; remove {found}")

    def require_rotorcraft(self, analysis: str) -> None:
        """Refuse a vehicle in a plane for an analysis. Raises `InputError` with its name."""
        if self.vehicle.is_planar:
            given = f'{self.address or "scenario"}: vehicle.model = "{self.vehicle.model}"'
            raise InputError(f"{given}: {analysis} takes rotorcraft only")

    @property
    def time_tables(self) -> dict[str, TimeTable]:
        """Reference and gait by name, if they are tables over time."""
        named = {"reference": self.reference, "gait": self.gait}
        return {name: table for name, table in named.items() if isinstance(table, TimeTable)}

    @property
    def actuator_options(self) -> list[tuple[str, Any, Any]]:
        """Settings of the actuation layer: key, value and the value of ideal actuators."""
        controller, vehicle = self.controller, self.vehicle
        options: list[tuple[str, Any, Any]] = [
            ("simulation.control_latency", self.simulation.control_latency, 0.0),
            ("sensors", self.sensors.have_errors, False),
            ("fault", [fault.type for fault in self.fault], []),
            ("controller.allocation", controller.prioritizes_attitude, False),
        ]
        if isinstance(vehicle, RotorcraftTable):
            options = [
                ("vehicle.rotor_time_constant", vehicle.rotor_time_constant, None),
                ("vehicle.tilt_servo.max_rate", vehicle.tilt_servo.max_rate, None),
                *options,
            ]
        return options

    @property
    def needs_actuation_layer(self) -> bool:
        """Whether anything between control law and vehicle is not ideal."""
        return any(value != ideal for _, value, ideal in self.actuator_options)

    @property
    def has_air(self) -> bool:
        """Whether the air acts on the vehicle."""
        return self.air != AirTable()

    @property
    def disturbance_acceleration(self) -> tuple[float, float, float]:
        """The sum of the accelerations among the disturbances, m/s^2, world."""
        values = [each.value for each in self.disturbance if isinstance(each, Acceleration)]
        x, y, z = (sum((value[axis] for value in values), 0.0) for axis in range(3))
        return x, y, z

    @property
    def loads(self) -> tuple[Force | Torque, ...]:
        """Forces and torques among the disturbances."""
        return tuple(each for each in self.disturbance if not isinstance(each, Acceleration))

    @property
    def has_rotor_inertia(self) -> bool:
        """Whether the rotors have spin inertia."""
        return isinstance(self.vehicle, RotorcraftTable) and self.vehicle.rotor_inertia > 0.0

    @property
    def gyroscopic(self) -> float:
        """Factor of the gyroscopic torque, which the thesis's equations of ch. 3 omit."""
        return float(self.simulation.plant != "thesis" or not self.vehicle.has_actuators)

    @property
    def has_ideal_actuators_in_still_air(self) -> bool:
        """Whether pods and rotors follow their commands, and nothing else acts, as in the thesis.

        Otherwise `tiltsim.laws.layers.layer` wraps the controller for the thesis plant.
        """
        vehicle = self.vehicle
        if not isinstance(vehicle, RotorcraftTable):
            return True
        return not (
            vehicle.has_rotor_limits
            or vehicle.tilt_servo != TiltServoTable()
            or self.model_error != ModelErrorTable()
            or self.controller.supervision is not None
            or self.needs_actuation_layer
            or self.has_air
            or self.loads
            or self.sensors.instruments
        )

    @property
    def rotorcraft(self) -> VehicleTable:
        """The vehicle of a tiltrotor or quadrotor. Raises TypeError for other vehicles."""
        if not isinstance(self.vehicle, VehicleTable):
            raise TypeError(f"the {self.vehicle.model} has no four rotors on a cross")
        return self.vehicle

    @property
    def any_rotorcraft(self) -> RotorcraftTable:
        """The vehicle of any rotorcraft. Raises TypeError for other vehicles."""
        if not isinstance(self.vehicle, RotorcraftTable):
            raise TypeError(f"the {self.vehicle.model} is not a rotorcraft")
        return self.vehicle

    @property
    def true_vehicle(self) -> Vehicle | Multirotor:
        """The parameters of any simulated rotorcraft; the controller assumes its table's."""
        return self.model_error.apply(self.any_rotorcraft.resolve())
