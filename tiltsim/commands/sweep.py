"""``tiltsim sweep``: flies a scenario along axes, into one dataset."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tiltsim.commands.options import Subparsers, add_jobs, add_overrides, add_quiet, add_trust
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import counted, print_line, tally
from tiltsim.exit_codes import INTERRUPTED
from tiltsim.system.text import shortened

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tiltsim.sweeps.points import SweepPoints

NOT_FLOWN: Final = frozenset({"invalid", "crashed", "failed"})
"""Ends whose reason is a mistake in a scenario or in a controller's code."""

LONGEST_REASON: Final = 300
"""Characters of a reason; messages that list what is allowed can be long."""


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
    from tiltsim.plants.trust import is_trusted
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
                trusted=is_trusted(arguments.trust),
            )
        except KeyboardInterrupt:
            progress.print(
                f"tiltsim: interrupted; finished flights are in {out}; the same command continues",
                error=True,
            )
            return INTERRUPTED
    if shown:
        for line in _summary(dataset, units):
            print_line(line)
        print_line(f"written to {dataset}")
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


def _summary(dataset: Path, units: tuple[str, str]) -> Iterator[str]:
    """Lines: how the flights ended, and why most of those were not flown."""
    from collections import Counter

    from tiltsim.system.parquet import open_parquet

    with open_parquet(dataset) as opened:
        table = opened.read(columns=["end", "cause"])
    ends = Counter(table["end"].to_pylist())
    total = counted(sum(ends.values()), *units)
    yield f"{total}: {tally(dict(ends.most_common()))}"
    rows = zip(*(table[name].to_pylist() for name in ("end", "cause")), strict=True)
    reasons = Counter(cause for end, cause in rows if end in NOT_FLOWN)
    for reason, number in reasons.most_common(1):
        shown = shortened(reason, LONGEST_REASON)
        yield f"most frequent reason ({number} of {reasons.total()}): {shown}"
