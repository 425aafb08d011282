"""A flight: its recorded samples, and the columns and metrics derived from them.

The samples hold the vehicle's state; references, thrusts and singularity margins are derived from
them with the same functions that the control law uses. One `Flight` feeds metrics, files, figures
and Rerun.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.flight.metrics import End, Metrics, compute_metrics, metrics_of_rows
from tiltsim.flight.writing import write_flight
from tiltsim.laws.assembling import assemble
from tiltsim.models.vehicle_parts import MAX_ROTORS
from tiltsim.scenario.messages import choose, did_you_mean
from tiltsim.scenario.metric_names import WALL_CLOCK_METRICS, unit_of
from tiltsim.system.public import optional_package, public
from tiltsim.system.text import html_table, short_repr, shortened, valid_unicode
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    import pyarrow

    from tiltsim.scenario.scenario import Scenario


def _each_rotor(name: str) -> tuple[str, ...]:
    return tuple(f"{name}_{rotor}" for rotor in range(1, MAX_ROTORS + 1))


VECTORS: Final = {
    "position": ("x", "y", "z"),
    "velocity": ("vx", "vy", "vz"),
    "attitude": ("roll", "pitch", "yaw"),
    "body_rates": ("p", "q", "r"),
    "tilt_angles": _each_rotor("alpha"),
    "tilt_rates": _each_rotor("alpha_rate"),
    "rotor_speeds": _each_rotor("rotor_speed"),
    "thrusts": _each_rotor("thrust"),
    "reference_position": ("x_ref", "y_ref", "z_ref"),
    "reference_attitude": ("roll_ref", "pitch_ref", "yaw_ref"),
    "reference_tilt_angles": _each_rotor("alpha_ref"),
}
"""Vectors by name and their components; a vehicle in a plane has some of them."""


FIRST: Final = "first vehicle"
"""Name of the vehicle of the scenario itself among `Flight.vehicles`."""


def components(name: str, columns: Iterable[str]) -> list[str]:
    """The columns of a flight that make a vector, in its order; empty if there are none.

    Args:
        name: The vector, for a companion after its name, such as ``wing_position``.
        columns: All columns of the flight.
    """
    present, own = {*columns}, name if name in VECTORS else ""
    own = own or next((vector for vector in VECTORS if name.endswith(f"_{vector}")), "")
    prefix = name.removesuffix(own)
    return [prefix + part for part in VECTORS.get(own, ()) if prefix + part in present]


class UnknownColumnError(InputError, KeyError):
    """A flight or log has no column or vector of a name."""

    __str__ = Exception.__str__  # a KeyError shows its message in quotes


class ColumnsOverTime:
    """Columns by name, each of shape (N,), and their units: a flight, or the log of another tool.

    It iterates over the names of the columns, as a dict does.
    """

    if TYPE_CHECKING:

        @property
        def columns(self) -> dict[str, Floats]: ...

        @property
        def units(self) -> dict[str, str]: ...

    def __iter__(self) -> Iterator[str]:
        return iter(self.units)

    def __contains__(self, name: object) -> bool:
        """Whether there is a column or vector of this name."""
        return isinstance(name, str) and (name in self.units or bool(components(name, self.units)))

    def __getitem__(self, name: str) -> Floats:
        """A column by name, shape (N,); or a vector of `VECTORS`, shape (N, components).

        ``flight["x"]`` and ``flight["position"]``, both in the units of `units`. Raises
        `UnknownColumnError` for other names.
        """
        known = isinstance(name, str)
        if known and name in self.units:
            return self.columns[name]
        columns = components(name, self.units) if known else []
        if not columns:
            vectors = [vector for vector in VECTORS if components(vector, self.units)]
            hint, kind = did_you_mean(name, [*self.units, *vectors]), type(self).__name__
            raise UnknownColumnError(
                f"{short_repr(name)}: no column of this {kind.lower()}; {hint}see {kind}.units, or "
                f"the vectors {', '.join(vectors)}"
            )
        return np.stack([self.columns[column] for column in columns], axis=-1)

    def to_pandas(self) -> Any:
        """The columns as a pandas DataFrame, whose ``attrs["units"]`` are `units`.

        Raises `InputError` if pandas is not installed.
        """
        pandas = optional_package("pandas", f"{type(self).__name__}.to_pandas")
        frame = pandas.DataFrame(dict(self.columns))
        frame.attrs["units"] = dict(self.units)
        return frame

    def arrow_table(self, metadata: Mapping[str, str]) -> pyarrow.Table:
        """The columns as an Arrow table with units and further metadata."""
        import pyarrow as pa

        fields = [
            pa.field(name, pa.float64(), nullable=False, metadata={"unit": unit})
            for name, unit in self.units.items()
        ]
        # From their bytes, as converting an array would import pandas where it is installed.
        columns = [np.ascontiguousarray(self.columns[name]) for name in self.units]
        memory = [(len(column), [None, pa.py_buffer(column)]) for column in columns]
        arrays = [pa.Array.from_buffers(pa.float64(), *one) for one in memory]
        return pa.table(arrays, schema=pa.schema(fields, metadata=dict(metadata)))


def _overflow_ignored() -> np.errstate:
    """For arithmetic with the last sample of a diverged flight, whose squares may overflow."""
    return np.errstate(over="ignore", invalid="ignore")


@dataclass(frozen=True, repr=False)
class Flight(ColumnsOverTime):
    """The record of one flight; it pickles without its assembly, which is then built again."""

    assembly: Assembly
    samples: Floats  # (N, len(assembly.loop.sample_fields))
    end: End
    engine: EngineName
    wall_time: float  # s, integration alone
    shared_metrics: Callable[[], Metrics | None] = lambda: None  # computed with other flights'

    def __post_init__(self) -> None:
        self.samples.setflags(write=False)  # derived columns are cached

    @classmethod
    def of_scenario(
        cls, scenario: Scenario, samples: Floats, end: End, engine: EngineName, wall_time: float
    ) -> Self:
        """A recorded flight of a scenario that is assembled here, without executing its code.

        Args:
            scenario: the scenario flown
            samples, end, engine, wall_time: fields of the flight
        """
        return cls(assemble(scenario, recorded=True), samples, end, engine, wall_time)

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
        cause = f" ({shortened(self.end.cause)})" if self.end.cause else ""
        end = f"{self.end.kind} at {self.end.time:g} s{cause}"
        return f"<Flight of {name}: {end}, {len(self)} samples of {len(self.units)} columns>"

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.samples)

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
            known |= loop.derive(known, self.assembly.setup)
            known |= loop.kind.thrusts(known, self.scenario)
        return {name: known[name] for name in self.units}

    @cached_property
    def vehicles(self) -> dict[str, Flight]:
        """The vehicles of this world by name: this flight as `FIRST`, and every companion's.

        A companion's flight has the columns and metrics of a vehicle alone, without a prefix.
        """
        fields = [*self.assembly.loop.sample_fields]
        (first, _), *others = vehicle_assemblies(self.assembly).items()
        found = {first: self}
        for name, assembly in others:
            needed = ("time", *(f"{name}_{field}" for field in assembly.loop.sample_fields[1:]))
            samples = self.samples[:, [fields.index(column) for column in needed]]
            found[name] = Flight(assembly, samples, self.end, self.engine, self.wall_time)
        return found

    @cached_property
    def _metrics(self) -> Metrics:
        with _overflow_ignored():
            known = self.shared_metrics()
            if known is None:
                known = compute_metrics(self.columns, self.assembly, self.end, self.wall_time)
            others = {name: one._metrics for name, one in self.vehicles.items() if name != FIRST}
            return Metrics(known, others)

    def metrics(self) -> Metrics:
        """The metrics of the flight by name; see `tiltsim.scenario.metric_names.METRICS`.

        A companion's are found by its name and theirs, such as ``wing.max_rotor_speed``.
        """
        return Metrics(self._metrics, self._metrics.vehicles)

    def plot(self, panels: str | Sequence[str] = (), **options: Any) -> Any:
        """A matplotlib Figure of this flight; see `tiltsim.plot` for the options."""
        return public("plot")([self], panels=panels, **options)

    def view(self, *, url: str | None = None) -> Any:
        """Show this flight in Rerun: in the notebook if it runs in one; see `tiltsim.view`."""
        return public("view")([self], url=url)

    def video(self, path: str | PathLike[str], **options: Any) -> Any:
        """Render this flight as a video; see `tiltsim.video` for the options."""
        return public("video")(self, path, **options)

    def to_mcap(self, path: str | PathLike[str]) -> None:
        """Write this flight as MCAP, for Foxglove and ROS 2; see `tiltsim.export`."""
        public("export")(self, path, "mcap")

    def to_ulog(self, path: str | PathLike[str]) -> None:
        """Write this flight as ULog, for PlotJuggler and PX4's tools; see `tiltsim.export`."""
        public("export")(self, path, "ulog")

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write this flight as CSV with all digits; see `tiltsim.export`."""
        public("export")(self, path, "csv")

    def _repr_html_(self) -> str:
        """The end of the flight and its metrics, as a table for notebooks."""
        scenario, end = self.scenario, self.end
        how = f"{end.kind} at {end.time:g} s" + (f": {end.cause}" if end.cause else "")
        size = f"{len(self)} samples of {len(self.units)} columns"
        metrics = self.metrics().of_all_vehicles().items()
        rows = [(name, f"{value:.6g}", unit_of(name)) for name, value in metrics]
        lines = [scenario.address, how, size]
        return html_table(scenario.title or "Flight", lines, rows, ("metric", "value", "unit"))

    def to_arrow(self) -> pyarrow.Table:
        """The columns as an Arrow table; units and `origin` are its metadata."""
        return self.arrow_table(self.origin())

    def origin(self) -> dict[str, str]:
        """The metadata of the file: scenario (JSON), versions, seed, engine, end, wall time (s)."""
        tables = {name: table.in_scenario() for name, table in self.scenario.time_tables.items()}
        texts = {
            "scenario": self.scenario.model_copy(update=tables).model_dump_json(),
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

    def save(self, folder: str | PathLike[str]) -> None:
        """Write metrics.json, flight.parquet and the resolved scenario.toml into a folder.

        Raises `InputError` if that is impossible, or would replace a scenario or a controller that
        tiltsim did not write.
        """
        if not isinstance(folder, str | PathLike):
            raise InputError(f"folder = {short_repr(folder)}: must be the name of a folder")
        metrics: dict[str, Any] = dict(self.metrics())
        if others := self.metrics().vehicles:
            metrics["vehicles"] = {
                name: {key: value for key, value in own.items() if key not in WALL_CLOCK_METRICS}
                for name, own in others.items()
            }
        write_flight(Path(folder), self.to_arrow(), metrics, self.scenario)


def vehicle_assemblies(assembly: Assembly) -> dict[str, Assembly]:
    """The assembly of each vehicle of a world by its name, the first one's as `FIRST`."""
    names = (table.name for table in assembly.scenario.companion)
    others = (assemble(own, recorded=True) for own in assembly.scenario.companions)
    return {FIRST: assembly, **dict(zip(names, others, strict=True))}


