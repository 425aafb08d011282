"""Maps from the signals of a log to tiltsim's columns: a TOML file, and the map of PX4's topics."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Final, Literal

from pydantic import Field, ValidationError

from tiltsim.errors import InputError
from tiltsim.logs.log import UNITS
from tiltsim.scenario.limits import read_text
from tiltsim.scenario.messages import choose, one_line_message
from tiltsim.scenario.table import NotTiny, Table
from tiltsim.system.files import is_file


class Signal(Table):
    """A signal of the log, times a scale, plus an offset."""

    signal: str = Field(description="name in the log, such as actuator_motors.control[0]")
    scale: float = Field(1.0, description="factor to tiltsim's unit")
    offset: float = Field(0.0, description="added after the factor, in tiltsim's unit")


class LogMap(Table):
    """Where the columns of a log come from, and its frames."""

    world: Literal["z_up", "ned"] = Field(
        "z_up", description="axes of position and velocity: z up, or north, east, down"
    )
    body: Literal["flu", "frd"] = Field(
        "flu",
        description="axes of body rates and accelerations: forward, left, up, or "
        "forward, right, down",
    )
    attitude: tuple[str, ...] = Field(
        (),
        strict=False,
        description="signals of the rotation from body to world: four of a quaternion, w x y z, "
        "or three of roll, pitch and yaw in rad",
    )
    max_gap: NotTiny = Field(
        0.2, description="longest time between samples of a signal that is interpolated [s]"
    )
    columns: dict[str, str | Signal] = Field(
        default_factory=dict,
        description="a signal, or a table of signal, scale and offset, for each column",
    )

    def _check_values(self) -> None:
        if len(self.attitude) not in {0, 3, 4}:
            allowed = "three signals (roll, pitch, yaw) or four (w, x, y, z)"
            raise self.mistake("attitude", allowed)
        angles = {"roll", "pitch", "yaw"} & {*self.columns}
        if angles:
            raise self.mistake("columns", f"give {min(angles)} by the key attitude")
        for name in self.columns:
            if name not in UNITS or name == "time":
                raise self.mistake("columns", f"column {name!r} is unknown; {choose(name, UNITS)}")


PX4: Final = LogMap(
    world="ned",
    body="frd",
    attitude=tuple(f"vehicle_attitude.q[{i}]" for i in range(4)),
    columns={
        **{axis: f"vehicle_local_position.{axis}" for axis in ("x", "y", "z", "vx", "vy", "vz")},
        **{rate: f"vehicle_angular_velocity.xyz[{i}]" for i, rate in enumerate("pqr")},
        **{
            f"accelerometer_{axis}": f"sensor_combined.accelerometer_m_s2[{i}]"
            for i, axis in enumerate("xyz")
        },
        **{f"rotor_command_{i + 1}": f"actuator_motors.control[{i}]" for i in range(12)},
        **{f"alpha_command_{i + 1}": f"actuator_servos.control[{i}]" for i in range(8)},
    },
)
"""PX4's topics as they are; commands are fractions of full speed and of full travel."""


def read_map(file: Path) -> LogMap:
    """Read a map from a TOML file. Raises `InputError` in one line: file, key, value, allowed."""
    if not is_file(file):
        raise InputError(f"{file}: no such file")
    try:
        document = tomllib.loads(read_text(file))
        return LogMap.model_validate(document)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file}: not valid TOML: {error}") from error
    except ValidationError as error:
        raise InputError(f"{file}: {one_line_message(error, document, LogMap)}") from None
