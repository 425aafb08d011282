"""Scenarios: what to fly, table by table, checked before anything moves.

`Scenario` mirrors the file; every key has its unit, bounds and default here and nowhere else.
`tiltsim.loading` reads the files, `tiltsim.messages` words the mistakes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import lru_cache
from math import pi
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self, get_args

import numpy as np
from pydantic import ConfigDict, Discriminator, Field, PrivateAttr, Tag, model_validator

from controllers.gaits.keyframes import NO_KEYFRAMES
from controllers.references import REFERENCE_TYPES, ReferenceParameters
from controllers.stability import Loop
from controllers.tilt_car.vehicle import THESIS_CAR, TiltCar
from controllers.vehicle import PRESETS, Vehicle
from controllers.waypoints import minimum_snap_table
from tiltsim.controller_tables import (
    ANY_ROTORCRAFT,
    AttitudeAltitudeController,
    Controller,
    LawTable,
    ReferenceKind,
)
from tiltsim.gait_tables import FixedGait, Gait
from tiltsim.messages import InvalidValueError
from tiltsim.metrics import BOOLEAN_METRICS, METRICS
from tiltsim.tables import (
    Angle,
    Angles3,
    Coordinate,
    NonNegative,
    Positive,
    Positive2,
    Positive4,
    Range,
    Table,
    Vector3,
)

if TYPE_CHECKING:
    from tiltsim.own_vehicle import OwnVehicle

MAX_STEPS: Final = 100_000_000
"""Physics steps of a flight, more than a day at one millisecond."""

MAX_TABLE: Final = 1500
"""Numbers in the table of a gait and a reference, which every evaluation of the law reads."""

MAX_LOOP_STEP: Final = 2.5
"""Largest product of timestep and closed-loop pole; RK4 turns unstable at 2.78, ode3 at 2.51."""

MAX_HELD_STEP: Final = 2.0
"""Largest product of control timestep and pole, where a held third derivative turns unstable."""

MAX_SERVO_STEP: Final = 2.6
"""Largest product of timestep and servo pole; RK4 turns unstable at 2.78."""

MAX_LATENCY_STEPS: Final = 20
"""Control samples on their way at once; each is eight states of the simulation."""

# --- [vehicle] ---------------------------------------------------------------------------------


class ServoTable(Table):
    """A position servo: second order, ideal but for what is given here."""

    natural_frequency: Positive = Field(300.0, description="rad/s")
    damping_ratio: Positive = 1.0

    @property
    def stops(self) -> bool:
        """Whether the servo has mechanical stops."""
        return False


class TiltServoTable(ServoTable):
    """The servos that tilt the pods."""

    max_rate: Positive | None = Field(None, description="rad/s")
    max_angle: Annotated[float, Field(gt=0.0, le=pi)] | None = Field(
        None, description="rad; the gait must stay within"
    )

    @property
    def stops(self) -> bool:
        """Whether the servo has mechanical stops."""
        return self.max_angle is not None


class PodTable(Table):
    """Mass properties of one rotor pod; nearly massless by default, as in the thesis."""

    mass: Annotated[float, Field(ge=1e-14)] = Field(1e-9, description="kg")
    inertia: Annotated[float, Field(ge=1e-14)] = Field(
        1e-13, description="kg m^2, about each axis of the pod"
    )


class VehicleTable(Table):
    """A rotorcraft: a preset and what differs from it."""

    model: Literal["tiltrotor", "quadrotor"] = "tiltrotor"
    preset: Literal["ar_drone_2", "ar_drone_2_unrounded", "luukkonen"] = "ar_drone_2"
    mjcf: str | None = Field(
        None,
        description="a file with the vehicle, beside the scenario's, in place of the shipped one; "
        "it has the parameters that are not given here, and the preset none",
    )
    mass: Positive | None = Field(None, description="kg, pods included")
    inertia: Annotated[tuple[Positive, Positive, Positive], Field(strict=False)] | None = Field(
        None, description="principal moments about the centre of mass, kg m^2, pods included"
    )
    arm_length: Positive | None = Field(None, description="m")
    thrust_coefficient: Positive | None = Field(None, description="N s^2/rad^2")
    drag_coefficient: Positive | None = Field(None, description="N m s^2/rad^2")
    gravity: Positive | None = Field(None, description="m/s^2")
    min_rotor_speed: Positive | None = Field(None, description="rad/s, absolute value")
    max_rotor_speed: Positive | None = Field(None, description="rad/s, absolute value")
    rotor_time_constant: Positive | None = Field(
        None, description="s, of the lag between the speed a rotor is told and its own"
    )
    tilt_servo: TiltServoTable = TiltServoTable()
    pod: PodTable = PodTable()

    def resolve(self) -> Vehicle:
        """The physical parameters: the preset's or the file's, but for the keys given."""
        given = {
            key: getattr(self, key)
            for key in ("mass", "arm_length", "thrust_coefficient", "drag_coefficient", "gravity")
        }
        if self.inertia is not None:
            given |= dict(
                zip(("inertia_xx", "inertia_yy", "inertia_zz"), self.inertia, strict=True)
            )
        known = {key: value for key, value in given.items() if value is not None}
        own = self.own
        base = PRESETS[self.preset] if own is None else own.vehicle
        return base._replace(**known)

    @property
    def own(self) -> OwnVehicle | None:
        """The user's own file as measured; None for the shipped vehicles."""
        if self.mjcf is None:
            return None
        from tiltsim.own_vehicle import read_own_vehicle

        try:
            return read_own_vehicle(self.mjcf, self.model)
        except ValueError as error:
            raise InvalidValueError("vehicle.mjcf", self.mjcf, str(error)) from None

    def _check_own(self) -> None:
        for key, value, default in (
            ("arm_length", self.arm_length, None),
            ("pod", self.pod.model_dump(), PodTable().model_dump()),
        ):
            if value != default:
                raise InvalidValueError(
                    f"vehicle.{key}", value, "vehicle.mjcf has its own; leave it out"
                )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.mjcf is not None:
            self._check_own()
        a, b, c = sorted(self.resolve()[1:4])
        if a + b < c:
            raise InvalidValueError(
                "vehicle.inertia", [a, b, c], "no body has it: two moments must exceed the third"
            )
        low, high = self.min_rotor_speed, self.max_rotor_speed
        if low is not None and high is not None and low >= high:
            raise InvalidValueError(
                "vehicle.min_rotor_speed", low, f"must be below max_rotor_speed = {high}"
            )
        return self


