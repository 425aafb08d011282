"""The tables of a vehicle's surroundings, disturbances, sensors and faults."""

from typing import Annotated, Literal

from pydantic import Field

from tiltsim.models.parts import Ground
from tiltsim.models.vehicle_parts import MAX_ROTORS
from tiltsim.scenario.instruments import InstrumentTables
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import (
    ZEROS,
    Angle,
    Coordinate,
    NonNegative,
    Positive,
    Table,
    Vector3,
    default,
    example,
    required,
)


class GroundTable(Ground, Table):
    """Ground to take off from and land on; without this table there are no contacts."""

    model_config = example(height=0.0)


class Acceleration(Table):
    """A constant acceleration that the controller does not know of."""

    type: Literal["acceleration"] = required("acts on every mass, as gravity does")
    value: Vector3 = required("in the world [m/s^2]", [1.0, 0.0, 0.0])


class Load(Table):
    """A force or torque on the vehicle that the controller does not know of."""

    table_name = "disturbance"

    frame: Literal["world", "body"] = default("world", "axes of value")
    start: NonNegative = default(0.0, "when it begins [s]", 5.0)
    end: Positive | None = default(None, "when it ends; default: it lasts [s]", 5.2)

    def _check_values(self) -> None:
        if self.end is not None and self.end <= self.start:
            raise self.mistake("end", f"must be after start = {self.start}")


class Force(Load):
    """A force at a point of the vehicle: a push, a pull on a cable, a load hung on an arm."""

    type: Literal["force"] = required("acts at a point of the body")
    value: Vector3 = required("the force [N]", [2.0, 0.0, 0.0])
    point: Vector3 = default(ZEROS, "from the center of mass, body axes [m]", [0.0, 0.1, 0.05])


class Torque(Load):
    """A torque on the vehicle."""

    type: Literal["torque"] = required("acts on the body")
    value: Vector3 = required("the torque [N m]", [0.0, 0.02, 0.0])


Disturbance = Annotated[Acceleration | Force | Torque, Field(discriminator="type")]
"""A ``[[disturbance]]`` table, discriminated by its type."""


class SensorTable(InstrumentTables):
    """Measurements of the vehicle's motion that the controller receives; exact by default.

    Each measurement has its own zero-mean normal error of the given standard deviation on each
    axis, drawn from ``simulation.seed``, and is held until the next. Tilts and rotor speeds are
    exact.
    """

    model_config = example(position_noise=0.01, attitude_noise=0.01)

    position_noise: NonNegative = default(0.0, "standard deviation along each axis [m]", 0.01)
    position_bias: Vector3 = default(ZEROS, "constant error, world axes [m]", [0.1, 0.0, 0.0])
    velocity_noise: NonNegative = default(0.0, "standard deviation along each axis [m/s]", 0.02)
    velocity_bias: Vector3 = default(ZEROS, "constant error, world axes [m/s]", [0.05, 0, 0])
    attitude_noise: NonNegative = default(
        0.0, "standard deviation about each body axis [rad]", 0.01
    )
    attitude_bias: Vector3 = default(ZEROS, "constant turn about the body axes [rad]", [0.02, 0, 0])
    body_rates_noise: NonNegative = default(
        0.0, "standard deviation about each body axis [rad/s]", 0.05
    )
    body_rates_bias: Vector3 = default(ZEROS, "constant error, body axes [rad/s]", [0.01, 0, 0])
    sample_time: Positive | None = default(
        None, "time between measurements; default: control_timestep, 0.01 if continuous [s]", 0.02
    )

    @property
    def have_errors(self) -> bool:
        """Whether any measurement has an error."""
        ideal = dict.fromkeys(("sample_time", *InstrumentTables.model_fields))
        return self.model_copy(update=ideal) != SensorTable()


Rotor = Annotated[
    int,
    Field(
        ge=1,
        le=MAX_ROTORS,
        description="1 on +x of the body, 2 on +y, 3 on -x, 4 on -y; of a multirotor rotor_i",
        examples=[2],
    ),
]
FaultTime = Annotated[NonNegative, Field(description="when it fails [s]", examples=[10.0])]


