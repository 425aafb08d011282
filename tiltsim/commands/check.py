"""``tiltsim check``: flies all scenarios under some paths, for continuous integration."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import CORES, Jobs, Overrides, Quiet, Trust
from tiltsim.commands.text import counted, json_text, print_line, show_progress, tally, write_text
from tiltsim.system.interrupts import defer_interrupts

if TYPE_CHECKING:
    from tiltsim.studies.checking import CheckResult

STANDARD_OUTPUT: Final = Path("-")


def _shard(text: str) -> list[int]:
    number, slash, count = text.partition("/")
    if slash and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count):
        return [int(number), int(count)]
    raise ValueError("must be K/N with 1 <= K <= N, such as 1/4")


def run(
    paths: tuple[str, ...] = (),
    *,
    word: Annotated[str, Option("-k")] = "",
    shard: Annotated[tuple[int, int], Option(read=_shard)] = (1, 1),
    fail_fast: bool = False,
    jobs: Jobs = CORES,
    overrides: Overrides = (),
    trust: Trust = False,
    junit: Path | None = None,
    json: Path | None = None,
    quiet: Quiet = False,
) -> int:
    """Fly all scenarios under files and folders, and check their expectations.

    Sweep files in folders are skipped. The JSON and JUnit files are written even when the check is
    interrupted; scenarios not yet flown are in them as well.

    Note:
        exit codes: 0 all passed, 1 an expectation failed, 2 invalid or crashed, 3 vehicle lost; if
        several apply, the most severe is returned (2 > 3 > 1)

    Args:
        paths (PATH): files, folders or library names; default: all
        word (WORD): only what has this text in its address, title or source, as tiltsim list WORD
        shard (K/N): only the K-th of N parts, for N machines; together they are everything
        fail_fast: end at the first that does not pass
        junit (FILE): write JUnit XML
        json (FILE): write JSON; - prints it instead of the table
        quiet: print only scenarios that did not pass
    """
    from tiltsim.resources import shipped_folder
    from tiltsim.studies.checking import (
        check_all,
        collect,
        exit_code,
        json_document,
        not_flown,
        write_junit,
    )
    from tiltsim.studies.checking import shard as part_of
    from tiltsim.system.files import prepare_file

    to_error = json == STANDARD_OUTPUT
    finished: dict[str, CheckResult] = {}
    reason: Literal["interrupted", "skipped"] = "interrupted"
    with show_progress(shown=not quiet) as progress:
        for option, file in (("--junit", junit), ("--json", None if to_error else json)):
            if file is not None:
                prepare_file(option, file)
        addresses = part_of(collect(paths or [str(shipped_folder("scenarios"))], word), *shard)
        width = max(map(len, addresses), default=0)
        progress.begin("scenarios", len(addresses))
        try:
            for result in check_all(addresses, jobs, dict(overrides), trusted=trust):
                finished[result.address] = result
                progress.tell("scenarios", len(finished), len(addresses))
                if result.status != "passed" or not quiet:
                    for line in _lines(result, width):
                        progress.print(line, error=to_error)
                if result.status != "passed" and fail_fast:
                    break
            reason = "skipped"
        finally:
            results = [finished.get(at) or not_flown(at, reason) for at in addresses]
            with defer_interrupts():
                if junit is not None:
                    write_junit(results, junit)
                if json is not None:
                    text = json_text(json_document(results))
                    print(text) if to_error else write_text(json, text)
    labels = Counter(
        "without expectations" if result.without_expectations else result.status
        for result in results
    )
    if not quiet:
        counts = f": {tally(labels)}" if results else ""
        print_line("", error=to_error)
        print_line(f"{counted(len(results), 'scenario', 'scenarios')}{counts}", error=to_error)
    return exit_code(results)


def _lines(result: CheckResult, width: int) -> list[str]:
    """A row of the table, and the reason why a scenario did not pass."""
    if result.verdicts:
        held = sum(verdict.holds for verdict in result.verdicts)
        outcome = f"{held}/{len(result.verdicts)} hold"
    else:
        outcome = "no expectations" if result.without_expectations else ""
    mark = "ok" if result.status == "passed" else result.status.upper()
    row = f"{mark:<8}{result.address:<{width}}  {outcome:<15}  {result.wall_time:6.1f} s"
    return [row, f"        {result.message}"] if result.message else [row]