class TiltCarTable(Table):
    """The tilt-car of ch. 10; the defaults are `controllers.tilt_car.vehicle.THESIS_CAR`."""

    model: Literal["tilt_car"]
    mass: Positive = Field(THESIS_CAR.mass, description="kg; the thesis does not give it")
    top_inertia: Positive = Field(
        THESIS_CAR.top_inertia, description="I_T, of the top disc about the axis, kg m^2"
    )
    bottom_inertia: Positive = Field(
        THESIS_CAR.bottom_inertia,
        description="of the bottom disc alone about the axis, kg m^2; I_B is both discs'",
    )
    half_angle: Annotated[float, Field(gt=0.0, lt=pi / 2)] = Field(
        THESIS_CAR.half_angle, description="theta, from the middle of the thrusts to either, rad"
    )
    thrust_coefficient: Positive = Field(
        THESIS_CAR.thrust_coefficient, description="K_F, N s^2/rad^2"
    )
    tilt_servo: ServoTable = ServoTable()

    def resolve(self) -> TiltCar:
        """The physical parameters."""
        return TiltCar(
            self.mass,
            self.top_inertia,
            self.bottom_inertia,
            self.half_angle,
            self.thrust_coefficient,
        )


def _model(value: Any) -> str:
    if isinstance(value, VehicleTable | TiltCarTable):
        return "tilt_car" if isinstance(value, TiltCarTable) else "tiltrotor"
    model = value.get("model", "tiltrotor") if isinstance(value, dict) else "tiltrotor"
    if not isinstance(model, str):
        return ""
    return "tiltrotor" if model == "quadrotor" else model


VehicleUnion = Annotated[
    Annotated[VehicleTable, Tag("tiltrotor")] | Annotated[TiltCarTable, Tag("tilt_car")],
    Discriminator(_model),
]
"""The ``[vehicle]`` table, told apart by its model."""

# --- [model_error] -----------------------------------------------------------------------------

Share = Annotated[float, Field(ge=0.01, le=100.0)]


