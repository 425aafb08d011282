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
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.flight.end import End
from tiltsim.laws.assembling import control_setup, loop_of
from tiltsim.scenario.messages import did_you_mean
from tiltsim.vehicles.rotorcraft import COLUMN_UNITS as COLUMN_UNITS
from tiltsim.vehicles.rotorcraft import OBSERVED_FIELDS
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    import pyarrow

    from tiltsim.engines.base import EngineName
    from tiltsim.scenario.scenario import Scenario

SAMPLE_FIELDS: Final = ("time", *OBSERVED_FIELDS)
"""What a recorded sample of any rotorcraft begins with; a law's own states follow."""


def _far_out() -> np.errstate:
    """For arithmetic with a last sample that may lie beyond what squares of floats can hold."""
    return np.errstate(over="ignore", invalid="ignore")


@dataclass(frozen=True, repr=False)
class Flight:
    """The record of one flight."""

    scenario: Scenario
    samples: Floats  # (N, len(loop.sample_fields))
    end: End
    engine: EngineName
    wall_time: float  # s, integration alone

    def __post_init__(self) -> None:
        self.samples.setflags(write=False)  # what is derived from them is kept

    def __repr__(self) -> str:
        """One line: what was flown, and how it ended."""
        name = self.scenario.address or self.scenario.title
        end = f"{self.end.kind} at {self.end.time:g} s"
        return f"<Flight of {name}: {end}, {len(self)} samples of {len(self.units)} columns>"

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.samples)

    def __getitem__(self, column: str) -> Floats:
        """A column by name, shape (N,); see `units`."""
        if column not in self.units:
            hint = did_you_mean(column, self.units)
            raise KeyError(f"{column!r}: no column of this flight; {hint}see Flight.units")
        return self.columns[column]

    @cached_property
    def units(self) -> dict[str, str]:
        """The columns of this flight and their units, in order."""
        return loop_of(self.scenario).units

    @cached_property
    def columns(self) -> dict[str, Floats]:
        """All columns by name, each of shape (N,), in the order of `units`."""
        loop = loop_of(self.scenario)
        known = dict(zip(loop.sample_fields, self.samples.T, strict=True))
        with _far_out():
            known |= loop.derive(known, control_setup(self.scenario))
            known |= loop.kind.thrusts(known, self.scenario)
        return {name: known[name] for name in self.units}

    @cached_property
    def _metrics(self) -> dict[str, float | bool]:
        from tiltsim.flight.metrics import compute_metrics

        with _far_out():
            return compute_metrics(self)

    def metrics(self) -> dict[str, float | bool]:
        """The flight in numbers; names and meanings in `tiltsim.scenario.metric_names.METRICS`."""
        return dict(self._metrics)

    def to_arrow(self) -> pyarrow.Table:
        """The flight as an Arrow table: units in the fields' metadata, origin in the schema's."""
        import pyarrow as pa

        fields = [
            pa.field(name, pa.float64(), nullable=False, metadata={"unit": unit})
            for name, unit in self.units.items()
        ]
        schema = pa.schema(fields, metadata=self.origin())
        return pa.table(list(self.columns.values()), schema=schema)

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
        from tiltsim.flight.writing import save_flight

        save_flight(self, Path(folder))
