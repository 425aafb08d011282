"""``tiltsim check``: flies all scenarios under some paths, for continuous integration."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from tiltsim.commands.options import Subparsers, add_jobs, add_overrides, add_quiet, add_trust
from tiltsim.commands.progress import Progress, show_progress
from tiltsim.commands.text import counted, json_text, print_line, tally
from tiltsim.system.interrupts import defer_interrupts

if TYPE_CHECKING:
    from tiltsim.studies.check_results import CheckResult

_STANDARD_OUTPUT: Final = Path("-")


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Fly all scenarios under files and folders, and check their expectations. Sweep
    files in folders are skipped. The JSON and JUnit files are written even when the check is
    interrupted; scenarios not yet flown are in them, too."""
    parser = subparsers.add_parser(
        "check",
        help="fly all scenarios under some paths and check their expectations",
        description=description,
        epilog="exit codes: 0 all passed, 1 an expectation failed, 2 invalid or crashed, 3 vehicle "
        "lost; if several apply, the most severe is returned (2 > 3 > 1)",
    )
    add = parser.add_argument
    add("paths", nargs="*", metavar="PATH", help="files, folders or library names; default: all")
    add(
        "-k",
        default="",
        metavar="WORD",
        dest="word",
        help="only what has this text in its address, title or source, as tiltsim list WORD",
    )
    add(
        "--shard",
        type=_shard,
        default=(1, 1),
        metavar="K/N",
        help="only the K-th of N parts, for N machines; together they are everything",
    )
    add("--fail-fast", action="store_true", help="end at the first that does not pass")
    add_jobs(parser)
    add_overrides(parser, "every scenario", "simulation.plant=thesis")
    add_trust(parser)
    add("--junit", type=Path, metavar="FILE", help="write JUnit XML")
    add("--json", type=Path, metavar="FILE", help="write JSON; - prints it instead of the table")
    add_quiet(parser, "print only what did not pass")
    parser.set_defaults(run=run)


def _shard(text: str) -> tuple[int, int]:
    number, slash, count = text.partition("/")
    if slash and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count):
        return int(number), int(count)
    raise argparse.ArgumentTypeError(f"{text}: must be K/N with 1 <= K <= N, such as 1/4")


def run(arguments: argparse.Namespace) -> int:
    """Check everything and print a table."""
    from tiltsim.studies.check_results import exit_code

    with show_progress(shown=not arguments.quiet) as progress:
        results = _check(arguments, progress)
    labels = Counter(
        "without expectations" if result.without_expectations else result.status
        for result in results
    )
    if not arguments.quiet:
        counts = f": {tally(labels)}" if results else ""
        total = counted(len(results), "scenario", "scenarios")
        error = arguments.json == _STANDARD_OUTPUT
        print_line("", error=error)
        print_line(f"{total}{counts}", error=error)
    return exit_code(results)


def _check(arguments: argparse.Namespace, progress: Progress) -> list[CheckResult]:
    """Fly and report everything; the files are written even when that is interrupted."""
    from tiltsim.resources import shipped_folder
    from tiltsim.scenario.override_keys import parse_override
    from tiltsim.studies.check_results import not_flown
    from tiltsim.studies.checking import check_all, collect, shard
    from tiltsim.system.files import prepare_file

    for option in ("junit", "json"):
        file = getattr(arguments, option)
        if file not in {None, _STANDARD_OUTPUT}:
            prepare_file(f"--{option}", file)
    overrides = dict(parse_override(text) for text in arguments.overrides)
    paths = arguments.paths or [str(shipped_folder("scenarios"))]
    addresses = shard(collect(paths, arguments.word), *arguments.shard)
    width = max(map(len, addresses), default=0)
    finished: dict[str, CheckResult] = {}
    reason: Literal["interrupted", "skipped"] = "interrupted"
    progress.begin("scenarios", len(addresses))
    try:
        for result in check_all(addresses, arguments.jobs, overrides, trusted=arguments.trust):
            finished[result.address] = result
            progress.tell("scenarios", len(finished), len(addresses))
            if result.status != "passed" or not arguments.quiet:
                _print_result(result, width, progress, arguments.json == _STANDARD_OUTPUT)
            if result.status != "passed" and arguments.fail_fast:
                break
        reason = "skipped"
    finally:
        results = [finished.get(address) or not_flown(address, reason) for address in addresses]
        with defer_interrupts():
            _write(results, arguments)
    return results


def _write(results: list[CheckResult], arguments: argparse.Namespace) -> None:
    """Write the files that other programs read."""
    from tiltsim.studies.check_results import json_document, write_junit
    from tiltsim.system.files import replacing

    if arguments.junit is not None:
        write_junit(results, arguments.junit)
    if arguments.json is None:
        return
    text = json_text(json_document(results))
    if arguments.json == _STANDARD_OUTPUT:
        print(text)
    else:
        with replacing(arguments.json) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")


def _print_result(result: CheckResult, width: int, progress: Progress, error: bool) -> None:
    if result.verdicts:
        held = sum(verdict.holds for verdict in result.verdicts)
        outcome = f"{held}/{len(result.verdicts)} hold"
    else:
        outcome = "no expectations" if result.without_expectations else ""
    mark = "ok" if result.status == "passed" else result.status.upper()
    row = f"{mark:<8}{result.address:<{width}}  {outcome:<15}  {result.wall_time:6.1f} s"
    progress.print(row, error=error)
    if result.message:
        progress.print(f"        {result.message}", error=error)
