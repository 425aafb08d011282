"""Scenarios: what to fly, table by table, checked before anything moves.

`Scenario` mirrors the file; every key has its unit, bounds and default here and nowhere else.
`tiltsim.loading` reads the files, `tiltsim.messages` words the mistakes.
"""

from __future__ import annotations

from math import pi
from typing import Annotated, Final, Literal, Self, get_args

import numpy as np
from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from controllers.references import REFERENCE_TYPES, ReferenceParameters
from controllers.stability import Loop
from controllers.vehicle import PRESETS, Vehicle
from tiltsim.controller_tables import AttitudeAltitudeController, Controller, ReferenceKind
from tiltsim.gait_tables import FixedGait, Gait
from tiltsim.messages import InvalidValueError
from tiltsim.metrics import BOOLEAN_METRICS, METRICS
from tiltsim.tables import (
    Angle,
    Angles3,
    Coordinate,
    NonNegative,
    Positive,
    Positive4,
    Table,
    Vector3,
)

MAX_STEPS: Final = 100_000_000
"""Physics steps of a flight, more than a day at one millisecond."""

MAX_TABLE: Final = 1500
"""Numbers in a gait's table of keyframes, which every evaluation of the control law reads."""

MAX_LOOP_STEP: Final = 2.5
"""Largest product of timestep and closed-loop pole; RK4 turns unstable at 2.78, ode3 at 2.51."""

MAX_HELD_STEP: Final = 2.0
"""Largest product of control timestep and pole, where a held third derivative turns unstable."""

MAX_SERVO_STEP: Final = 2.6
"""Largest product of timestep and servo pole; RK4 turns unstable at 2.78."""

MAX_LATENCY_STEPS: Final = 20
"""Control samples on their way at once; each is eight states of the simulation."""

# --- [vehicle] ---------------------------------------------------------------------------------


class TiltServoTable(Table):
    """The servos that tilt the pods: second order, ideal but for what is given here."""

    natural_frequency: Positive = Field(300.0, description="rad/s")
    damping_ratio: Positive = 1.0
    max_rate: Positive | None = Field(None, description="rad/s")
    max_angle: Annotated[float, Field(gt=0.0, le=pi)] | None = Field(
        None, description="rad; the gait must stay within"
    )


class PodTable(Table):
    """Mass properties of one rotor pod; nearly massless by default, as in the thesis."""

    mass: Annotated[float, Field(ge=1e-14)] = Field(1e-9, description="kg")
    inertia: Annotated[float, Field(ge=1e-14)] = Field(
        1e-13, description="kg m^2, about each axis of the pod"
    )


class VehicleTable(Table):
    """The vehicle: a preset and what differs from it."""

    model: Literal["tiltrotor", "quadrotor"] = "tiltrotor"
    preset: Literal["ar_drone_2", "ar_drone_2_unrounded", "luukkonen"] = "ar_drone_2"
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
        """The physical parameters: the preset with the given keys in place of its own."""
        given = {
            key: getattr(self, key)
            for key in ("mass", "arm_length", "thrust_coefficient", "drag_coefficient", "gravity")
        }
        if self.inertia is not None:
            given |= dict(
                zip(("inertia_xx", "inertia_yy", "inertia_zz"), self.inertia, strict=True)
            )
        known = {key: value for key, value in given.items() if value is not None}
        return PRESETS[self.preset]._replace(**known)

    @model_validator(mode="after")
    def _check(self) -> Self:
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
    rotor_speed: Positive | Positive4 = Field(
        300.0, description="absolute value, rad/s; one for all rotors or four"
    )

    @property
    def rotor_speeds(self) -> tuple[float, float, float, float]:
        """Absolute rotor speeds, one each."""
        speed = self.rotor_speed
        return speed if isinstance(speed, tuple) else (speed, speed, speed, speed)


# --- [reference] -------------------------------------------------------------------------------


Tilt = Annotated[float, Field(gt=-pi / 2, lt=pi / 2)]


class _PositionReference(Table):
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
    """Uniform motion along a line."""

    type: Literal["line"]
    position: Vector3 = Field((0.0, 0.0, 0.0), description="m, at time zero")
    velocity: Vector3 = Field(description="m/s")

    @property
    def parameters(self) -> ReferenceParameters:
        """The record that the law reads."""
        vx, vy, vz = self.velocity
        own = {"velocity_x": vx, "velocity_y": vy, "velocity_z": vz}
        return self._parameters(self.type, self.position, **own)


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


class AttitudeAltitudeReference(Table):
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
    SetpointReference | LineReference | CircleReference | AttitudeAltitudeReference,
    Field(discriminator="type"),
]

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
        return self.model_dump(exclude={"sample_time"}) != _PERFECT


_PERFECT: Final = SensorTable().model_dump(exclude={"sample_time"})

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


class GroundTable(Table):
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
    ground: GroundTable | None = None

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
    published: float | None = Field(None, description="the thesis' figure, shown beside ours")
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
        return self


# --- the whole ---------------------------------------------------------------------------------


