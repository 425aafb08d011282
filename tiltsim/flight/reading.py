"""Read a flight back from flight.parquet."""

from __future__ import annotations

import json
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, get_args

import numpy as np

from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End, EndKind
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.library import check_limits
from tiltsim.scenario.loading import parse_scenario, without_none
from tiltsim.system.files import is_file, is_folder
from tiltsim.system.parquet import open_parquet
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    import pyarrow

LATEST: Final = 1e9  # latest time (s) of a flight, as of a scenario


def load_flight(path: str | PathLike[str]) -> Flight:
    """Read a flight back: samples, scenario, engine, end and wall time.

    Args:
        path: A folder of results or a ``flight.parquet``.

    Raises:
        InputError: If there is no such file, it is damaged, or it is not a flight of tiltsim.
    """
    file = flight_file(path)
    with open_parquet(file) as opened:
        table = opened.read()
        table.validate(full=True)
    return flight_of_table(table, file)


def flight_of_table(table: pyarrow.Table, file: Path) -> Flight:
    """The flight whose columns and origin a table holds.

    Args:
        table: See `Flight.to_arrow`.
        file: Its place, for messages.

    Raises:
        InputError: If it is not a flight of tiltsim.
    """
    origin = _origin(file, table)
    try:
        document = dict(json.loads(origin["scenario"]))
        check_limits(document, f"{file}: not a flight of tiltsim: its scenario")
        engine, end = _engine_and_end(origin)
        wall_time = float(origin["wall_time"])
    except (KeyError, ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{file}: not a flight of tiltsim: {_first_line(error)}") from error
    try:
        scenario = parse_scenario(without_none(document), origin.get("address", ""))
        assembly = assemble(scenario, recorded=True)
    except InputError as error:
        raise InputError(f"{file}: its scenario is invalid: {error}") from error
    samples = _samples(file, table, assembly.loop.sample_fields)
    return Flight(assembly, samples, end, engine, wall_time)


def _samples(file: Path, table: pyarrow.Table, fields: Sequence[str]) -> Floats:
    for name in fields:
        if (count := table.column_names.count(name)) != 1:
            found = f"{count} columns" if count else "no column"
            raise InputError(f"{file}: not a flight of tiltsim: {found} {name}")
    if len(table) == 0:
        raise InputError(f"{file}: the flight has no samples")
    try:
        columns = [np.asarray(table[name].to_numpy(), dtype=np.float64) for name in fields]
    except (ValueError, TypeError) as error:
        raise InputError(f"{file}: not a flight of tiltsim: {_first_line(error)}") from error
    for name, values in zip(fields, columns, strict=True):
        if not np.isfinite(values).all():
            raise InputError(f"{file}: damaged: {name} contains non-finite values")
    if np.abs(columns[0]).max() > LATEST:
        raise InputError(f"{file}: damaged: timestamps exceed {LATEST:g} s")
    if (np.diff(columns[0]) <= 0.0).any():
        raise InputError(f"{file}: damaged: timestamps are not strictly increasing")
    return np.column_stack(columns)


def flight_file(given: str | PathLike[str]) -> Path:
    """The Parquet file of a path, which may be its folder."""
    if not isinstance(given, str | PathLike):
        raise InputError(f"path = {short_repr(given)}: must be the name of a folder or file")
    path = Path(given)
    file = path / "flight.parquet" if is_folder(path) else path
    is_scenario = file.suffix == ".toml"
    if is_file(file) and not is_scenario:
        return file
    missing = "no flight.parquet in this folder" if is_folder(path) else "no such file"
    missing = "a scenario, not a flight" if is_file(file) and is_scenario else missing
    raise InputError(
        f"{path}: {missing}; give a folder that tiltsim run --out wrote, a flight.parquet or, to "
        "tiltsim plot, the output of tiltsim sweep"
    )


def _origin(file: Path, table: pyarrow.Table) -> dict[str, str]:
    metadata = table.schema.metadata or {}
    if b"scenario" not in metadata:
        hint = "; it is an imported log, for tiltsim plot, replay and identify"
        is_log = hint if b"log" in metadata else ""
        raise InputError(f"{file}: not a flight of tiltsim: no scenario in its metadata{is_log}")
    return {k.decode(errors="replace"): v.decode(errors="replace") for k, v in metadata.items()}


def _engine_and_end(origin: dict[str, str]) -> tuple[Any, End]:
    """Engine and end from the metadata. Raises `ValueError` where they are unknown."""
    if origin["engine"] not in get_args(EngineName):
        raise ValueError(f"engine {origin['engine']!r} is unknown")
    kind: Any = origin["end"]
    if kind not in get_args(EndKind):
        raise ValueError(f"end {kind!r} is unknown")
    end_time = float(origin["end_time"])
    if not 0.0 <= end_time <= LATEST:
        raise ValueError(f"end_time = {end_time:g}: must be from 0 to {LATEST:g}")
    return origin["engine"], End(kind, end_time, origin["cause"])


def _first_line(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"no {error.args[0]!r} in its metadata"
    return str(error).partition("\n")[0]
