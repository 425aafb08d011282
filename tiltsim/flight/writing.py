"""Write a flight into a folder: metrics.json, flight.parquet, scenario.toml."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.document import scenario_toml
from tiltsim.system.files import replacing


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
    from tiltsim.scenario.controller import PythonController

    table = scenario.controller
    if not isinstance(table, PythonController) or table.file is None or not table.file.is_file():
        return scenario
    copy = folder / table.file.name
    if not (copy.exists() and copy.samefile(table.file)):
        with replacing(copy) as path:
            path.write_bytes(table.file.read_bytes())
    named = table.model_copy(update={"function": f"{copy.name}:{table.attribute}"})
    return scenario.model_copy(update={"controller": named})


def metrics_json(metrics: dict[str, float | bool]) -> str:
    """Metrics as a flat JSON object in the order of `METRICS`, with all their digits."""
    return json.dumps(metrics, indent=2, allow_nan=False) + "\n"
