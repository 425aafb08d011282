"""``tiltsim report``: compares the thesis's claims with the simulated flights, on one page."""

import os
from pathlib import Path

from tiltsim.commands.options import CORES, Jobs, Quiet, Trust
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import print_line, tally
from tiltsim.exit_codes import DONE, EXPECTATION_FAILED


def run(
    paths: tuple[str, ...] = (),
    *,
    out: Path = Path("report"),
    markdown: Path | None = None,
    errors: Path | None = None,
    jobs: Jobs = CORES,
    trust: Trust = False,
    quiet: Quiet = False,
) -> int:
    """Fly scenarios on both plants, check every published claim, and write one HTML page.

    The page is self-contained. Flights are cached: a second report takes seconds, and an
    interrupted one continues.

    Note:
        exit codes: 0 done, 1 an expectation of a scenario failed, 2 invalid input

    Args:
        paths (PATH): files, folders or library names; default: the library and all claims
        out (DIR): folder for report.html, rows.csv, rows.json and the cached flights (default:
            report)
        markdown (FILE): also write a summary
        errors (FILE): also write the list of errors, as Markdown
        quiet: print only what failed
    """
    with show_progress(shown=not quiet) as progress:
        from tiltsim.report.claim_rows import count
        from tiltsim.report.content import failure_text
        from tiltsim.report.flights import store
        from tiltsim.report.made import Made
        from tiltsim.report.making import make_report
        from tiltsim.report.pages import errors_page, page, rows_csv, rows_json
        from tiltsim.report.pages import markdown as markdown_of
        from tiltsim.scenario.own_code import VARIABLE
        from tiltsim.system.files import prepare_file, prepare_folder

        if trust:
            os.environ[VARIABLE] = "1"  # its processes load the scenarios again
        target = out / "report.html"
        prepare_folder(out)
        prepare_file("--out", target)
        for option, file in (("--markdown", markdown), ("--errors", errors)):
            if file is not None:
                prepare_file(option, file)
        report = make_report([*paths], out / "kept", jobs, progress.tell)
        progress.begin("writing the page")
        store(target, page(report, Made.now()).encode())
        store(out / "rows.csv", rows_csv(report).encode())
        store(out / "rows.json", rows_json(report).encode())
        if markdown is not None:
            store(markdown, markdown_of(report).encode())
        if errors is not None:
            store(errors, errors_page(report).encode())
    if not quiet:
        counts = sorted(count(report.rows).items(), key=lambda item: item[0].rank)
        print(f"{len(report.rows)} rows: {tally({kind.value: number for kind, number in counts})}")
    for failure in report.failures:
        print_line(f"FAILED  {failure_text(failure)}")
    if not quiet:
        print_line(f"report written to {target}")
    return EXPECTATION_FAILED if report.failures else DONE
