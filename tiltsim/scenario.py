"""Scenarios: what to fly, table by table, checked before anything moves.

`Scenario` mirrors the file; every key has its unit, bounds and default here or in the modules of
tables, and nowhere else.
`tiltsim.loading` reads the files, `tiltsim.messages` words the mistakes.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal, Self, get_args

import numpy as np
from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from controllers.references import ReferenceParameters
from controllers.stability import Loop
from controllers.vehicle import Vehicle
from tiltsim.controller_tables import (
    ANY_ROTORCRAFT,
    AttitudeAltitudeController,
    Controller,
    LawTable,
)
from tiltsim.expectation_table import Expectation
from tiltsim.gait_tables import FixedGait, Gait
from tiltsim.messages import InvalidValueError
from tiltsim.reference_tables import Reference, SetpointReference
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
    PodTable,
    TiltCarTable,
    TiltServoTable,
    VehicleTable,
    VehicleUnion,
)

MAX_STEPS: Final = 100_000_000
"""Physics steps of a flight, more than a day at one millisecond."""

MAX_TABLE: Final = 1500
"""Numbers in the table of a gait and a reference, which every evaluation of the law reads."""

MAX_LOOP_STEP: Final = 2.5
"""Largest product of timestep and closed-loop pole; RK4 turns unstable at 2.78, ode3 at 2.51."""

MAX_HELD_STEP: Final = 2.0
"""Largest product of control timestep and pole, where a held third derivative turns unstable."""

MAX_SERVO_STEP: Final = {"mujoco": 2.6, "thesis": 2.45}
"""Largest product of timestep and servo pole, by plant.

On the real axis RK4 turns unstable at 2.78 and ode3 at 2.51; at a damping ratio of 0.3 or more both
bear these. With less, ode3 bears `MAX_UNDAMPED_SERVO_STEP`.
"""

MAX_UNDAMPED_SERVO_STEP: Final = 1.7
"""On the thesis plant: ode3 turns unstable at 1.73 on the imaginary axis."""

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
        """Whether anything between law and vehicle is less than ideal; see `_real_actuators`."""
        return any(value != ideal for _, value, ideal in self._real_actuators())

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
        for key, value, ideal in self._real_actuators():
            if value != ideal and self.vehicle.model != "tiltrotor":
                raise InvalidValueError(
                    key, value, f"the {self.vehicle.model} flies without; leave it out"
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
        if not isinstance(self.vehicle, VehicleTable):
            raise InvalidValueError(
                "vehicle.model", self.vehicle.model, "takes no [model_error]; use a rotorcraft"
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
        controller.resolve_supervisor(self.rotorcraft.resolve())
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
                "simulation.plant",
                "thesis",
                "its equations know no contact with ground; use mujoco",
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
        plant = self.simulation.plant
        limit = MAX_SERVO_STEP[plant]
        if plant == "thesis" and servo.damping_ratio < 0.3:
            limit = MAX_UNDAMPED_SERVO_STEP
        tilts = self.vehicle.model != "quadrotor"
        moves = plant == "mujoco" or not self.does_as_told  # else pods follow the gait exactly
        if tilts and moves and fastest * timestep > limit:
            raise InvalidValueError(
                "simulation.timestep",
                timestep,
                f"too long for a tilt servo at {servo.natural_frequency:g} rad/s; at most "
                f"{limit / fastest:.3g} s, or a slower vehicle.tilt_servo",
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
