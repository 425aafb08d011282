"""Makes a report from paths of scenarios."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from tiltsim.report.claim_rows import analyze, criteria, failures, make_rows
from tiltsim.report.content import Report
from tiltsim.report.findings import FINDINGS
from tiltsim.report.flights import compare, fly, report_entries
from tiltsim.report.pictures import draw_all
from tiltsim.resources import shipped_folder
from tiltsim.studies.checking import collect


def make_report(
    paths: list[str],
    folder: Path,
    jobs: int,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> Report:
    """Fly, compute and draw everything that a report shows.

    Args:
        paths: Files, folders or library names, as in `tiltsim.studies.checking.collect`. With none,
            the report is complete: all scenarios, all claims, and the findings.
        folder: Where flights, computed values and drawings are stored.
        jobs: Processes.
        progress: Called with the unit of the count, the number done, and the total.

    Raises:
        InputError: If a scenario is invalid, or a process dies.
    """
    whole = not paths
    entries = report_entries(collect(paths or [str(shipped_folder("scenarios"))]))
    flights = fly(entries, folder, jobs, partial(progress, "flights"))
    values = analyze(folder, partial(progress, "computed claims")) if whole else {}
    rows = make_rows(entries, flights, values, whole=whole)
    drawing = partial(progress, "figures")
    return Report(
        criteria=criteria(rows, flights) if whole else (),
        entries=entries,
        flights=flights,
        rows=rows,
        failures=failures(entries, flights),
        comparisons=compare(entries, flights),
        drawings=draw_all(entries, flights, folder, jobs, drawing, whole=whole),
        findings=FINDINGS if whole else (),
    )
