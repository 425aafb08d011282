"""``tiltsim report``: compares the thesis's claims with the simulated flights, on one page."""

from __future__ import annotations

import argparse
from pathlib import Path

from tiltsim.commands.options import Subparsers, add_jobs, add_quiet
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import print_line, tally
from tiltsim.exit_codes import DONE, EXPECTATION_FAILED


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Fly scenarios on both plants, check every published claim, and write one
    self-contained HTML page. Flights are cached: a second report takes seconds, and an interrupted
    one continues."""
    parser = subparsers.add_parser(
        "report",
        help="compare the whole library with the published claims on one HTML page",
        description=description,
        epilog="exit codes: 0 done, 1 an expectation of a scenario failed, 2 invalid input",
    )
    add = parser.add_argument
    paths = "files, folders or library names; default: the library and all claims"
    add("paths", nargs="*", metavar="PATH", help=paths)
    out = "folder for report.html and the cached flights (default: report)"
    add("--out", type=Path, default=Path("report"), metavar="DIR", help=out)
    add("--markdown", type=Path, metavar="FILE", help="also write a summary")
    add_jobs(parser)
    add_quiet(parser, "print only what failed")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Fly, evaluate, write."""
    with show_progress(shown=not arguments.quiet) as progress:
        from tiltsim.report.claim_rows import count
        from tiltsim.report.content import failure_text
        from tiltsim.report.html_page import page
        from tiltsim.report.made import Made
        from tiltsim.report.making import make_report
        from tiltsim.report.markdown import markdown
        from tiltsim.report.store import store
        from tiltsim.system.files import prepare_file, prepare_folder

        out: Path = arguments.out
        target = out / "report.html"
        prepare_folder(out)
        prepare_file("--out", target)
        if arguments.markdown is not None:
            prepare_file("--markdown", arguments.markdown)
        report = make_report(arguments.paths, out / "kept", arguments.jobs, progress.tell)
        progress.begin("writing the page")
        store(target, page(report, Made.now()).encode())
        if arguments.markdown is not None:
            store(arguments.markdown, markdown(report).encode())
    counts = sorted(count(report.rows).items(), key=lambda item: item[0].rank)
    if not arguments.quiet:
        print(f"{len(report.rows)} rows: {tally({kind.value: number for kind, number in counts})}")
    for failure in report.failures:
        print_line(f"FAILED  {failure_text(failure)}")
    if not arguments.quiet:
        print_line(f"report written to {target}")
    return EXPECTATION_FAILED if report.failures else DONE
