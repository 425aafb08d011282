"""Flights on disk: metrics.json, flight.parquet and scenario.toml in one folder."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from tiltsim.errors import InputError

if TYPE_CHECKING:
    from tiltsim.flight import Flight
    from tiltsim.scenario import Scenario


def prepare_folder(folder: Path) -> None:
    """Create a folder for results before the flight. Raises `InputError` where it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: cannot be created: {error.strerror}") from error
    if not os.access(folder, os.W_OK):
        raise InputError(f"--out {folder}: not writable")


def save_flight(flight: Flight, folder: Path) -> None:
    """Write a flight into a folder; each file appears whole or not at all."""
    import pyarrow.parquet as pq

    folder.mkdir(parents=True, exist_ok=True)
    with _replacing(folder / "flight.parquet") as path:
        pq.write_table(flight.to_arrow(), path, compression="zstd")
    with _replacing(folder / "metrics.json") as path:
        path.write_text(metrics_json(flight.metrics()), encoding="utf-8")
    with _replacing(folder / "scenario.toml") as path:
        path.write_text(scenario_toml(flight.scenario), encoding="utf-8")


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
def _replacing(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block succeeds."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
