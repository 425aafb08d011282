"""The tables of the instruments on a vehicle, below ``[sensors]``."""

from collections.abc import Mapping
from math import cos, radians, sin, sqrt
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from tiltsim.scenario.table import (
    ZEROS,
    Angles3,
    NonNegative,
    Positive,
    Table,
    Vector3,
    default,
    example,
)

Probability = Annotated[float, Field(ge=0.0, lt=1.0)]
G: Final = 9.80665  # m/s^2
MOST_UNDER_WAY: Final = 64  # readings that wait for their delay
FINEST: Final = 1e-12  # step of readings: rounding is as coarse


class Errors(NamedTuple):
    """Independent errors of an instrument, one entry each: see `instrument_record`."""

    noise: tuple[float, ...]
    walk: tuple[float, ...]
    bias: tuple[float, ...]
    resolution: tuple[float, ...]


_ENDINGS: Final = ("noise", "noise_density", "random_walk", "bias", "resolution")
"""Ends of the keys of errors."""

POSITION: Any = Field(
    ZEROS, description="from the center of mass, body axes [m]", examples=[[0.05, 0.0, 0.01]]
)
ORIENTATION: Any = Field(
    ZEROS,
    description="roll, pitch and yaw of its own axes, in which it errs [rad]",
    examples=[[0.0, 0.0, 1.57]],
)


class InstrumentTable(Table):
    """An instrument that is read at control steps."""

    columns: ClassVar[Mapping[str, str]] = {}
    """Its columns in a flight and their units; with ``#`` one for each rotor."""
    quantities: ClassVar[tuple[tuple[str, int], ...]] = (("", 3),)
    """Beginnings of the keys of its errors, with the sizes of their readings; 0: the rotors'."""

    rate: Positive | None = default(
        None, "readings per second; default: one each control step [Hz]", 100
    )
    delay: NonNegative = default(0.0, "until a reading is available [s]", 0.02)
    dropout: Probability = default(0.0, "probability that a reading is lost [-]", 0.05)

    def _check_values(self) -> None:
        for key in type(self).model_fields:
            if key.endswith("resolution") and 0.0 < getattr(self, key) < FINEST:
                raise self.mistake(key, f"must be 0, for none, or at least {FINEST:g}")

    def period(self, timestep: float) -> float:
        """Time between readings (s), with a time between control steps (s)."""
        return timestep if self.rate is None else 1.0 / self.rate

    def errors(self, rate: float, rotors: int) -> Errors:
        """Its errors at a rate (Hz) on a vehicle with a number of rotors."""
        root, every = sqrt(rate), []
        for begin, size in self.quantities:
            given = {ending: getattr(self, begin + ending, 0.0) for ending in _ENDINGS}
            noise = given["noise"] or given["noise_density"] * root
            values = noise, given["random_walk"] / root, given["bias"], given["resolution"]
            every.append([np.broadcast_to(value, size or rotors) for value in values])
        return Errors(*(tuple(np.hstack(each).tolist()) for each in zip(*every, strict=True)))


_OF_PART: Final = (
    "accelerometer_noise_density",
    "gyro_noise_density",
    "accelerometer_resolution",
    "gyro_resolution",
)
"""Keys of an IMU that its part decides."""


