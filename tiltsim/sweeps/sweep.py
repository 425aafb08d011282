"""A whole sweep in one call: read, flown, its rows in memory."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tiltsim.errors import InputError
from tiltsim.sweeps.dataset import SweepResults, load_results
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.running import run_sweep
from tiltsim.system.numbers import true_or_false, whole_number
from tiltsim.system.progress import Report, reported
from tiltsim.system.text import short_repr


def sweep(
    source: str | PathLike[str] | Mapping[str, Any],
    overrides: Mapping[str, Any] | None = None,
    *,
    out: str | PathLike[str] | None = None,
    jobs: int = 1,
    progress: Report | bool | None = None,
    trusted: bool = False,
) -> SweepResults:
    """Fly a scenario along axes.

    Args:
        source: A TOML file, the name of a sweep in the library, or the tables of a file as a dict
            (docs/sweeps.md), whose ``scenario`` is an address, a table or a `tiltsim.Scenario`.
        overrides: Values by dotted key of the scenario, on top of ``[set]``.
        out: A folder for the rows, which a later call with the same sweep continues; default: the
            rows are in memory only.
        jobs: Processes. With several, a script has to call this under
            ``if __name__ == "__main__":``, as for any use of processes in Python.
        progress: True for a bar; or a function, called with the number of finished rows.
        trusted: Whether to execute Python files that scenarios name.

    Returns:
        One row for each point; see `SweepResults.to_pandas` and `SweepResults.to_arrow`.

    Raises:
        InputError: In one line: the sweep, the key, the value and the allowed values.
    """
    jobs, trusted = whole_number("jobs", jobs), true_or_false("trusted", trusted)
    if out is not None and not isinstance(out, str | PathLike):
        raise InputError(f"out = {short_repr(out)}: must be the name of a folder")
    definition = load_sweep(source, overrides)
    points = SweepPoints(definition)
    if points.sweep.keep_flights and out is None:
        raise InputError(f"{definition.address}: keep_flights = true: needs out, a folder for them")
    with (
        reported(progress, "flights", len(points)) as report,
        TemporaryDirectory(prefix="tiltsim-sweep-") as temporary,
    ):
        folder = Path(temporary if out is None else out)
        run_sweep(definition, folder, jobs=jobs, report=report, trusted=trusted)
        return load_results(folder, scenarios=True)
