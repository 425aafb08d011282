"""``tiltsim sweep``: many flights along axes, into one dataset."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tiltsim.commands.check import positive_integer
from tiltsim.commands.progress import counting_bar
from tiltsim.commands.text import counted
from tiltsim.exit_codes import INTERRUPTED

if TYPE_CHECKING:
    from tiltsim.sweeps.plan import Plan


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "sweep",
        help="fly a scenario along axes: grids, random sets, stability boundaries",
        description=(
            "Fly a scenario along axes into one Parquet dataset. Killed at any moment, the same "
            "command continues."
        ),
    )
    parser.add_argument(
        "sweep", metavar="SWEEP", help="a TOML file or a name from the library (tiltsim list)"
    )
    parser.add_argument(
        "--jobs",
        type=positive_integer,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: the number of cores)",
    )
    parser.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="fly on the workers of this Dask scheduler, such as tcp://192.168.0.1:8786",
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="the results (default: sweeps/NAME)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="overrides",
        help="override a key of the base scenario, such as simulation.plant=thesis; repeatable",
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Fly what is not yet finished, and sum up."""
    from tiltsim.scenario.loading import parse_override
    from tiltsim.sweeps.loading import load_sweep
    from tiltsim.sweeps.plan import Plan
    from tiltsim.sweeps.running import run_sweep

    overrides = dict(parse_override(text) for text in arguments.overrides)
    definition = load_sweep(arguments.sweep, overrides)
    plan = Plan(definition)
    out = arguments.out or Path("sweeps") / Path(definition.address).stem
    shown = not arguments.quiet
    units = ("flight", "flights") if plan.sweep.bisect is None else ("boundary", "boundaries")
    begun = False

    def report(rows: int) -> None:
        nonlocal begun
        if shown and not begun:
            print(_headline(plan, rows, units), file=sys.stderr)
        begun = True
        move(rows)

    try:
        with counting_bar(len(plan), units[1], shown=shown) as move:
            dataset = run_sweep(
                definition,
                out,
                jobs=arguments.jobs,
                cluster=arguments.cluster,
                report=report,
            )
    except KeyboardInterrupt:
        print(
            f"tiltsim: interrupted; what is finished is in {out}, the same command continues",
            file=sys.stderr,
        )
        return INTERRUPTED
    if shown:
        print(_summary(dataset, units))
    return 0


def _headline(plan: Plan, kept: int, units: tuple[str, str]) -> str:
    """What there is to do, less what an earlier run has finished."""
    title = plan.sweep.title or plan.definition.address
    everything = counted(len(plan), *units)
    if kept == len(plan):
        return f"{title}: all {everything} kept, nothing to fly"
    if kept:
        return f"{title}: {kept} of {everything} kept, {len(plan) - kept} to fly"
    return f"{title}: {everything}"


def _summary(dataset: Path, units: tuple[str, str]) -> str:
    from collections import Counter

    import pyarrow.parquet as pq

    ends = Counter(pq.read_table(dataset, columns=["end"])["end"].to_pylist())
    counts = ", ".join(f"{count} {end}" for end, count in ends.most_common())
    return f"{counted(sum(ends.values()), *units)}: {counts}\nwritten to {dataset}"
