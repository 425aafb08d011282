"""Flights on disk: metrics.json, flight.parquet and scenario.toml in one folder.

A flight reads back from flight.parquet alone: the samples are among its columns, the rest is in
the schema's metadata.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import tomli_w

from tiltsim.errors import InputError

if TYPE_CHECKING:
    import pyarrow

    from tiltsim.flight import End, Flight
    from tiltsim.scenario import Scenario


def prepare_folder(folder: Path) -> None:
    """Create a folder for results before the flight. Raises `InputError` where it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: cannot be created: {error.strerror}") from error
    if not os.access(folder, os.W_OK):
        raise InputError(f"--out {folder}: not writable")


def prepare_file(option: str, file: Path, endings: Sequence[str] = ()) -> None:
    """See that a file can be written before the work for it begins.

    Raises `InputError`, naming the command line's ``option``, where it cannot, or its name does not
    end in one of the ``endings``, where there are some (lower case, with their dots).
    """
    if endings and file.suffix.lower() not in endings:
        raise InputError(
            f"{option} {file}: unknown format {file.suffix!r}; choose {', '.join(endings)}"
        )
    folder = file.absolute().parent
    if not folder.is_dir():
        raise InputError(f"{option} {file}: its folder does not exist")
    if file.is_dir():
        raise InputError(f"{option} {file}: is a folder")
    if not os.access(file if file.exists() else folder, os.W_OK):
        raise InputError(f"{option} {file}: not writable")


def save_flight(flight: Flight, folder: Path) -> None:
    """Write a flight into a folder; each file appears whole or not at all."""
    import pyarrow.parquet as pq

    folder.mkdir(parents=True, exist_ok=True)
    with replacing(folder / "flight.parquet") as path:
        pq.write_table(flight.to_arrow(), path, compression="zstd")
    with replacing(folder / "metrics.json") as path:
        path.write_text(metrics_json(flight.metrics()), encoding="utf-8")
    scenario = with_controller_copied(flight.scenario, folder)
    with replacing(folder / "scenario.toml") as path:
        path.write_text(scenario_toml(scenario), encoding="utf-8")


def with_controller_copied(scenario: Scenario, folder: Path) -> Scenario:
    """Copy the file of a user's controller into a folder; the scenario that names the copy.

    A user's file changes more often than any other. A scenario that names no such file stays as it
    is.
    """
    from tiltsim.controller_tables import PythonController

    table = scenario.controller
    if not isinstance(table, PythonController) or table.file is None or not table.file.is_file():
        return scenario
    copy = folder / table.file.name
    if not (copy.exists() and copy.samefile(table.file)):
        with replacing(copy) as path:
            path.write_bytes(table.file.read_bytes())
    named = table.model_copy(update={"function": f"{copy.name}:{table.attribute}"})
    return scenario.model_copy(update={"controller": named})


def load_flight(path: str | Path) -> Flight:
    """Read a flight back: samples, scenario, engine, end and wall time.

    Parameters
    ----------
    path
        A folder of results or a ``flight.parquet``.

    Raises
    ------
    InputError
        If there is no such file, or it is not a whole flight of tiltsim's.
    """
    import numpy as np
    import pyarrow as pa
    import pyarrow.parquet as pq

    from tiltsim.flight import Flight
    from tiltsim.loading import parse_scenario
    from tiltsim.loops import loop_of

    file = _flight_file(Path(path))
    try:
        table = pq.read_table(file)
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{file}: not a readable Parquet file: {_first_line(error)}") from error
    origin = _origin(file, table)
    try:
        document = json.loads(origin["scenario"])
        engine, end = _engine_and_end(origin)
        wall_time = float(origin["wall_time"])
    except (KeyError, ValueError, TypeError) as error:
        raise InputError(f"{file}: not a flight of tiltsim's: {_first_line(error)}") from error
    try:
        scenario = parse_scenario(without_none(document), origin.get("address", ""))
    except InputError as error:
        raise InputError(f"{file}: its scenario is not valid: {error}") from error
    fields = loop_of(scenario).sample_fields
    missing = [name for name in fields if name not in table.column_names]
    if missing:
        raise InputError(f"{file}: not a flight of tiltsim's: no column {', '.join(missing)}")
    if len(table) == 0:
        raise InputError(f"{file}: the flight has no samples")
    try:
        samples = np.column_stack(
            [np.asarray(table[name].to_numpy(), dtype=np.float64) for name in fields]
        )
    except (ValueError, TypeError) as error:
        raise InputError(f"{file}: not a flight of tiltsim's: {_first_line(error)}") from error
    for name, values in zip(fields, samples.T, strict=True):
        if not np.isfinite(values).all():
            raise InputError(f"{file}: damaged: {name} has values that are no finite numbers")
    if (np.diff(samples[:, 0]) <= 0.0).any():
        raise InputError(f"{file}: damaged: its times do not increase")
    return Flight(scenario, samples, end, engine, wall_time)


def _flight_file(path: Path) -> Path:
    """The Parquet file that a path given by the user means."""
    file = path / "flight.parquet" if path.is_dir() else path
    if file.is_file():
        return file
    missing = "no flight.parquet in this folder" if path.is_dir() else "no such file"
    raise InputError(
        f"{path}: {missing}; give a folder that tiltsim run --out wrote, or a flight.parquet"
    )


def _origin(file: Path, table: pyarrow.Table) -> dict[str, str]:
    metadata = table.schema.metadata or {}
    if b"scenario" not in metadata:
        raise InputError(f"{file}: not a flight of tiltsim's: its metadata name no scenario")
    return {key.decode(): value.decode(errors="replace") for key, value in metadata.items()}


def _engine_and_end(origin: dict[str, str]) -> tuple[Any, End]:
    """Engine and end from the metadata. Raises `ValueError` where they are unknown."""
    from tiltsim.engine import EngineName
    from tiltsim.flight import End, EndKind

    if origin["engine"] not in get_args(EngineName):
        raise ValueError(f"engine {origin['engine']!r} is unknown")
    kind: Any = origin["end"]
    if kind not in get_args(EndKind):
        raise ValueError(f"end {kind!r} is unknown")
    return origin["engine"], End(kind, float(origin["end_time"]), origin["cause"])


def _first_line(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"its metadata lack {error.args[0]!r}"
    return str(error).partition("\n")[0]


def metrics_json(metrics: dict[str, float | bool]) -> str:
    """Metrics as a flat JSON object in the order of `METRICS`, with all their digits."""
    return json.dumps(metrics, indent=2, allow_nan=False) + "\n"


def scenario_toml(scenario: Scenario) -> str:
    """A scenario with every default written out, as TOML that reads back to the same scenario."""
    document = without_none(scenario.model_dump(mode="json"))
    return tomli_w.dumps(document)


def without_none(value: Any) -> Any:
    """A document without the keys that have no value, which TOML cannot hold."""
    if isinstance(value, dict):
        return {key: without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [without_none(item) for item in value]
    return value


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block succeeds."""
    # An ordinary file, unlike one of tempfile's, gets the permissions that the user asked for.
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
