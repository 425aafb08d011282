"""``tiltsim sweep``: flies a scenario along axes, into one dataset."""

from collections import Counter
from pathlib import Path
from typing import Final

from tiltsim.commands.options import CORES, Jobs, Overrides, Silent, Trust
from tiltsim.commands.text import (
    counted,
    most_frequent,
    print_line,
    require_flown,
    show_progress,
    tally,
)
from tiltsim.exit_codes import INTERRUPTED

NOT_FLOWN: Final = frozenset({"invalid", "crashed"})  # ends of rows without a flight
MISTAKES: Final = NOT_FLOWN | {"failed"}
"""Ends whose reason is a mistake in a scenario or in a controller's code."""


def run(
    sweep: str,
    *,
    jobs: Jobs = CORES,
    cluster: str | None = None,
    out: Path | None = None,
    overrides: Overrides = (),
    trust: Trust = False,
    quiet: Silent = False,
) -> int:
    """Fly a scenario along axes into one Parquet dataset.

    If it is interrupted or killed, running the same command again continues.

    Args:
        sweep (SWEEP): a TOML file or a name from the library (tiltsim list)
        cluster (ADDRESS): fly on the workers of this Dask scheduler, such as tcp://192.168.0.1:8786
        out (DIR): the results (default: sweeps/NAME)
    """
    from tiltsim.sweeps.loading import load_sweep
    from tiltsim.sweeps.points import SweepPoints
    from tiltsim.sweeps.running import run_sweep
    from tiltsim.system.parquet import open_parquet

    with show_progress(shown=not quiet) as progress:
        progress.begin("checking the sweep")
        definition = load_sweep(sweep, dict(overrides))
        points = SweepPoints(definition)
        folder = out or Path("sweeps") / Path(definition.address).stem
        units = ("flight", "flights") if points.sweep.bisect is None else ("boundary", "boundaries")
        begun = False

        def report(finished: int) -> None:
            nonlocal begun
            if not (quiet or begun):
                state = everything = counted(len(points), *units)
                left = len(points) - finished
                if finished:
                    state = f"{finished} of {everything} finished, {left} to fly"
                if not left:
                    state = f"all {everything} finished, nothing to fly"
                title = points.sweep.title or definition.address
                progress.print(f"{title}: {state}", error=True)
            begun = True
            progress.tell(units[1], finished, len(points))

        try:
            dataset = run_sweep(
                definition, folder, jobs=jobs, cluster=cluster, report=report, trusted=trust
            )
        except KeyboardInterrupt:
            kept = f"finished flights are in {folder}; the same command continues"
            progress.print(f"tiltsim: interrupted; {kept}", error=True)
            return INTERRUPTED
    with open_parquet(dataset) as opened:
        table = opened.read(columns=["end", "cause"])
    ends = list(zip(table["end"].to_pylist(), table["cause"].to_pylist()))
    if not quiet:
        counts = dict(Counter(end for end, _ in ends).most_common())
        print_line(f"{counted(len(ends), *units)}: {tally(counts)}")
        reasons = [cause for end, cause in ends if end in MISTAKES]
        if reasons:
            print_line(most_frequent(reasons))
        print_line(f"written to {dataset}")
    require_flown([cause if end in NOT_FLOWN else None for end, cause in ends])
    return 0
