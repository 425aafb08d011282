"""The tables ``[simulation]``, ``[initial]`` and ``[autopilot]``."""

import re
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import (
    ZEROS,
    Angles3,
    Many,
    NonNegative,
    Positive,
    PositiveEach,
    Row,
    Table,
    Vector3,
    default,
    example,
    required,
)

MAX_STEPS: Final = 100_000_000
"""Largest number of physics steps of a flight, more than a day at one millisecond."""

DEFAULT_ROTOR_SPEED: Final = 300.0  # rad/s, of the thesis's flights at time zero

PlantName = Literal["mujoco", "thesis", "rigid_body"]

INTEGRATORS: Final = {
    "mujoco": ("RK4", "implicitfast", "implicit", "Euler"),
    "rigid_body": ("RK4", "ode3"),
}
"""Integrators of each plant; the thesis plant ignores the key."""

MAX_LATENCY_STEPS: Final = 20
"""Largest number of delayed control samples; each takes eight states of the simulation."""


class SimulationTable(Table):
    """How the flight is integrated."""

    model_config = example(duration=20.0, plant="thesis")
    table_name = "simulation"
    only_with: ClassVar = {
        ("precision",): ("engine", "jax"),
        ("batch_functions",): ("plant", "thesis", "rigid_body"),
    }

    duration: Positive = default(40.0, "length of the flight [s]")
    timestep: Annotated[float, Field(ge=1e-6, le=0.1)] = default(
        0.001, "time step of the physics [s]"
    )
    control_timestep: NonNegative = default(
        0.0,
        "time between evaluations of the control law, a multiple of timestep; 0 evaluates it at "
        "every stage of the integrator, as if it were continuous [s]",
        0.004,
    )
    control_latency: NonNegative = default(
        0.0, "time from a measurement to its command, a multiple of control_timestep [s]", 0.008
    )
    record_timestep: Positive | None = default(
        None,
        "time between recorded samples; default: the multiple of timestep closest to 0.01 [s]",
        0.02,
    )
    engine: Literal["auto", "python", "native", "jax"] = default(
        "auto",
        "evaluates the control law as Python or as compiled code, with bit-identical flights; "
        "auto compiles for long flights; jax flies many on arrays, on the plants of equations, "
        "thesis and rigid_body",
    )
    precision: Literal["float64", "float32"] = default(
        "float64", "numbers of the jax engine; the others always have float64"
    )
    batch_functions: Literal["exact", "quick"] = default(
        "exact",
        "sines and their inverses where native flights on equations fly side by side: with the "
        "bits of a flight alone, or faster, with flights that differ by rounding",
    )
    plant: PlantName = default(
        "mujoco",
        "what is simulated: the MuJoCo model; the thesis's equations of motion; or the equations "
        "of one rigid body with gyroscopic torque, tilt servos and massless pods",
    )
    integrator: Literal["RK4", "implicitfast", "implicit", "Euler", "ode3"] = default(
        "RK4",
        "on the mujoco plant RK4, implicitfast, implicit or Euler; on rigid_body RK4 or ode3, a "
        "method of third order; the thesis plant always uses ode3",
    )
    seed: Annotated[int, Field(ge=0)] = default(0, "seed of sensor noise and turbulence", 1)

    @property
    def solver(self) -> str:
        """The integrator that the plant uses."""
        return "ode3" if self.plant == "thesis" else self.integrator

    @property
    def steps(self) -> int:
        """Number of physics steps of the flight."""
        return round(self.duration / self.timestep)

    @property
    def control_steps(self) -> int:
        """Physics steps between control samples; 0 if control is continuous."""
        return round(self.control_timestep / self.timestep)

    @property
    def latency_steps(self) -> int:
        """Control samples between a measurement and its command; 0 without latency."""
        return round(self.control_latency / self.control_timestep) if self.control_latency else 0

    @property
    def record_steps(self) -> int:
        """Physics steps between recorded samples."""
        interval = 0.01 if self.record_timestep is None else self.record_timestep
        return max(1, round(interval / self.timestep))

    def _check_values(self) -> None:
        for key in ("duration", "control_timestep", "record_timestep"):
            value = getattr(self, key)
            if value is None or value == 0.0:
                continue
            steps = value / self.timestep
            if steps > MAX_STEPS:
                raise self.mistake(key, f"more than {MAX_STEPS:.0e} steps of timestep")
            if value > self.duration:
                raise self.mistake(key, f"longer than the flight, {self.duration} s")
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-6 * steps:
                raise self.mistake(key, f"must be a multiple of timestep = {self.timestep}")
        allowed = INTEGRATORS.get(self.plant)
        if allowed is not None and self.integrator not in allowed:
            raise self.mistake("integrator", f"on the {self.plant} plant: {', '.join(allowed)}")
        self._check_latency()

    def _check_latency(self) -> None:
        latency, period = self.control_latency, self.control_timestep
        if latency == 0.0:
            return
        if period == 0.0:
            raise self.mistake(
                "control_latency", "must be a multiple of control_timestep, which is 0"
            )
        steps = latency / period
        if abs(steps - round(steps)) > 1e-6 * steps or not 1 <= round(steps) <= MAX_LATENCY_STEPS:
            raise self.mistake(
                "control_latency",
                f"must be 1 to {MAX_LATENCY_STEPS} times control_timestep = {period}",
            )