class Scenario(Table):
    """One flight, fully specified."""

    title: str = ""
    source: str = ""
    vehicle: VehicleTable = VehicleTable()
    simulation: SimulationTable = SimulationTable()
    initial: InitialTable = InitialTable()
    controller: Controller = AttitudeAltitudeController()
    gait: Gait = FixedGait()
    reference: Reference = SetpointReference()
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
        return [
            ("vehicle.rotor_time_constant", self.vehicle.rotor_time_constant, None),
            ("vehicle.tilt_servo.max_rate", self.vehicle.tilt_servo.max_rate, None),
            ("simulation.control_latency", self.simulation.control_latency, 0.0),
            ("sensors", self.sensors.model_dump(exclude={"sample_time"}), _PERFECT),
            ("fault", [fault.type for fault in self.fault], []),
            ("controller.allocation", getattr(controller, "allocation", "inversion"), "inversion"),
        ]

    @model_validator(mode="after")
    def _check(self) -> Self:
        self._check_law()
        self._check_actuators()
        self._check_gait()
        self._check_reference()
        self._check_rotor_limits()
        self._check_servo()
        self._check_stability()
        return self

    def _check_law(self) -> None:
        law, model = self.controller.law, self.vehicle.model
        if self.controller.vehicle_model != model:
            raise InvalidValueError(
                "controller.law",
                law,
                f"flies the {self.controller.vehicle_model}, and vehicle.model = {model!r}; "
                f"choose {', '.join(_laws_of(model))}",
            )
        if model != "quadrotor":
            return
        vehicle = self.vehicle
        for key, value, default in (
            ("gait.type", self.gait.type, "fixed"),
            ("gait", self.gait.model_dump(), FixedGait().model_dump()),
            ("vehicle.tilt_servo", vehicle.tilt_servo.model_dump(), TiltServoTable().model_dump()),
            ("vehicle.pod", vehicle.pod.model_dump(), PodTable().model_dump()),
            ("vehicle.min_rotor_speed", vehicle.min_rotor_speed, None),
            ("vehicle.max_rotor_speed", vehicle.max_rotor_speed, None),
            ("initial.rotor_speed", self.initial.rotor_speed, InitialTable().rotor_speed),
        ):
            if value != default:
                raise InvalidValueError(
                    key,
                    value,
                    "the quadrotor has no use for it: its rotors do not tilt, and "
                    "make the thrust that its law asks for at once",
                )

    def _check_actuators(self) -> None:
        if self.has_air and self.simulation.plant == "thesis":
            raise InvalidValueError(
                "simulation.plant", "thesis", "the thesis' equations know no air; use mujoco"
            )
        for key, value, ideal in self._real_actuators():
            if value == ideal:
                continue
            if self.vehicle.model != "tiltrotor":
                raise InvalidValueError(
                    key, value, f"the {self.vehicle.model} flies without; leave it out"
                )
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
        low, high = self.vehicle.min_rotor_speed, self.vehicle.max_rotor_speed
        if getattr(controller, "allocation", "") == "prioritized" and low is None and high is None:
            raise InvalidValueError(
                "controller.allocation",
                "prioritized",
                "nothing limits the rotors; give vehicle.min_rotor_speed or max_rotor_speed",
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
        if not isinstance(controller, AttitudeAltitudeController):
            if getattr(reference, "acceleration_feedforward", False):
                raise InvalidValueError(
                    "reference.acceleration_feedforward",
                    True,
                    f"the {controller.law} law follows all derivatives anyway; leave it out",
                )
            return
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
        limit = self.vehicle.tilt_servo.max_angle
        if limit is not None and gait.amplitude > limit:
            raise InvalidValueError(
                f"gait.{key}",
                value,
                f"tilts by {gait.amplitude:.4g} rad, beyond the servo limit "
                f"vehicle.tilt_servo.max_angle = {limit}",
            )
        if len(gait.table) > MAX_TABLE:
            raise InvalidValueError(
                f"gait.{key}",
                value,
                f"too many keyframes: {len(gait.table)} numbers, at most {MAX_TABLE}",
            )
        if self.controller.law == "full_pose" and not gait.is_constant:
            raise InvalidValueError(
                "gait.type",
                self.gait.type,
                "the full_pose law moves the pods itself; give the angles at the start as fixed",
            )

    def _check_rotor_limits(self) -> None:
        low, high = self.vehicle.min_rotor_speed, self.vehicle.max_rotor_speed
        if self.simulation.plant == "thesis" and (low is not None or high is not None):
            raise InvalidValueError(
                "simulation.plant",
                "thesis",
                "the thesis' equations know no rotor limits; use mujoco",
            )
        for speed in self.initial.rotor_speeds:
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
        tilts = self.vehicle.model == "tiltrotor"
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
        for loop in controller.closed_loops(self.vehicle.resolve()):
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
    return [
        get_args(t.model_fields["law"].annotation)[0] for t in tables if t.vehicle_model == model
    ]


class Variant(Table):
    """One member of a family: a name, what differs from the base, and its own expectations."""

    model_config = ConfigDict(extra="allow")

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+$")]
