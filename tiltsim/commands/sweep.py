"""``tiltsim sweep``: flies a scenario along axes, into one dataset."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tiltsim.commands.options import Subparsers, add_jobs, add_overrides, add_quiet, add_trust
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import counted, most_frequent, print_line, require_flown, tally
from tiltsim.exit_codes import INTERRUPTED

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from tiltsim.sweeps.points import SweepPoints

NOT_FLOWN: Final = frozenset({"invalid", "crashed"})
"""Ends of rows without a flight."""

MISTAKES: Final = NOT_FLOWN | {"failed"}
"""Ends whose reason is a mistake in a scenario or in a controller's code."""


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Fly a scenario along axes into one Parquet dataset. If it is interrupted or
    killed, running the same command again continues."""
    summary = "fly a scenario along axes: grids, random sets, stability boundaries"
    parser = subparsers.add_parser("sweep", help=summary, description=description)
    add = parser.add_argument
    add("sweep", metavar="SWEEP", help="a TOML file or a name from the library (tiltsim list)")
    add_jobs(parser)
    cluster = "fly on the workers of this Dask scheduler, such as tcp://192.168.0.1:8786"
    add("--cluster", metavar="ADDRESS", help=cluster)
    add("--out", type=Path, metavar="DIR", help="the results (default: sweeps/NAME)")
    add_overrides(parser, "the base scenario", "simulation.plant=thesis")
    add_trust(parser)
    add_quiet(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Fly the points that are not yet finished, and print a summary."""
    from tiltsim.scenario.override_keys import parse_override
    from tiltsim.sweeps.loading import load_sweep
    from tiltsim.sweeps.points import SweepPoints
    from tiltsim.sweeps.running import run_sweep

    overrides = dict(parse_override(text) for text in arguments.overrides)
    shown = not arguments.quiet
    with show_progress(shown=shown) as progress:
        progress.begin("checking the sweep")
        definition = load_sweep(arguments.sweep, overrides)
        points = SweepPoints(definition)
        out = arguments.out or Path("sweeps") / Path(definition.address).stem
        units = ("flight", "flights") if points.sweep.bisect is None else ("boundary", "boundaries")
        begun = False

        def report(rows: int) -> None:
            nonlocal begun
            if shown and not begun:
                progress.print(_headline(points, rows, units), error=True)
            begun = True
            progress.tell(units[1], rows, len(points))

        try:
            dataset = run_sweep(
                definition,
                out,
                jobs=arguments.jobs,
                cluster=arguments.cluster,
                report=report,
                trusted=arguments.trust,
            )
        except KeyboardInterrupt:
            progress.print(
                f"tiltsim: interrupted; finished flights are in {out}; the same command continues",
                error=True,
            )
            return INTERRUPTED
    ends = _ends(dataset)
    if shown:
        for line in _summary(ends, units):
            print_line(line)
        print_line(f"written to {dataset}")
    require_flown([cause if end in NOT_FLOWN else None for end, cause in ends])
    return 0


def _headline(points: SweepPoints, finished: int, units: tuple[str, str]) -> str:
    """How many points are to be flown, and how many an earlier run has finished."""
    title = points.sweep.title or points.definition.address
    everything = counted(len(points), *units)
    if finished == len(points):
        return f"{title}: all {everything} finished, nothing to fly"
    if finished:
        return f"{title}: {finished} of {everything} finished, {len(points) - finished} to fly"
    return f"{title}: {everything}"


def _ends(dataset: Path) -> list[tuple[str, str]]:
    """End and cause of every row."""
    from tiltsim.system.parquet import open_parquet

    with open_parquet(dataset) as opened:
        table = opened.read(columns=["end", "cause"])
    return list(zip(table["end"].to_pylist(), table["cause"].to_pylist(), strict=True))


def _summary(ends: Sequence[tuple[str, str]], units: tuple[str, str]) -> Iterator[str]:
    """Lines: how the flights ended, and why most of those were not flown or failed."""
    from collections import Counter

    counts = Counter(end for end, _ in ends)
    yield f"{counted(len(ends), *units)}: {tally(dict(counts.most_common()))}"
    reasons = [cause for end, cause in ends if end in MISTAKES]
    if reasons:
        yield most_frequent(reasons)