class InitialTable(Table):
    """The state at time zero; the tilt angles and their rates are the gait's."""

    model_config = example(position=[0.0, 0.0, 1.0])

    position: Vector3 = default(
        ZEROS, "of the center of mass in the world, z up [m]", [0.0, 0.0, 1.0]
    )
    velocity: Vector3 = default(ZEROS, "in the world [m/s]", [1.0, 0.0, 0.0])
    attitude: Angles3 = default(
        ZEROS, "roll, pitch and yaw: turns about x, y and z, yaw first [rad]", [0.1, 0.0, 0.0]
    )
    angular_velocity: Vector3 = default(ZEROS, "p, q, r about the body axes [rad/s]", [0, 0, 0.5])
    rotor_speed: Positive | PositiveEach | None = default(
        None,
        "absolute value, one for all rotors or one per rotor; rotors 1 and 3 of tiltrotor and "
        "quadrotor turn clockwise seen from above, 2 and 4 counterclockwise; default: 300, and of "
        "a multirotor those of hover at its initial tilts [rad/s]",
        300.0,
    )

    def rotor_speeds(self, rotors: int) -> tuple[float, ...]:
        """Absolute rotor speeds (rad/s), one for each of a number of rotors; by default 300."""
        speed = DEFAULT_ROTOR_SPEED if self.rotor_speed is None else self.rotor_speed
        return speed if isinstance(speed, tuple) else (speed,) * rotors


CONTROLLER: Final = {"law": "python", "function": "autopilot"}
"""The controller of a scenario with an autopilot."""

CHANNELS: Final = 32  # most outputs of a firmware

_OUTPUT: Final = re.compile(r"(rotor|along|across)_([1-9]\d?)")


class AutopilotTable(Table):
    """A firmware on this machine that gets sensor readings and returns outputs, in lockstep."""

    table_name = "autopilot"

    type: Literal["ardupilot", "px4"] = required(
        "ArduPilot's software in the loop, by its JSON interface over UDP; PX4's, by MAVLink over "
        "TCP"
    )
    port: Annotated[int, Field(ge=1, le=65535)] = default(
        9002, "port of this machine, on loopback, to which the firmware sends; of PX4: 4560"
    )
    rate: Annotated[float, Field(ge=50.0, le=4000.0)] = default(
        800.0,
        "exchanges per simulated second; must be at least 1.8 times the rate of the firmware's "
        "main loop; of PX4: 250 [Hz]",
    )
    outputs: Annotated[Many[str], Field(max_length=CHANNELS)] = default(
        (),
        'what each output drives: "rotor_2" its speed, from 1000 to 2000 us, about 1500 us if the '
        'rotor reverses; "along_2" and "across_2" the parts of the thrust of a tilting rotor '
        'along its upright axis and across; "" nothing; default: the rotors in order',
        ["rotor_3", "rotor_2", "rotor_1", "rotor_4"],
    )
    wait: Positive = default(
        20.0, "longest time for the firmware to answer, before the link is lost [s]"
    )
    hold: Positive = default(
        90.0,
        "longest simulated time that the vehicle is held at rest until its thrust exceeds its "
        "weight, in which a firmware starts its estimator [s]",
    )
    rc: Annotated[Many[Row], Field(max_length=10_000)] = default(
        (),
        "sticks and switches: rows of a time since the link began and the channels from that time "
        "on [s, us]",
        [[0.0, 1500, 1500, 1000, 1500], [40.0, 1500, 1500, 1700, 1500]],
    )

    def _check_values(self) -> None:
        used = [name for name in self.outputs if name]
        for name in used:
            if not _OUTPUT.fullmatch(name):
                raise InvalidValueError(
                    "autopilot.outputs", name, 'write "rotor_1", "along_1", "across_1" or ""'
                )
            if used.count(name) > 1:
                raise InvalidValueError("autopilot.outputs", name, "twice")
        times = [row[0] for row in self.rc]
        if any(later <= time for time, later in pairwise(times)):
            raise self.mistake("rc", "times must increase from row to row")

    @property
    def control_timestep(self) -> float:
        """Simulated time between exchanges, s."""
        return 1.0 / self.rate


def with_controller(document: Any) -> Any:
    """A scenario's document, with the controller and the control period of its autopilot.

    Raises `InvalidValueError` if it has another controller as well.
    """
    table = document.get("autopilot") if isinstance(document, Mapping) else None
    if not isinstance(table, Mapping):
        return document
    controller = document.get("controller", CONTROLLER)
    if controller != CONTROLLER:
        raise InvalidValueError(
            "controller", controller, "the autopilot is the controller; remove [controller]"
        )
    if table.get("type") == "px4":
        table = {"port": 4560, "rate": 250.0, **table}
    changed = {**document, "controller": CONTROLLER, "autopilot": table}
    simulation, rate = document.get("simulation", {}), table.get("rate", 800.0)
    if isinstance(simulation, Mapping) and isinstance(rate, int | float) and rate > 0.0:
        step = 1.0 / rate
        if simulation.get("control_timestep", step) != step:
            raise InvalidValueError(
                "simulation.control_timestep",
                simulation["control_timestep"],
                f"the autopilot's rate makes it {step:g}; remove it",
            )
        changed["simulation"] = {"timestep": step, **simulation, "control_timestep": step}
    return changed
