"""The tables of a vehicle's surroundings, disturbances, sensors and faults."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from tiltsim.models.parts import Ground
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import Angle, Coordinate, NonNegative, Positive, Table, Vector3


class GroundTable(Table):
    """Ground to take off from and land on; without this table there are no contacts."""

    height: float = Field(Ground.height, description="m, world")
    friction: Positive = Field(Ground.friction, description="coefficient of sliding friction")


class Disturbance(Table):
    """A constant acceleration that the controller does not know of."""

    type: Literal["acceleration"]
    value: Vector3 = Field(description="m/s^2, world; acts on every mass, as gravity does")


class SensorTable(Table):
    """Measurements of the vehicle's motion that the controller receives; exact by default.

    Each measurement has its own zero-mean normal error of the given standard deviation on each
    axis, drawn from ``simulation.seed``, and is held until the next. Tilts and rotor speeds are
    exact.
    """

    position_noise: NonNegative = Field(0.0, description="m")
    position_bias: Vector3 = Field((0.0, 0.0, 0.0), description="m, world")
    velocity_noise: NonNegative = Field(0.0, description="m/s")
    velocity_bias: Vector3 = Field((0.0, 0.0, 0.0), description="m/s, world")
    attitude_noise: NonNegative = Field(0.0, description="rad, about each body axis")
    attitude_bias: Vector3 = Field((0.0, 0.0, 0.0), description="rad, about the body axes")
    body_rates_noise: NonNegative = Field(0.0, description="rad/s")
    body_rates_bias: Vector3 = Field((0.0, 0.0, 0.0), description="rad/s, body")
    sample_time: Positive | None = Field(
        None, description="s between measurements; default: control_timestep, 0.01 if continuous"
    )

    @property
    def have_errors(self) -> bool:
        """Whether any measurement has an error."""
        return self.model_copy(update={"sample_time": None}) != SensorTable()


Rotor = Annotated[int, Field(ge=1, le=4)]


class RotorLoss(Table):
    """A rotor that stops producing thrust and torque while its motor keeps turning."""

    type: Literal["rotor_loss"]
    rotor: Rotor
    time: NonNegative = Field(description="s")


class PartialThrust(Table):
    """A rotor that produces only a fraction of its thrust and drag torque."""

    type: Literal["partial_thrust"]
    rotor: Rotor
    time: NonNegative = Field(description="s")
    factor: Annotated[float, Field(ge=0.0, le=2.0)] = Field(
        description="remaining fraction, 1 for all"
    )


class StuckServo(Table):
    """A tilt servo that holds one angle regardless of its command."""

    type: Literal["stuck_servo"]
    rotor: Rotor
    time: NonNegative = Field(description="s")
    angle: Angle | None = Field(None, description="rad; default: the gait's angle at that time")


Fault = Annotated[RotorLoss | PartialThrust | StuckServo, Field(discriminator="type")]
"""A ``[[fault]]`` table, discriminated by its type."""

NonNegative3 = Annotated[tuple[NonNegative, NonNegative, NonNegative], Field(strict=False)]


class DragTable(Table):
    """Drag against the motion through the air, along each body axis."""

    linear: NonNegative3 = Field((0.0, 0.0, 0.0), description="N s/m")
    area: NonNegative3 = Field(
        (0.0, 0.0, 0.0), description="m^2, drag coefficient times the area projected along the axis"
    )


class GustTable(Table):
    """A discrete gust of the shape 1 - cos (MIL-F-8785C)."""

    table_name = "air.gust"

    velocity: Vector3 = Field(description="m/s, world, at its peak")
    start: NonNegative = Field(0.0, description="s")
    rise: Positive = Field(description="time to reach the peak, and to decay from it, s")
    duration: NonNegative = Field(0.0, description="s, from start to end; 0 for a gust that lasts")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if 0.0 < self.duration < 2.0 * self.rise:
            raise self.mistake("duration", f"must be 0 or at least twice rise = {self.rise}")
        return self


class TurbulenceTable(Table):
    """Dryden turbulence, low-altitude model (MIL-F-8785C), drawn from ``simulation.seed``."""

    wind_at_6m: Positive = Field(description="m/s, mean wind 20 ft above the ground")
    height: Annotated[float, Field(ge=3.048, le=304.8)] = Field(
        10.0, description="m above the ground, for intensity and scale"
    )
    sample_time: Positive = Field(0.01, description="time for which a noise sample is held, s")


class GroundEffectTable(Table):
    """Ground effect on each rotor (Cheeseman and Bennett)."""

    rotor_radius: Positive = Field(0.1, description="m")
    height: Coordinate = Field(description="m, z of the ground in the world")


class AirTable(Table):
    """The air around the vehicle; none by default."""

    density: Positive = Field(1.225, description="kg/m^3")
    wind: Vector3 = Field((0.0, 0.0, 0.0), description="velocity of the air, m/s, world")
    drag: DragTable = DragTable()
    gust: GustTable | None = None
    turbulence: TurbulenceTable | None = None
    ground_effect: GroundEffectTable | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if any(self.drag.linear) or any(self.drag.area):
            return self
        for key, moves in (
            ("wind", any(self.wind)),
            ("gust", self.gust),
            ("turbulence", self.turbulence),
        ):
            if moves:
                raise InvalidValueError(
                    f"air.{key}", getattr(self, key), "acts through drag only; set air.drag"
                )
        return self