class ModelErrorTable(Table):
    """By what factors the vehicle that flies differs from the ``[vehicle]`` that the law knows."""

    mass: Share = 1.0
    inertia: Annotated[tuple[Share, Share, Share], Field(strict=False)] = Field(
        (1.0, 1.0, 1.0), description="one factor a principal moment"
    )
    arm_length: Share = 1.0
    thrust_coefficient: Share = 1.0
    drag_coefficient: Share = 1.0

    def apply(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle that flies, where the law knows ``vehicle``."""
        xx, yy, zz = self.inertia
        return vehicle._replace(
            mass=self.mass * vehicle.mass,
            inertia_xx=xx * vehicle.inertia_xx,
            inertia_yy=yy * vehicle.inertia_yy,
            inertia_zz=zz * vehicle.inertia_zz,
            arm_length=self.arm_length * vehicle.arm_length,
            thrust_coefficient=self.thrust_coefficient * vehicle.thrust_coefficient,
            drag_coefficient=self.drag_coefficient * vehicle.drag_coefficient,
        )


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
    """The state at time zero; the tilt angles are the gait's."""

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


# --- [reference] -------------------------------------------------------------------------------


Tilt = Annotated[float, Field(gt=-pi / 2, lt=pi / 2)]


class _Reference(Table, ABC):
    """What every reference can tell of itself."""

    @property
    @abstractmethod
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""

    @property
    def table(self) -> tuple[float, ...]:
        """The numbers beside the record, for references of any length."""
        return NO_KEYFRAMES

    def placed(self, table: tuple[float, ...]) -> tuple[ReferenceParameters, tuple[float, ...]]:
        """Record and table where a gait's table lies before the reference's own."""
        if self.table == NO_KEYFRAMES:
            return self.parameters, table
        return self.parameters._replace(offset=float(len(table))), (*table, *self.table)


class _PositionReference(_Reference):
    roll: Tilt = Field(0.0, description="rad, for laws of the whole pose and for switching")
    pitch: Tilt = Field(0.0, description="rad, likewise")
    yaw: Angle = 0.0
    acceleration_feedforward: bool = Field(
        False, description="ch. 4 leaves it out; laws of higher order always have it"
    )

    @property
    def kind(self) -> ReferenceKind:
        """What the reference asks of a law."""
        return "position" if self.roll == self.pitch == 0.0 else "pose"

    def _parameters(self, kind: str, position: Vector3, **own: float) -> ReferenceParameters:
        return ReferenceParameters(
            REFERENCE_TYPES[kind],
            *position,
            roll=self.roll,
            pitch=self.pitch,
            yaw=self.yaw,
            acceleration_feedforward=float(self.acceleration_feedforward),
            **own,
        )


class SetpointReference(_PositionReference):
    """A point to hold."""

    type: Literal["setpoint"] = "setpoint"
    position: Vector3 = Field((0.0, 0.0, 0.0), description="m")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        return self._parameters(self.type, self.position)


class LineReference(_PositionReference):
    """Motion along a line, uniform or at a constant acceleration."""

    type: Literal["line"]
    position: Vector3 = Field((0.0, 0.0, 0.0), description="m, at time zero")
    velocity: Vector3 = Field(description="m/s, at time zero")
    acceleration: Vector3 = Field((0.0, 0.0, 0.0), description="m/s^2")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        return self._parameters(
            self.type,
            self.position,
            **_by_axis("velocity", self.velocity),
            **_by_axis("acceleration", self.acceleration),
        )


class CircleReference(_PositionReference):
    """Uniform motion on a horizontal circle, from +x towards +y; from -x where radius < 0."""

    type: Literal["circle"]
    position: Vector3 = Field((0.0, 0.0, 0.0), description="the centre, m")
    radius: float = Field(description="m; negative to start on the other side")
    angular_frequency: float = Field(description="rad/s")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        own = {"radius": self.radius, "angular_frequency": self.angular_frequency}
        return self._parameters(self.type, self.position, **own)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.radius == 0.0:
            raise InvalidValueError("reference.radius", self.radius, "must not be 0")
        return self


class LissajousReference(_PositionReference):
    """A sine along each axis: ``position + amplitude sin(angular_frequency t + phase)``."""

    type: Literal["lissajous"]
    position: Vector3 = Field((0.0, 0.0, 0.0), description="the centre, m")
    amplitude: Vector3 = Field(description="m")
    angular_frequency: Vector3 = Field(description="rad/s")
    phase: Angles3 = Field((0.0, 0.0, 0.0), description="rad")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        return self._parameters(
            self.type,
            self.position,
            **_by_axis("amplitude", self.amplitude),
            **_by_axis("frequency", self.angular_frequency),
            **_by_axis("phase", self.phase),
        )


class FigureEightReference(_PositionReference):
    """A lying eight, from its crossing towards +x and +y; a lissajous of one to two."""

    type: Literal["figure_eight"]
    position: Vector3 = Field((0.0, 0.0, 0.0), description="where it crosses itself, m")
    length: Positive = Field(description="m, along x")
    width: Positive = Field(description="m, along y")
    angular_frequency: Positive = Field(description="rad/s, once around")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        once = self.angular_frequency
        return self._parameters(
            self.type,
            self.position,
            **_by_axis("amplitude", (0.5 * self.length, 0.5 * self.width, 0.0)),
            **_by_axis("frequency", (once, 2.0 * once, 0.0)),
        )


class WaypointReference(_PositionReference):
    """From rest to rest through points at given times, with the least snap."""

    type: Literal["waypoints"]
    positions: Annotated[tuple[Vector3, ...], Field(min_length=2, max_length=50, strict=False)] = (
        Field(description="m; the first is the start")
    )
    times: Annotated[tuple[float, ...], Field(strict=False)] = Field(
        description="s, one a point, from 0; after the last the reference rests"
    )

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        return self._parameters(self.type, (0.0, 0.0, 0.0), segments=float(len(self.times)))

    @property
    def table(self) -> tuple[float, ...]:
        """The polynomials of the motion; see `controllers.waypoints.minimum_snap_table`."""
        return _minimum_snap_table(self.positions, self.times)

    @model_validator(mode="after")
    def _check(self) -> Self:
        try:
            _ = self.table
        except ValueError as error:
            raise InvalidValueError("reference.times", self.times, str(error)) from None
        return self


_minimum_snap_table = lru_cache(maxsize=64)(minimum_snap_table)


def _by_axis(name: str, values: tuple[float, float, float]) -> dict[str, float]:
    return {f"{name}_{axis}": value for axis, value in zip("xyz", values, strict=True)}


class AttitudeAltitudeReference(_Reference):
    """Attitude and altitude to hold; the horizontal position is free (ch. 3)."""

    type: Literal["attitude_altitude"]
    roll: Tilt = Field(0.0, description="rad")
    pitch: Tilt = Field(0.0, description="rad")
    yaw: Angle = Field(0.0, description="rad")
    altitude: float = Field(0.0, description="m")

    @property
    def kind(self) -> ReferenceKind:
        """What the reference asks of a law."""
        return "attitude_altitude"

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        return ReferenceParameters(
            REFERENCE_TYPES[self.type],
            z=self.altitude,
            roll=self.roll,
            pitch=self.pitch,
            yaw=self.yaw,
        )


Reference = Annotated[
    SetpointReference
    | LineReference
    | CircleReference
    | LissajousReference
    | FigureEightReference
    | WaypointReference
    | AttitudeAltitudeReference,
    Field(discriminator="type"),
]

# --- [ground] ----------------------------------------------------------------------------------


class GroundTable(Table):
    """Ground to take off from and land on; without the table nothing touches."""

    height: float = Field(0.0, description="m, world")
    friction: Positive = Field(0.8, description="coefficient of sliding friction")


# --- [[disturbance]] ---------------------------------------------------------------------------


class Disturbance(Table):
    """What pushes the vehicle without the control law knowing."""

    type: Literal["acceleration"]
    value: Vector3 = Field(description="m/s^2, world; acts on all that has mass, as gravity does")


# --- [sensors] and [[fault]] -------------------------------------------------------------------


class SensorTable(Table):
    """What the law is told of its vehicle's motion; the truth by default.

    Every reading has its own zero-mean normal error of the given standard deviation on each axis,
    drawn from ``simulation.seed``, and stands until the next. Tilts and rotor speeds are known.
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
        None, description="s between readings; default: control_timestep, 0.01 if continuous"
    )

    @property
    def are_imperfect(self) -> bool:
        """Whether any reading differs from the truth."""
        return self.model_copy(update={"sample_time": None}) != SensorTable()


Rotor = Annotated[int, Field(ge=1, le=4)]


class RotorLoss(Table):
    """A rotor that makes neither thrust nor torque any more; its motor turns on."""

    type: Literal["rotor_loss"]
    rotor: Rotor
    time: NonNegative = Field(description="s")


class PartialThrust(Table):
    """A rotor that makes only part of its thrust and drag torque."""

    type: Literal["partial_thrust"]
    rotor: Rotor
    time: NonNegative = Field(description="s")
    factor: Annotated[float, Field(ge=0.0, le=2.0)] = Field(description="what is left, 1 for all")


class StuckServo(Table):
    """A tilt servo that holds one angle whatever it is told."""

    type: Literal["stuck_servo"]
    rotor: Rotor
    time: NonNegative = Field(description="s")
    angle: Angle | None = Field(None, description="rad; default: what the gait plans at the time")


Fault = Annotated[RotorLoss | PartialThrust | StuckServo, Field(discriminator="type")]

# --- [air] -------------------------------------------------------------------------------------

NonNegative3 = Annotated[tuple[NonNegative, NonNegative, NonNegative], Field(strict=False)]


class DragTable(Table):
    """The force against the motion through the air, along each body axis."""

    linear: NonNegative3 = Field((0.0, 0.0, 0.0), description="N s/m")
    area: NonNegative3 = Field(
        (0.0, 0.0, 0.0), description="m^2, drag coefficient times the area seen along the axis"
    )


class GustTable(Table):
    """A discrete gust, one minus cosine (MIL-F-8785C)."""

    velocity: Vector3 = Field(description="m/s, world, at its peak")
    start: NonNegative = Field(0.0, description="s")
    rise: Positive = Field(description="s, up to the peak and down again")
    duration: NonNegative = Field(0.0, description="s, from start to end; 0: it stays")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if 0.0 < self.duration < 2.0 * self.rise:
            raise InvalidValueError(
                "air.gust.duration",
                self.duration,
                f"must be 0 or at least twice rise = {self.rise}",
            )
        return self


class TurbulenceTable(Table):
    """Dryden turbulence, low-altitude model (MIL-F-8785C), drawn from ``simulation.seed``."""

    wind_at_6m: Positive = Field(description="m/s, mean wind 20 ft above the ground")
    height: Annotated[float, Field(ge=3.048, le=304.8)] = Field(
        10.0, description="m above the ground, for intensity and scale"
    )
    sample_time: Positive = Field(0.01, description="s for which a draw of the noise stands")


class GroundEffectTable(Table):
    """Ground effect on each rotor (Cheeseman and Bennett)."""

    rotor_radius: Positive = Field(0.1, description="m")
    height: Coordinate = Field(description="m, z of the ground in the world")


class AirTable(Table):
    """The air around the vehicle; none by default."""

    density: Positive = Field(1.225, description="kg/m^3")
    wind: Vector3 = Field((0.0, 0.0, 0.0), description="m/s, world: where the air goes")
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
                    f"air.{key}", getattr(self, key), "acts through drag; give air.drag"
                )
        return self


# --- [[expect]] --------------------------------------------------------------------------------


class Expectation(Table):
    """A bound on a metric, judged after the flight."""

    metric: str
    claim: str = Field("", description="what the thesis states, in our words, for the report")
    published: float | bool | None = Field(
        None,
        description="the thesis' figure, shown beside ours; true or false: does the metric, or the "
        "statement that it lies within the bounds, hold in the thesis",
    )
    published_tolerance: NonNegative | None = Field(
        None, description="how near counts as reproduced; default: half a unit of the last digit"
    )
    in_kind: Range | None = Field(
        None, description="where the claim still holds though the number differs"
    )
    wrong: bool = Field(False, description="the claim is refuted, not merely not seen; needs why")
    why: str = Field("", description="the reason where the claim does not come out")
    min: float | None = None
    max: float | None = None
    equals: bool | None = Field(None, description="for metrics that are true or false")
    plant: Literal["mujoco", "thesis"] | None = Field(
        None, description="judge on this plant alone; default: on either"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.metric not in METRICS:
            raise InvalidValueError("expect.metric", self.metric, f"choose {', '.join(METRICS)}")
        boolean = self.metric in BOOLEAN_METRICS
        bounded = self.min is not None or self.max is not None
        if boolean and (bounded or self.equals is None):
            raise InvalidValueError(
                "expect.metric", self.metric, "true or false: give equals alone"
            )
        if not boolean and (self.equals is not None or not bounded):
            raise InvalidValueError("expect.metric", self.metric, "a number: give min, max or both")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise InvalidValueError("expect.min", self.min, f"must not exceed max = {self.max}")
        self._check_claim(boolean)
        return self

    def _check_claim(self, boolean: bool) -> None:
        published = self.published
        if boolean and published is not None and not isinstance(published, bool):
            raise InvalidValueError(
                "expect.published", published, f"{self.metric} is true or false"
            )
        if published is None:
            for key in ("claim", "why", "wrong"):
                if getattr(self, key):
                    raise InvalidValueError(
                        f"expect.{key}",
                        getattr(self, key),
                        "needs published: a number, true, false",
                    )
        if published is None or isinstance(published, bool):
            for key in ("published_tolerance", "in_kind"):
                if getattr(self, key) is not None:
                    raise InvalidValueError(
                        f"expect.{key}", getattr(self, key), "needs a published number"
                    )
        if self.wrong and not self.why:
            raise InvalidValueError("expect.wrong", True, "needs why")
        if self.in_kind is not None and not self.in_kind[0] <= self.in_kind[1]:
            raise InvalidValueError("expect.in_kind", self.in_kind, "write [low, high]")


# --- the whole ---------------------------------------------------------------------------------


class Scenario(Table):
    """One flight, fully specified."""

    title: str = ""
    source: str = ""
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
        """Whether anything between law and vehicle is less than ideal; see `_real_actuators`."""
        return any(value != ideal for _, value, ideal in self._real_actuators())

    @property
    def has_air(self) -> bool:
        """Whether the air does anything to the vehicle."""
        return self.air != AirTable()

    def _real_actuators(self) -> list[tuple[str, object, object]]:
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
        self._check_law()
        self._check_actuators()
        self._check_model_error()
        self._check_gait()
        self._check_reference()
        self._check_rotor_limits()
        self._check_ground()
        self._check_servo()
        self._check_stability()
        return self

    def reference_and_table(self) -> tuple[ReferenceParameters, tuple[float, ...]]:
        """The reference's record, and the table of the flight: the gait's and the reference's."""
        gait = self.gait.plan(self.vehicle.resolve())
        return self.reference.placed(gait.table)

    def _check_law(self) -> None:
        law, model = self.controller.law, self.vehicle.model
        if not _flies(self.controller, model):
            raise InvalidValueError(
                "controller.law",
                law,
                f"flies the {self.controller.vehicle_model}, and vehicle.model = {model!r}; "
                f"choose {', '.join(_laws_of(model))}",
            )
        rotors = 2 if model == "tilt_car" else 4
        speed = self.initial.rotor_speed
        if isinstance(speed, tuple) and len(speed) != rotors:
            raise InvalidValueError(
                "initial.rotor_speed", speed, f"the {model} has {rotors} rotors; give one or all"
            )
        if model == "tilt_car":
            self._check_plane()
        elif law == "python":
            self._check_own_law()
        else:
            self._check_layout()
        if model != "quadrotor":
            return
        vehicle = self.rotorcraft
        of_tilts = [
            ("gait.type", self.gait.type, "fixed"),
            ("gait", self.gait.model_dump(), FixedGait().model_dump()),
            ("vehicle.tilt_servo", vehicle.tilt_servo.model_dump(), TiltServoTable().model_dump()),
            ("vehicle.pod", vehicle.pod.model_dump(), PodTable().model_dump()),
        ]
        of_rotors = [
            ("vehicle.min_rotor_speed", vehicle.min_rotor_speed, None),
            ("vehicle.max_rotor_speed", vehicle.max_rotor_speed, None),
            ("initial.rotor_speed", self.initial.rotor_speed, InitialTable().rotor_speed),
        ]
        # Commands from outside reach rotors with a speed, limits and all.
        for key, value, default in of_tilts if law == "python" else [*of_tilts, *of_rotors]:
            if value != default:
                raise InvalidValueError(
                    key,
                    value,
                    "the quadrotor has no use for it: its rotors do not tilt, and "
                    "make the thrust that its law asks for at once",
                )

    def _check_actuators(self) -> None:
        if self.has_air and not isinstance(self.vehicle, VehicleTable):
            raise InvalidValueError(
                "vehicle.model", self.vehicle.model, "has no air around it; leave air out"
            )
        if self.has_air and self.controller.law == "python":
            raise InvalidValueError(
                "controller.law", "python", "a controller of your own flies without air"
            )
        if self.has_air and self.simulation.plant == "thesis":
            raise InvalidValueError(
                "simulation.plant", "thesis", "the thesis' equations know no air; use mujoco"
            )
        for key, value, ideal in self._real_actuators():
            if value == ideal:
                continue
            if self.vehicle.model != "tiltrotor" or self.controller.law == "python":
                own = self.controller.law == "python"
                whose = "a controller of your own" if own else f"the {self.vehicle.model}"
                raise InvalidValueError(key, value, f"{whose} flies without; leave it out")
            if self.simulation.plant == "thesis":
                raise InvalidValueError(
                    "simulation.plant", "thesis", f"the thesis' equations know no {key}; use mujoco"
                )
        kinds = [(f.rotor, f.type == "stuck_servo") for f in self.fault]
        for fault, kind in zip(self.fault, kinds, strict=True):
            if kinds.count(kind) > 1:
                raise InvalidValueError(
                    "fault.rotor",
                    fault.rotor,
                    f"has more than one {'stuck servo' if kind[1] else 'loss of thrust'}",
                )
        controller = self.controller
        prioritized = getattr(controller, "allocation", "inversion") == "prioritized"
        if (
            prioritized
            and self.rotorcraft.min_rotor_speed is None
            and self.rotorcraft.max_rotor_speed is None
        ):
            raise InvalidValueError(
                "controller.allocation",
                "prioritized",
                "nothing limits the rotors; give vehicle.min_rotor_speed or max_rotor_speed",
            )

    def _check_layout(self) -> None:
        own = self.rotorcraft.own
        if own is not None and own.misfit:
            raise InvalidValueError(
                "vehicle.mjcf",
                self.rotorcraft.mjcf,
                f"{own.misfit}; the {self.controller.law} law is for four equal arms at right "
                "angles, a controller of your own flies any",
            )

    def _check_own_law(self) -> None:
        for key, asked, flown in (("plant", "thesis", "mujoco"), ("engine", "native", "python")):
            if getattr(self.simulation, key) == asked:
                raise InvalidValueError(
                    f"simulation.{key}", asked, f"a controller of your own flies on {flown} alone"
                )

    def _check_model_error(self) -> None:
        error = self.model_error
        if error == ModelErrorTable():
            return
        thesis, car = self.simulation.plant == "thesis", not isinstance(self.vehicle, VehicleTable)
        if thesis or car:
            key, value = (
                ("simulation.plant", "thesis") if thesis else ("vehicle.model", self.vehicle.model)
            )
            raise InvalidValueError(
                key, value, "takes no [model_error]; use a rotorcraft on the mujoco plant"
            )
        if error.arm_length != 1.0 and self.rotorcraft.mjcf is not None:
            raise InvalidValueError(
                "model_error.arm_length", error.arm_length, "vehicle.mjcf has its own arms"
            )
        a, b, c = sorted(self.true_rotorcraft[1:4])
        if a + b < c:
            raise InvalidValueError(
                "model_error.inertia",
                list(error.inertia),
                "no body has it: two moments must exceed the third",
            )

    def _check_plane(self) -> None:
        """Refuse what would lift a tilt-car off its plane, or yaw it where yaw is no output."""
        initial, reference = self.initial, self.reference
        vectors: dict[str, tuple[tuple[float, ...], slice]] = {
            "initial.position": (initial.position, slice(2, 3)),
            "initial.velocity": (initial.velocity, slice(2, 3)),
            "initial.attitude": (initial.attitude, slice(0, 2)),
            "initial.angular_velocity": (initial.angular_velocity, slice(0, 2)),
        }
        for name in ("position", "velocity", "acceleration", "amplitude"):
            vector = getattr(reference, name, None)
            if vector is not None:
                vectors[f"reference.{name}"] = (vector, slice(2, 3))
        for key, (vector, upwards) in vectors.items():
            if any(vector[upwards]):
                raise InvalidValueError(
                    key,
                    vector,
                    "the tilt_car stays on its plane: x, y and yaw alone may differ from 0",
                )
        if reference.yaw != 0.0:
            raise InvalidValueError(
                "reference.yaw", reference.yaw, "yaw is no output of the tilt_car's laws"
            )
        wanted = self.controller.gait_types
        if self.gait.type not in wanted:
            raise InvalidValueError(
                "gait.type",
                self.gait.type,
                f"the {self.controller.law} law takes none; leave the table out"
                if wanted == ("fixed",)
                else f"the {self.controller.law} law needs one of {', '.join(wanted)}",
            )
        if wanted == ("fixed",) and self.gait != FixedGait():
            raise InvalidValueError(
                "gait",
                self.gait.model_dump(mode="json"),
                f"the {self.controller.law} law moves the tilt itself; leave the table out",
            )

    def _check_reference(self) -> None:
        controller, reference = self.controller, self.reference
        kind = reference.kind
        # A pose of zero roll and pitch is written like a position.
        kinds = {*controller.reference_kinds}
        if "pose" in kinds:
            kinds.add("position")
        if kind not in kinds:
            if kind == "pose":
                key, value = (
                    ("roll", reference.roll) if reference.roll else ("pitch", reference.pitch)
                )
                raise InvalidValueError(
                    f"reference.{key}",
                    value,
                    f"roll and pitch are no outputs of the {controller.law} law",
                )
            raise InvalidValueError(
                "reference.type", reference.type, f"the {controller.law} law cannot follow it"
            )
        if reference.type == "waypoints" and self.vehicle.model == "tilt_car":
            raise InvalidValueError(
                "reference.type", reference.type, "the tilt_car's laws cannot follow it"
            )
        own = isinstance(controller, AttitudeAltitudeController)
        exact = isinstance(controller, AttitudeAltitudeController) and (
            controller.gait_rate_feedforward
        )
        if (not own or exact) and getattr(reference, "acceleration_feedforward", False):
            law = "attitude_altitude law with gait_rate_feedforward" if exact else controller.law
            raise InvalidValueError(
                "reference.acceleration_feedforward",
                True,
                f"the {law} follows all derivatives anyway; leave it out",
            )
        if not isinstance(controller, AttitudeAltitudeController):
            return
        if controller.supervisor is not None and self.simulation.plant == "thesis":
            raise InvalidValueError(
                "simulation.plant",
                "thesis",
                "its tilt angles follow the gait whatever controller.supervisor says; use mujoco",
            )
        decoupler = controller.decoupler
        free = kind == "attitude_altitude"
        if free and decoupler != "none":
            raise InvalidValueError(
                "controller.decoupler", decoupler, "reference.type = 'attitude_altitude' takes none"
            )
        if not free and decoupler == "none":
            raise InvalidValueError(
                "controller.decoupler",
                decoupler,
                f"reference.type = {reference.type!r} needs conventional, modified or exact",
            )

    def _check_gait(self) -> None:
        key, value = self.gait.size
        try:
            gait = self.gait.plan(self.vehicle.resolve())
        except ValueError as error:
            raise InvalidValueError(f"gait.{key}", value, str(error)) from None
        limit = getattr(self.vehicle.tilt_servo, "max_angle", None)
        if limit is not None and gait.amplitude > limit:
            raise InvalidValueError(
                f"gait.{key}",
                value,
                f"tilts by {gait.amplitude:.4g} rad, beyond the servo limit "
                f"vehicle.tilt_servo.max_angle = {limit}",
            )
        rows = len(gait.table)
        if rows > MAX_TABLE:
            raise InvalidValueError(
                f"gait.{key}", value, f"too many keyframes: {rows} numbers, at most {MAX_TABLE}"
            )
        total = len(self.reference.placed(gait.table)[1])
        if total > MAX_TABLE:
            raise InvalidValueError(
                "reference.times",
                len(getattr(self.reference, "times", ())),
                f"too many waypoints: {total} numbers with the gait's, at most {MAX_TABLE}",
            )
        if self.controller.law == "full_pose" and not gait.is_constant:
            raise InvalidValueError(
                "gait.type",
                self.gait.type,
                "the full_pose law moves the pods itself; give the angles at the start as fixed",
            )

    def _check_ground(self) -> None:
        if self.ground is None:
            return
        if self.vehicle.model == "tilt_car":
            raise InvalidValueError(
                "ground", self.ground.model_dump(), "the tilt_car moves in a plane without one"
            )
        if self.simulation.plant == "thesis":
            raise InvalidValueError(
                "simulation.plant", "thesis", "the thesis' equations know no ground; use mujoco"
            )
        own = self.rotorcraft.own
        if own is not None and not own.can_touch:
            raise InvalidValueError(
                "ground",
                self.ground.model_dump(),
                "vehicle.mjcf needs a geom 'ground', and geoms whose names end in 'collision'",
            )
        if self.initial.position[2] < self.ground.height:
            raise InvalidValueError(
                "initial.position",
                self.initial.position,
                f"below ground.height = {self.ground.height}",
            )

    def _check_rotor_limits(self) -> None:
        if not isinstance(self.vehicle, VehicleTable):
            return
        low, high = self.vehicle.min_rotor_speed, self.vehicle.max_rotor_speed
        if self.simulation.plant == "thesis" and (low is not None or high is not None):
            raise InvalidValueError(
                "simulation.plant",
                "thesis",
                "the thesis' equations know no rotor limits; use mujoco",
            )
        for speed in self.initial.rotor_speeds(4):
            if (low is not None and speed < low) or (high is not None and speed > high):
                raise InvalidValueError(
                    "initial.rotor_speed",
                    speed,
                    f"must lie within the rotor limits, {low or 0} to {high or 'any'} rad/s",
                )

    def _check_servo(self) -> None:
        servo, timestep = self.vehicle.tilt_servo, self.simulation.timestep
        # The fastest pole of the servo must stay where explicit integration is stable.
        fastest = servo.natural_frequency * max(1.0, 2.0 * servo.damping_ratio)
        tilts = self.vehicle.model != "quadrotor"
        if tilts and self.simulation.plant == "mujoco" and fastest * timestep > MAX_SERVO_STEP:
            raise InvalidValueError(
                "simulation.timestep",
                timestep,
                f"too long for a tilt servo at {servo.natural_frequency:g} rad/s; at most "
                f"{MAX_SERVO_STEP / fastest:.3g} s, or a slower vehicle.tilt_servo",
            )

    def _check_stability(self) -> None:
        controller = self.controller
        if controller.allow_unstable:
            return
        vehicle: Any = self.vehicle.resolve()  # each law's table takes its own vehicle's
        for loop in controller.closed_loops(vehicle):
            if not loop.stable:
                raise InvalidValueError(
                    "controller.gains",
                    controller.model_dump()["gains"],
                    f"unstable under {controller.linearization} by Routh: "
                    f"{loop.condition}; change the gains or set controller.allow_unstable = true",
                )
            self._check_speed(loop)

    def _check_speed(self, loop: Loop) -> None:
        """Refuse a loop whose fastest pole the time steps cannot follow.

        The published decoupling matrix speeds the attitude loops up some 700 times, so that
        harmless-looking gains can outrun the integrator within a few steps.
        """
        fastest = float(np.abs(np.roots(loop.polynomial)).max())
        limits = {"timestep": MAX_LOOP_STEP, "control_timestep": MAX_HELD_STEP}
        for key, limit in limits.items():
            step = getattr(self.simulation, key)
            if fastest * step > limit:
                raise InvalidValueError(
                    f"simulation.{key}",
                    step,
                    f"too long for the {loop.name} loop under "
                    f"{self.controller.linearization}, with its fastest pole at {fastest:.4g} "
                    f"rad/s; at most {limit / fastest:.3g} s, or slower gains, or "
                    "controller.allow_unstable = true",
                )


def _laws_of(model: str) -> list[str]:
    union = get_args(get_args(Controller)[0])
    tables = [get_args(option)[0] for option in union]
    return [get_args(t.model_fields["law"].annotation)[0] for t in tables if _flies(t, model)]


def _flies(law: LawTable | type[LawTable], model: str) -> bool:
    either = law.vehicle_model == ANY_ROTORCRAFT and model in {"tiltrotor", "quadrotor"}
    return either or law.vehicle_model == model


class Variant(Table):
    """One member of a family: a name, what differs from the base, and its own expectations."""

    model_config = ConfigDict(extra="allow")

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+$")]
