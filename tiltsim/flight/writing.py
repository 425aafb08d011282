"""Write a flight into a folder: metrics.json, flight.parquet, scenario.toml."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from tiltsim.scenario.controller import PythonController
from tiltsim.scenario.loading import scenario_toml
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.files import replacing

if TYPE_CHECKING:
    import pyarrow


def write_flight(
    folder: Path, table: pyarrow.Table, metrics: Mapping[str, float | bool], scenario: Scenario
) -> None:
    """Write a flight into a folder; each file appears whole or not at all.

    Args:
        folder: Where to; created if missing.
        table: The columns, for flight.parquet.
        metrics: For metrics.json.
        scenario: For scenario.toml, with all defaults filled in; the file of a user's controller is
            copied.
    """
    import pyarrow.parquet as pq

    folder.mkdir(parents=True, exist_ok=True)
    with replacing(folder / "flight.parquet") as path:
        pq.write_table(table, path, compression="zstd")
    with replacing(folder / "metrics.json") as path:
        path.write_text(metrics_json(metrics), encoding="utf-8")
    scenario = with_controller_copied(scenario, folder)
    with replacing(folder / "scenario.toml") as path:
        path.write_text(scenario_toml(scenario), encoding="utf-8")


def with_controller_copied(scenario: Scenario, folder: Path) -> Scenario:
    """Copy the file of a user's controller into a folder; the scenario that names the copy.

    A scenario without such a file is returned unchanged.
    """
    table = scenario.controller
    if not isinstance(table, PythonController) or table.file is None or not table.file.is_file():
        return scenario
    copy = folder / table.file.name
    if not (copy.exists() and copy.samefile(table.file)):
        with replacing(copy) as path:
            path.write_bytes(table.file.read_bytes())
    named = table.model_copy(update={"function": f"{copy.name}:{table.attribute}"})
    return scenario.model_copy(update={"controller": named})


def metrics_json(metrics: Mapping[str, float | bool]) -> str:
    """Metrics as a flat JSON object in the order of `METRICS`, with all their digits."""
    return json.dumps(dict(metrics), indent=2, allow_nan=False) + "\n"