class RotorLoss(Table):
    """A rotor that stops producing thrust and torque while its motor keeps turning."""

    type: Literal["rotor_loss"] = required("a rotor stops")
    rotor: Rotor
    time: FaultTime


class PartialThrust(Table):
    """A rotor that produces only a fraction of its thrust and drag torque."""

    type: Literal["partial_thrust"] = required("a rotor produces a fraction of its thrust")
    rotor: Rotor
    time: FaultTime
    factor: Annotated[float, Field(ge=0.0, le=2.0)] = required(
        "remaining fraction, 1 for all [-]", 0.7
    )


class StuckServo(Table):
    """A tilt servo that holds one angle regardless of its command."""

    type: Literal["stuck_servo"] = required("a servo holds one angle")
    rotor: Rotor
    time: FaultTime
    angle: Angle | None = default(
        None, "tilt angle that it holds; default: the gait's at that time [rad]", 0.3
    )


Fault = Annotated[RotorLoss | PartialThrust | StuckServo, Field(discriminator="type")]
"""A ``[[fault]]`` table, discriminated by its type."""

NonNegative3 = Annotated[tuple[NonNegative, NonNegative, NonNegative], Field(strict=False)]


class DragTable(Table):
    """Drag against the motion through the air, along each body axis."""

    model_config = example(linear=[0.1, 0.1, 0.2])

    linear: NonNegative3 = default(ZEROS, "force per airspeed [N s/m]", [0.1, 0.1, 0.2])
    area: NonNegative3 = default(
        ZEROS,
        "drag coefficient times the area projected along the axis; the force grows with the "
        "square of the airspeed [m^2]",
        [0.01, 0.01, 0.02],
    )


class GustTable(Table):
    """A discrete gust of the shape 1 - cos (MIL-F-8785C)."""

    table_name = "air.gust"

    velocity: Vector3 = required("of the air at the peak, world axes [m/s]", [4.0, 0.0, 0.0])
    start: NonNegative = default(0.0, "when it begins [s]", 10.0)
    rise: Positive = required("time to reach the peak, and to decay from it [s]", 2.0)
    duration: NonNegative = default(0.0, "from start to end; 0 for a gust that lasts [s]", 8.0)

    def _check_values(self) -> None:
        if 0.0 < self.duration < 2.0 * self.rise:
            raise self.mistake("duration", f"must be 0 or at least twice rise = {self.rise}")


class TurbulenceTable(Table):
    """Dryden turbulence, low-altitude model (MIL-F-8785C), drawn from ``simulation.seed``."""

    wind_at_6m: Positive = required(
        "mean wind 20 ft above the ground, which sets the intensity [m/s]", 5.0
    )
    height: Annotated[float, Field(ge=3.048, le=304.8)] = default(
        10.0, "above the ground, for intensity and scale [m]"
    )
    sample_time: Positive = default(0.01, "time for which a noise sample is held [s]")


class GroundEffectTable(Table):
    """Ground effect on each rotor (Cheeseman and Bennett)."""

    rotor_radius: Positive = default(0.1, "radius of each rotor [m]")
    height: Coordinate = required("z of the ground in the world [m]", 0.0)


class AirTable(Table):
    """The air around the vehicle; none by default."""

    model_config = example(wind=[5.0, 0.0, 0.0], drag={"linear": [0.1, 0.1, 0.2]})

    density: Positive = default(1.225, "of the air [kg/m^3]")
    wind: Vector3 = default(
        ZEROS, "velocity of the air in the world; acts through drag [m/s]", [5.0, 0.0, 0.0]
    )
    drag: DragTable = default(DragTable(), "through which wind and gusts act")
    gust: GustTable | None = default(None, "one gust on top of the wind; default: none")
    turbulence: TurbulenceTable | None = default(None, "random gusts; default: none")
    ground_effect: GroundEffectTable | None = default(
        None, "more thrust near the ground; default: none"
    )

    def _check_values(self) -> None:
        if any(self.drag.linear) or any(self.drag.area):
            return
        for key, moves in (
            ("wind", any(self.wind)),
            ("gust", self.gust),
            ("turbulence", self.turbulence),
        ):
            if moves:
                raise InvalidValueError(
                    f"air.{key}", getattr(self, key), "acts through drag only; set air.drag"
                )
