"""From paths to a report."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tiltsim.report.comparisons import compare
from tiltsim.report.content import Report
from tiltsim.report.findings import FINDINGS
from tiltsim.report.flying import analyze, fly, plan_flights
from tiltsim.report.pictures import draw_all
from tiltsim.report.rows import failures, make_rows
from tiltsim.resources import shipped_folder
from tiltsim.studies.checking import collect


def make_report(
    paths: list[str],
    folder: Path,
    jobs: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Report:
    """Fly, compute and draw what a report shows.

    Parameters
    ----------
    paths
        Files, folders or library names, as in `tiltsim.studies.checking.collect`. Without any, the
        report is the whole: all scenarios, all claims, and the findings.
    folder
        Where flights, computed values and drawings are kept.
    jobs
        Processes.
    progress
        Called with the flights that are done, of how many.

    Raises
    ------
    InputError
        If a scenario is invalid, or a process dies.
    """
    whole = not paths
    plans = plan_flights(collect(paths or [str(shipped_folder("scenarios"))]))
    flights = fly(plans, folder, jobs, progress)
    values = analyze(folder, jobs) if whole else {}
    rows = make_rows(plans, flights, values, whole=whole)
    return Report(
        plans=plans,
        flights=flights,
        rows=rows,
        failures=failures(plans, flights),
        comparisons=compare(plans, flights),
        drawings=draw_all(plans, flights, folder, jobs, whole=whole),
        findings=FINDINGS if whole else (),
    )