class ImuTable(InstrumentTable):
    """Accelerometer and gyro; readings are in body axes."""

    table_name = "sensors.imu"
    model_config = example(preset="bmi088")
    quantities = (("accelerometer_", 3), ("gyro_", 3))
    columns: ClassVar[Mapping[str, str]] = {
        **{f"imu_acceleration_{axis}": "m/s^2" for axis in "xyz"},
        **{f"imu_rate_{axis}": "rad/s" for axis in "xyz"},
    }
    presets: ClassVar[Mapping[str, tuple[float, float, float, float]]] = {
        "bmi088": (190e-6 * G, radians(0.014), G / 5460.0, radians(1.0 / 32.768)),
        "icm_20948": (230e-6 * G, radians(0.015), G / 8192.0, radians(1.0 / 32.8)),
        "mpu_6050": (400e-6 * G, radians(0.005), G / 8192.0, radians(1.0 / 32.8)),
    }
    """Values of `_OF_PART`. Nominal densities of the data sheets BST-BMI088-DS001, DS-000189
    (ICM-20948) and PS-MPU-6000A-00, taken for all axes and ranges; resolutions of the ranges +-6 g,
    +-4 g and +-4 g, and of +-1000 deg/s.
    """

    preset: Literal["bmi088", "icm_20948", "mpu_6050"] | None = default(
        None, "densities and resolutions of a part, unless given", "bmi088"
    )
    accelerometer_noise_density: NonNegative = default(
        0.0, "of white noise [m/s^2/sqrt(Hz)]", 0.0017
    )
    accelerometer_random_walk: NonNegative = default(0.0, "of the bias [m/s^3/sqrt(Hz)]", 0.0003)
    accelerometer_bias: Vector3 = default(ZEROS, "constant error [m/s^2]", [0.1, 0.0, -0.05])
    accelerometer_resolution: NonNegative = default(
        0.0, "step of the readings; 0: none [m/s^2]", 0.0012
    )
    gyro_noise_density: NonNegative = default(0.0, "of white noise [rad/s/sqrt(Hz)]", 0.00024)
    gyro_random_walk: NonNegative = default(0.0, "of the bias [rad/s^2/sqrt(Hz)]", 2e-5)
    gyro_bias: Vector3 = default(ZEROS, "constant error [rad/s]", [0.01, 0.0, -0.005])
    gyro_resolution: NonNegative = default(0.0, "step of the readings; 0: none [rad/s]", 0.0011)
    position: Vector3 = POSITION
    orientation: Angles3 = ORIENTATION

    @model_validator(mode="before")
    @classmethod
    def _of_preset(cls, given: Any) -> Any:
        preset = cls.presets.get(str(given.get("preset"))) if isinstance(given, dict) else None
        return {**dict(zip(_OF_PART, preset)), **given} if preset else given


class MocapTable(InstrumentTable):
    """Motion capture: position and attitude from cameras."""

    table_name = "sensors.mocap"
    model_config = example(rate=100.0, position_noise=0.001, delay=0.01)
    quantities = (("position_", 3), ("attitude_", 3))
    columns: ClassVar[Mapping[str, str]] = {
        **{f"mocap_{axis}": "m" for axis in "xyz"},
        **{f"mocap_q{part}": "1" for part in "wxyz"},
    }

    position_noise: NonNegative = default(0.0, "standard deviation along each axis [m]", 0.001)
    position_bias: Vector3 = default(ZEROS, "constant error, world axes [m]", [0.002, 0.0, 0.0])
    position_resolution: NonNegative = default(0.0, "step of the readings; 0: none [m]", 0.0001)
    attitude_noise: NonNegative = default(
        0.0, "standard deviation about each body axis [rad]", 0.005
    )
    attitude_bias: Vector3 = default(
        ZEROS, "constant turn about the body axes [rad]", [0.01, 0.0, 0.0]
    )

    position: Vector3 = POSITION


class GpsTable(InstrumentTable):
    """Position and velocity from satellites."""

    table_name = "sensors.gps"
    model_config = example(rate=5.0, position_noise=1.0, velocity_noise=0.05, delay=0.12)
    quantities = (("position_", 3), ("velocity_", 3))
    columns: ClassVar[Mapping[str, str]] = {
        **{f"gps_{axis}": "m" for axis in "xyz"},
        **{f"gps_velocity_{axis}": "m/s" for axis in "xyz"},
    }

    position_noise: NonNegative = default(0.0, "standard deviation along each axis [m]", 1.0)
    position_random_walk: NonNegative = default(
        0.0, "of the error of the position [m/sqrt(s)]", 0.05
    )
    position_bias: Vector3 = default(ZEROS, "constant error, world axes [m]", [1.0, 0.5, 0.0])
    velocity_noise: NonNegative = default(0.0, "standard deviation along each axis [m/s]", 0.05)
    resolution: NonNegative = default(0.0, "step of the positions; 0: none [m]", 0.01)

    position: Vector3 = POSITION

    @property
    def position_resolution(self) -> float:
        """Step of the positions, m."""
        return self.resolution


class BarometerTable(InstrumentTable):
    """Altitude from air pressure."""

    table_name = "sensors.barometer"
    model_config = example(rate=50.0, noise=0.1)
    quantities = (("", 1),)
    columns: ClassVar[Mapping[str, str]] = {"barometer_altitude": "m"}

    noise: NonNegative = default(0.0, "standard deviation [m]", 0.1)
    random_walk: NonNegative = default(0.0, "of the bias, as weather drifts [m/sqrt(s)]", 0.01)
    bias: float = default(0.0, "constant error [m]", 0.5)
    resolution: NonNegative = default(0.0, "step of the readings; 0: none [m]", 0.01)

    position: Vector3 = POSITION