def vehicles_named(vehicle: str, flights: Sequence[Flight]) -> list[Flight]:
    """The flight of the vehicle with this name in every one of some flights; all if it is empty.

    Raises:
        InputError: If one has no vehicle of the name.
    """
    for flight in flights if vehicle else ():
        if vehicle not in flight.vehicles:
            name = flight.scenario.address or "the flight"
            known = choose(vehicle, flight.vehicles)
            raise InputError(f"vehicle {short_repr(vehicle)}: not in {name}; {known}")
    return [flight.vehicles[vehicle] if vehicle else flight for flight in flights]


def as_flights(flights: Flight | Sequence[Flight]) -> list[Flight]:
    """An argument that is one flight or several as a list. Raises `InputError` if it is neither."""
    several = [flights] if isinstance(flights, Flight) else flights
    known = isinstance(several, list | tuple) and all(isinstance(f, Flight) for f in several)
    if not known or not several:
        allowed = "must be a tiltsim.Flight or a list of them"
        raise InputError(f"flights = {short_repr(flights)}: {allowed}")
    return [*several]


METRICS_ROWS: Final = 128
"""Flights whose metrics are computed together: they fit into the caches of a core."""


def completed_flights(
    assemblies: Sequence[Assembly],
    numbers: Floats,
    samples: Floats,
    engine: EngineName,
    seconds: Sequence[float],
) -> list[Flight]:
    """Flights of one closed loop that were flown to the end of their duration.

    Args:
        assemblies: One per flight.
        numbers: Parameters of their loops, shape (flights, numbers), as `flatten` returns them.
        samples: Shape (flights, N, fields), at the same times.
        engine: That flew them.
        seconds: Time that each took.

    Returns:
        The flights; the metrics of all of them are computed when the first is requested.
    """
    if not assemblies:
        return []
    end = End("completed", float(samples[0, -1, 0]))

    @cache
    def together() -> list[Metrics] | None:
        if len({assembly.setup.knots for assembly in assemblies}) > 1 or len(assemblies) < 2:
            return None
        return metrics_of_rows(assemblies, numbers, samples, end, seconds)

    def metrics_of(place: int) -> Metrics | None:
        found = together()
        return None if found is None else found[place]

    return [
        Flight(assembly, own, end, engine, time, lambda place=place: metrics_of(place))  # type: ignore[misc]
        for place, (assembly, own, time) in enumerate(zip(assemblies, samples, seconds))
    ]
