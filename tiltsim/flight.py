"""A flight: what was observed, sample by sample, and all that follows from it.

The samples hold the vehicle's state; references, thrusts and singularity margins are derived from
them with the same functions that the control law uses. One `Flight` feeds metrics, files, plots
and Rerun.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
import numpy.typing as npt

from controllers.attitude_altitude import STATE_FIELDS, attitude_reference
from controllers.decoupling_matrix import sines_and_cosines, torque_entries
from controllers.gaits import tilt_reference
from controllers.references import position_reference
from controllers.singularity import determinant, margin_over_gait
from controllers.vehicle import SPIN, drag_ratio
from tiltsim.parameters import control_setup

if TYPE_CHECKING:
    import pyarrow

    from tiltsim.engine import EngineName
    from tiltsim.parameters import ControlSetup
    from tiltsim.scenario import Scenario

Floats = npt.NDArray[np.float64]

SAMPLE_FIELDS: Final = (
    "time",
    *STATE_FIELDS,
    *(f"alpha_rate_{rotor}" for rotor in (1, 2, 3, 4)),
)
"""What a recorded sample holds, in order."""

TILTS: Final = slice(SAMPLE_FIELDS.index("alpha_1"), SAMPLE_FIELDS.index("alpha_4") + 1)
ROTOR_SPEEDS: Final = slice(
    SAMPLE_FIELDS.index("rotor_speed_1"), SAMPLE_FIELDS.index("rotor_speed_4") + 1
)

_FOUR: Final = (1, 2, 3, 4)
COLUMN_UNITS: Final = {
    "time": "s",
    **dict.fromkeys(("x", "y", "z"), "m"),
    **dict.fromkeys(("vx", "vy", "vz"), "m/s"),
    **dict.fromkeys(("roll", "pitch", "yaw"), "rad"),
    **dict.fromkeys(("p", "q", "r"), "rad/s"),
    **{f"alpha_{i}": "rad" for i in _FOUR},
    **{f"alpha_ref_{i}": "rad" for i in _FOUR},
    **{f"alpha_rate_{i}": "rad/s" for i in _FOUR},
    **{f"rotor_speed_{i}": "rad/s" for i in _FOUR},
    **{f"thrust_{i}": "N" for i in _FOUR},
    **dict.fromkeys(("x_ref", "y_ref", "z_ref"), "m"),
    **dict.fromkeys(("roll_ref", "pitch_ref", "yaw_ref"), "rad"),
    "singularity_margin": "rad",
    "determinant": "1",
}
"""Columns of a flight and their units, in the order of the file."""


EndKind = Literal["completed", "diverged", "singular", "interrupted"]


@dataclass(frozen=True)
class End:
    """How a flight ended: ``kind``, when (s), and in words why."""

    kind: EndKind
    time: float
    cause: str = ""


@dataclass(frozen=True)
class Flight:
    """The record of one flight."""

    scenario: Scenario
    samples: Floats  # (N, len(SAMPLE_FIELDS))
    end: End
    engine: EngineName
    wall_time: float  # s, integration alone

    def __post_init__(self) -> None:
        self.samples.setflags(write=False)  # what is derived from them is kept

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.samples)

    def __getitem__(self, column: str) -> Floats:
        """A column by name, shape (N,); see `COLUMN_UNITS`."""
        return self.columns[column]

    @cached_property
    def columns(self) -> dict[str, Floats]:
        """All columns by name, each of shape (N,), in the order of `COLUMN_UNITS`."""
        known = dict(zip(SAMPLE_FIELDS, self.samples.T, strict=True))
        setup = control_setup(self.scenario)
        law = setup.parameters.law
        known |= _references(self.samples, setup)
        speeds = [known[f"rotor_speed_{i}"] for i in _FOUR]
        for i, sign, speed in zip(_FOUR, SPIN, speeds, strict=True):
            known[f"thrust_{i}"] = law.vehicle.thrust_coefficient * sign * speed * np.abs(speed)
        tilts, attitude = self.samples[:, TILTS], (known["roll"], known["pitch"])
        known["singularity_margin"] = margin_over_gait(tilts, law.vehicle, *attitude)
        known["determinant"] = determinant(tilts, *attitude, law.vehicle)
        return {name: known[name] for name in COLUMN_UNITS}

    @cached_property
    def _metrics(self) -> dict[str, float | bool]:
        from tiltsim.metrics import compute_metrics

        return compute_metrics(self)

    def metrics(self) -> dict[str, float | bool]:
        """The flight in numbers; names and meanings in `tiltsim.metrics.METRICS`."""
        return dict(self._metrics)

    def to_arrow(self) -> pyarrow.Table:
        """The flight as an Arrow table: units in the fields' metadata, origin in the schema's."""
        import pyarrow as pa

        fields = [
            pa.field(name, pa.float64(), nullable=False, metadata={"unit": unit})
            for name, unit in COLUMN_UNITS.items()
        ]
        schema = pa.schema(fields, metadata=self.origin())
        return pa.table([self.columns[name] for name in COLUMN_UNITS], schema=schema)

    def origin(self) -> dict[str, str]:
        """Where the flight comes from: scenario (JSON), versions, seed, engine, end, wall time."""
        return {
            "scenario": self.scenario.model_dump_json(),
            "address": self.scenario.address,
            "seed": str(self.scenario.simulation.seed),
            "engine": self.engine,
            "wall_time": repr(self.wall_time),
            "end": self.end.kind,
            "end_time": repr(self.end.time),
            "cause": self.end.cause,
            **{f"{name}_version": version(name) for name in ("tiltsim", "mujoco", "numpy")},
        }

    def save(self, folder: str | Path) -> None:
        """Write metrics.json, flight.parquet and the resolved scenario.toml into a folder."""
        from tiltsim.files import save_flight

        save_flight(self, Path(folder))


def _references(samples: Floats, setup: ControlSetup) -> dict[str, Floats]:
    """Reference columns: what the law aimed at, sample by sample."""
    law, table = setup.parameters.law, setup.table
    rows = []
    ratio = drag_ratio(law.vehicle)
    for sample in samples.tolist():
        time, state = sample[0], sample[1:]
        trig = sines_and_cosines(*sample[TILTS])
        position = position_reference(time, law.reference)[:3]
        torque = torque_entries(trig, ratio)
        attitude = attitude_reference(time, state, trig, torque, law)[:3]
        rows.append((*position, *attitude, *tilt_reference(time, law.gait, table)[:4]))
    names = ("x_ref", "y_ref", "z_ref", "roll_ref", "pitch_ref", "yaw_ref")
    tilts = tuple(f"alpha_ref_{i}" for i in _FOUR)
    values = np.array(rows).reshape(len(rows), len(names) + len(tilts))
    return dict(zip((*names, *tilts), values.T, strict=True))
