"""A log: columns over time in tiltsim's names, units and frames, from a flight or a real vehicle.

World axes have z up, body axes x forward, y left, z up (FLU); attitudes are roll, pitch and yaw of
the rotation from body to world. Dropouts are NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.spatial.transform import Rotation

from tiltsim.errors import InputError
from tiltsim.flight.flight import ColumnsOverTime
from tiltsim.flight.writing import FLIGHT
from tiltsim.models.vehicle_parts import MAX_ROTORS
from tiltsim.system.files import is_file, is_folder, prepare_folder, replacing
from tiltsim.system.parquet import open_parquet, parquet_bytes
from tiltsim.vehicles.rotorcraft import Layout, rotorcraft_columns
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    import pyarrow

    from tiltsim.flight.flight import Flight

_FLIGHT: Final = rotorcraft_columns(Layout(MAX_ROTORS, MAX_ROTORS))
COMMANDS: Final = {"rotor_speed": "rotor_command", "alpha": "alpha_command"}
UNITS: Final = {
    **{name: known.unit for name, known in _FLIGHT.items()},
    **{f"accelerometer_{axis}": "m/s^2" for axis in "xyz"},
    **{
        f"{command}_{number}": _FLIGHT[f"{name}_{number}"].unit
        for name, command in COMMANDS.items()
        for number in range(1, MAX_ROTORS + 1)
    },
}
"""Columns of a log of a real vehicle and their units; a flight has more."""

LOG_SUFFIXES: Final = (".mcap", ".ulg", ".ulog", ".csv")
"""Suffixes of files in the formats of other tools."""


@dataclass(frozen=True, repr=False)
class Log(ColumnsOverTime):
    """Columns over time, each of shape (N,), with their units."""

    name: str
    columns: dict[str, Floats]
    units: dict[str, str]
    notes: tuple[str, ...] = ()  # one line for each defect that was found while reading
    origin: Mapping[str, str] = field(default_factory=dict)  # of a flight: `Flight.origin`

    @classmethod
    def of_flight(cls, flight: Flight) -> Log:
        """The columns of a flight of tiltsim."""
        name = flight.scenario.address or flight.scenario.title
        return cls(name, flight.columns, flight.units, (), flight.origin())

    def __repr__(self) -> str:
        """Duration, samples and columns, in one line."""
        size = f"{self.duration:g} s, {len(self)} samples of {len(self.units)} columns"
        return f"<Log of {self.name}: {size}>"

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.columns["time"])

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.columns["time"][-1] - self.columns["time"][0])

    def quaternions(self, kind: str = "attitude") -> Floats:
        """Rotations from body to world, w x y z, shape (N, 4), of a vector of angles (rad)."""
        angles = self[kind]
        finite = np.isfinite(angles).all(axis=1)
        turns = np.full((len(self), 4), np.nan)
        turns[finite] = Rotation.from_euler("ZYX", angles[finite, ::-1]).as_quat()[:, [3, 0, 1, 2]]
        return turns

    def to_arrow(self) -> pyarrow.Table:
        """The columns as an Arrow table with units and `origin` as metadata."""
        return self.arrow_table(self.origin or {"log": self.name})

    def save(self, folder: str | PathLike[str]) -> None:
        """Write the log into a folder as flight.parquet; as a whole flight if tiltsim flew it.

        Raises `InputError` if that is impossible or would replace a file of another kind.
        """
        folder = Path(folder)
        if self.origin:
            from tiltsim.flight.reading import flight_of_table

            flight_of_table(self.to_arrow(), Path(self.name)).save(folder)
            return
        prepare_folder(folder)
        file = folder / FLIGHT
        if file.exists() and not is_log(file):
            raise InputError(f"{file}: exists and is not an imported log; choose another folder")
        with replacing(file) as temporary:
            temporary.write_bytes(parquet_bytes(self.to_arrow()))


def is_log(path: Path) -> bool:
    """Whether a path is a log of another format, or an imported one."""
    file = path / FLIGHT if is_folder(path) else path
    if file.suffix.lower() != ".parquet" or not is_file(file):
        return file.suffix.lower() in LOG_SUFFIXES
    with open_parquet(file) as opened:
        return b"log" in (opened.schema_arrow.metadata or {})
