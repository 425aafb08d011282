"""``tiltsim check``: every scenario under some paths, for continuous integration."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tiltsim.checking import CheckResult

PASSED, EXPECTATION_FAILED, INVALID, LOST = 0, 1, 2, 3


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
        type=_positive,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: the number of cores)",
    )
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write JUnit XML")
    parser.set_defaults(run=run)


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return value


def run(arguments: argparse.Namespace) -> int:
    """Check everything and print a table."""
    from tiltsim.checking import check_all, collect, write_junit
    from tiltsim.errors import InputError
    from tiltsim.library import shipped_folder

    if arguments.junit is not None and not arguments.junit.absolute().parent.is_dir():
        raise InputError(f"--junit {arguments.junit}: its folder does not exist")
    addresses = collect(arguments.paths or [str(shipped_folder("scenarios"))])
    width = max(len(address) for address in addresses)
    results = check_all(addresses, arguments.jobs, lambda result: _print_result(result, width))
    if arguments.junit is not None:
        write_junit(results, arguments.junit)
    counts = Counter(result.status for result in results)
    print(
        f"\n{len(results)} scenarios: " + ", ".join(f"{n} {status}" for status, n in counts.items())
    )
    if counts["invalid"] or counts["crashed"]:
        return INVALID
    if counts["lost"]:
        return LOST
    return EXPECTATION_FAILED if counts["failed"] else PASSED


def _print_result(result: CheckResult, width: int) -> None:
    held = sum(holds for _, holds, _, _ in result.verdicts)
    mark = "ok" if result.status == "passed" else result.status.upper()
    print(
        f"{mark:<8}{result.address:<{width}}  {held}/{len(result.verdicts)} hold"
        f"  {result.wall_time:6.1f} s",
        flush=True,
    )
    if result.message:
        print(f"        {result.message}")
