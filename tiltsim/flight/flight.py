"""A flight: its recorded samples, and the columns and metrics derived from them.

The samples hold the vehicle's state; references, thrusts and singularity margins are derived from
them with the same functions that the control law uses. One `Flight` feeds metrics, files, figures
and Rerun.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from tiltsim.flight.metrics import compute_metrics
from tiltsim.flight.writing import write_flight
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.messages import did_you_mean
from tiltsim.system.text import valid_unicode
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    import pyarrow

    from tiltsim.closed_loop.assembly import Assembly
    from tiltsim.engines.base import EngineName
    from tiltsim.flight.end import End
    from tiltsim.scenario.scenario import Scenario


def _overflow_ignored() -> np.errstate:
    """For arithmetic with the last sample of a diverged flight, whose squares may overflow."""
    return np.errstate(over="ignore", invalid="ignore")


@dataclass(frozen=True, repr=False)
class Flight:
    """The record of one flight; it pickles without its assembly, which is then built anew."""

    assembly: Assembly
    samples: Floats  # (N, len(assembly.loop.sample_fields))
    end: End
    engine: EngineName
    wall_time: float  # s, integration alone

    def __post_init__(self) -> None:
        self.samples.setflags(write=False)  # derived columns are cached

    @classmethod
    def of_scenario(
        cls, scenario: Scenario, samples: Floats, end: End, engine: EngineName, wall_time: float
    ) -> Self:
        """A flight of a scenario that is assembled here.

        Args:
            scenario: what was flown
            samples, end, engine, wall_time: fields of the flight
        """
        return cls(assemble(scenario), samples, end, engine, wall_time)

    def __reduce__(self) -> tuple[object, ...]:
        fields = (self.scenario, self.samples, self.end, self.engine, self.wall_time)
        return type(self).of_scenario, fields

    @property
    def scenario(self) -> Scenario:
        """The scenario of the flight."""
        return self.assembly.scenario

    def __repr__(self) -> str:
        """The scenario and the end, in one line."""
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
        return self.assembly.loop.units

    @cached_property
    def columns(self) -> dict[str, Floats]:
        """All columns by name, each of shape (N,), in the order of `units`."""
        loop = self.assembly.loop
        known = dict(zip(loop.sample_fields, self.samples.T, strict=True))
        with _overflow_ignored():
            known |= loop.columns.derive(known, self.assembly.setup)
            known |= loop.kind.thrusts(known, self.scenario)
        return {name: known[name] for name in self.units}

    @cached_property
    def _metrics(self) -> dict[str, float | bool]:
        with _overflow_ignored():
            return compute_metrics(self.columns, self.assembly, self.end, self.wall_time)

    def metrics(self) -> dict[str, float | bool]:
        """The metrics of the flight by name; see `tiltsim.scenario.metric_names.METRICS`."""
        return dict(self._metrics)

    def to_arrow(self) -> pyarrow.Table:
        """The columns as an Arrow table; units and `origin` are its metadata."""
        import pyarrow as pa

        fields = [
            pa.field(name, pa.float64(), nullable=False, metadata={"unit": unit})
            for name, unit in self.units.items()
        ]
        schema = pa.schema(fields, metadata=self.origin())
        return pa.table(list(self.columns.values()), schema=schema)

    def origin(self) -> dict[str, str]:
        """The metadata of the file: scenario (JSON), versions, seed, engine, end, wall time (s)."""
        texts = {
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
        return {key: valid_unicode(text) for key, text in texts.items()}

    def save(self, folder: str | Path) -> None:
        """Write metrics.json, flight.parquet and the resolved scenario.toml into a folder.

        Raises `InputError` if that is impossible, or would replace a scenario or a controller that
        tiltsim did not write.
        """
        write_flight(Path(folder), self.to_arrow(), self.metrics(), self.scenario)
