"""``tiltsim check``: every scenario under some paths, for continuous integration."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tiltsim.commands.progress import compiling_told
from tiltsim.exit_codes import DONE, EXPECTATION_FAILED, FLIGHT_LOST, INVALID_INPUT

if TYPE_CHECKING:
    from tiltsim.checking import CheckResult


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "check",
        help="fly all scenarios under some paths and judge them",
        description="Fly all scenarios under files and folders, and judge their expectations.",
        epilog="exit codes: 0 all passed, 1 an expectation failed, 2 invalid, 3 a flight was lost",
    )
    parser.add_argument(
        "paths", nargs="*", metavar="PATH", help="files, folders or library names; default: all"
    )
    parser.add_argument(
        "--jobs",
        type=positive_integer,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: the number of cores)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="overrides",
        help="override a key of every scenario, such as simulation.plant=thesis; repeatable",
    )
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write JUnit XML")
    parser.set_defaults(run=run)


def positive_integer(text: str) -> int:
    """A whole number of at least 1, from the command line."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text}: must be a whole number of at least 1")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Check everything and print a table."""
    from tiltsim.checking import check_all, collect, write_junit
    from tiltsim.errors import InputError
    from tiltsim.library import shipped_folder
    from tiltsim.loading import parse_override

    junit: Path | None = arguments.junit
    if junit is not None and (junit.is_dir() or not junit.absolute().parent.is_dir()):
        raise InputError(f"--junit {junit}: must be a file in an existing folder")
    overrides = dict(parse_override(text) for text in arguments.overrides)
    addresses = collect(arguments.paths or [str(shipped_folder("scenarios"))])
    width = max(len(address) for address in addresses)
    with compiling_told(shown=True):
        results = check_all(
            addresses, arguments.jobs, overrides, lambda result: _print_result(result, width)
        )
    if junit is not None:
        write_junit(results, junit)
    counts = Counter(result.status for result in results)
    print(
        f"\n{len(results)} scenarios: " + ", ".join(f"{n} {status}" for status, n in counts.items())
    )
    if counts["invalid"] or counts["crashed"]:
        return INVALID_INPUT
    if counts["lost"]:
        return FLIGHT_LOST
    return EXPECTATION_FAILED if counts["failed"] else DONE


def _print_result(result: CheckResult, width: int) -> None:
    held = sum(verdict.holds for verdict in result.verdicts)
    mark = "ok" if result.status == "passed" else result.status.upper()
    print(
        f"{mark:<8}{result.address:<{width}}  {held}/{len(result.verdicts)} hold"
        f"  {result.wall_time:6.1f} s",
        flush=True,
    )
    if result.message:
        print(f"        {result.message}")
