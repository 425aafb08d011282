"""``tiltsim check``: flies all scenarios under some paths, for continuous integration."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from tiltsim.commands.options import Subparsers, add_jobs, add_overrides, add_quiet, add_trust
from tiltsim.commands.progress import Progress, show_progress
from tiltsim.commands.text import counted, tally
from tiltsim.exit_codes import DONE, EXPECTATION_FAILED, INVALID_INPUT, VEHICLE_LOST
from tiltsim.system.interrupts import defer_interrupts

if TYPE_CHECKING:
    from tiltsim.studies.checking import CheckResult


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Fly all scenarios under files and folders, and check their expectations. Sweep
    files in folders are skipped. The JUnit file is written even when interrupted; scenarios not yet
    flown are errors in it."""
    parser = subparsers.add_parser(
        "check",
        help="fly all scenarios under some paths and check their expectations",
        description=description,
        epilog="exit codes: 0 all passed, 1 an expectation failed, 2 invalid or crashed, 3 vehicle "
        "lost; if several apply, the most severe is returned (2 > 3 > 1)",
    )
    add = parser.add_argument
    add("paths", nargs="*", metavar="PATH", help="files, folders or library names; default: all")
    add_jobs(parser)
    add_overrides(parser, "every scenario", "simulation.plant=thesis")
    add_trust(parser)
    add("--junit", type=Path, metavar="FILE", help="write JUnit XML")
    add_quiet(parser, "print only what did not pass")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Check everything and print a table."""
    with show_progress(shown=not arguments.quiet) as progress:
        results = _check(arguments, progress)
    labels = Counter(
        "without expectations" if _is_unchecked(result) else result.status for result in results
    )
    if not arguments.quiet:
        print(f"\n{counted(len(results), 'scenario', 'scenarios')}: {tally(labels)}")
    counts = Counter(result.status for result in results)
    if counts["invalid"] or counts["crashed"]:
        return INVALID_INPUT
    if counts["lost"]:
        return VEHICLE_LOST
    return EXPECTATION_FAILED if counts["failed"] else DONE


def _check(arguments: argparse.Namespace, progress: Progress) -> list[CheckResult]:
    """Fly and report everything; the JUnit file is written even when that is interrupted."""
    from tiltsim.plants.trust import is_trusted
    from tiltsim.resources import shipped_folder
    from tiltsim.scenario.loading import parse_override
    from tiltsim.studies.checking import check_all, collect, interrupted_result, write_junit
    from tiltsim.system.files import prepare_file

    junit: Path | None = arguments.junit
    if junit is not None:
        prepare_file("--junit", junit)
    overrides = dict(parse_override(text) for text in arguments.overrides)
    addresses = collect(arguments.paths or [str(shipped_folder("scenarios"))])
    width = max(len(address) for address in addresses)
    finished: dict[str, CheckResult] = {}

    def report(result: CheckResult) -> None:
        finished[result.address] = result
        progress.tell("scenarios", len(finished), len(addresses))
        if result.status != "passed" or not arguments.quiet:
            _print_result(result, width, progress)

    progress.begin("scenarios", len(addresses))
    try:
        results = check_all(
            addresses, arguments.jobs, overrides, report, trusted=is_trusted(arguments.trust)
        )
    except KeyboardInterrupt:
        if junit is not None:
            with defer_interrupts():
                write_junit(
                    [finished.get(name) or interrupted_result(name) for name in addresses], junit
                )
        raise
    if junit is not None:
        write_junit(results, junit)
    return results


def _is_unchecked(result: CheckResult) -> bool:
    """Whether a flight completed that has no expectations."""
    return result.status == "passed" and not result.verdicts


def _print_result(result: CheckResult, width: int, progress: Progress) -> None:
    if result.verdicts:
        held = sum(verdict.holds for verdict in result.verdicts)
        outcome = f"{held}/{len(result.verdicts)} hold"
    else:
        outcome = "no expectations" if _is_unchecked(result) else ""
    mark = "ok" if result.status == "passed" else result.status.upper()
    progress.print(f"{mark:<8}{result.address:<{width}}  {outcome:<15}  {result.wall_time:6.1f} s")
    if result.message:
        progress.print(f"        {result.message}")