class MagnetometerTable(InstrumentTable):
    """The direction of the Earth's field, in body axes; a unit vector without errors."""

    table_name = "sensors.magnetometer"
    model_config = example(rate=50.0, noise=0.01)
    columns: ClassVar[Mapping[str, str]] = {f"magnetometer_{axis}": "1" for axis in "xyz"}

    noise: NonNegative = default(
        0.0, "standard deviation on each axis, of the field's size [-]", 0.01
    )
    bias: Vector3 = default(ZEROS, "of magnets on board, of the field's size [-]", [0.02, 0, 0])
    resolution: NonNegative = default(0.0, "step of the readings; 0: none [-]", 0.003)
    inclination: Annotated[float, Field(ge=-1.55, le=1.55)] = default(
        1.1, "of the field below the horizon, along x of the world [rad]"
    )

    orientation: Angles3 = ORIENTATION

    @property
    def field(self) -> tuple[float, float, float]:
        """Direction of the field, a unit vector in world axes."""
        return cos(self.inclination), 0.0, -sin(self.inclination)


class RotorSpeedTable(InstrumentTable):
    """Speeds of the rotors along their spin, as speed controllers report them."""

    table_name = "sensors.rotor_speed"
    model_config = example(rate=100.0, noise=2.0)
    quantities = (("", 0),)
    columns: ClassVar[Mapping[str, str]] = {"rotor_speed_measured_#": "rad/s"}

    noise: NonNegative = default(0.0, "standard deviation [rad/s]", 2.0)
    bias: float = default(0.0, "constant error [rad/s]", 1.0)
    resolution: NonNegative = default(0.0, "step of the readings; 0: none [rad/s]", 0.5)


class InstrumentTables(Table):
    """The keys of ``[sensors]`` that are instruments, in the order of their readings."""

    imu: ImuTable | None = default(None, "accelerometer and gyro")
    mocap: MocapTable | None = default(None, "motion capture")
    gps: GpsTable | None = default(None, "position and velocity from satellites")
    barometer: BarometerTable | None = default(None, "altitude from air pressure")
    magnetometer: MagnetometerTable | None = default(None, "direction of the field")
    rotor_speed: RotorSpeedTable | None = default(None, "speeds of the rotors")

    @property
    def instruments(self) -> dict[str, InstrumentTable]:
        """The instruments on the vehicle, by name."""
        found = {name: getattr(self, name) for name in InstrumentTables.model_fields}
        return {name: table for name, table in found.items() if table is not None}


def check_instruments(scenario: Any) -> None:
    """Refuse instruments that a flight cannot read, and an estimator that lacks some."""
    found, sensors, controller = scenario.sensors.instruments, scenario.sensors, scenario.controller
    planar, step = scenario.vehicle.is_planar, scenario.simulation.control_timestep
    if controller.estimator is not None:
        key = "controller.estimator"
        if controller.is_external or planar:
            scenario.refuse(key, "needs a law of a rotorcraft other than python; remove it")
        if "imu" not in found or not {"mocap", "gps"} & {*found}:
            scenario.refuse(key, "needs [sensors.imu], and [sensors.mocap] or [sensors.gps]")
        if sensors.have_errors:
            scenario.refuse(
                key, "reads instruments; remove noise and bias keys of [sensors] itself"
            )
    if not found:
        return
    first = f"sensors.{next(iter(found))}"
    if planar:
        scenario.refuse(first, f"the {scenario.vehicle.model} has no instruments; remove it")
    if controller.is_external:
        choice = 'choose controller.law = "numpy", or remove it'
        scenario.refuse(first, f"a Python controller observes the state, not readings; {choice}")
    if scenario.has_contacts:
        others = "[ground], [[object]], [tool], [payload] and [[companion]]"
        scenario.refuse(first, f"does not sense contacts; remove it, or {others}")
    if step == 0.0:
        reason = f"[{first}] is read at control steps; must be above 0"
        scenario.refuse("simulation.control_timestep", reason)
    for name, table in found.items():
        period = table.period(step)
        if period < step * (1.0 - 1e-9):
            reason = f"at most {1.0 / step:g}, one reading each simulation.control_timestep"
            scenario.refuse(f"sensors.{name}.rate", reason)
        if table.delay > (latest := MOST_UNDER_WAY * period):
            scenario.refuse(
                f"sensors.{name}.delay", f"at most {MOST_UNDER_WAY} readings late, {latest:g}"
            )
    if sensors.imu is not None and any(sensors.imu.position) and controller.commands_tilts:
        reason = "must be zero for a law that commands the tilts, which turn the body themselves"
        scenario.refuse("sensors.imu.position", reason)
