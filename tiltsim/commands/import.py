"""``tiltsim import``: reads a log of a real vehicle or of another tool."""  # noqa: N999

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import Silent
from tiltsim.commands.text import print_line


def run(
    log: Path,
    *,
    chart: Annotated[Path | None, Option("--map")] = None,
    out: Path | None = None,
    quiet: Silent = False,
) -> int:
    """Read MCAP, ULog or CSV into tiltsim's columns and frames, and say what is missing in it.

    Args:
        log (LOG): FILE.mcap, .ulg or .csv
        chart (FILE): a TOML file with a signal for each column; not needed for exported flights,
            PX4's topics, and CSV files with tiltsim's names
        out (DIR): folder for flight.parquet, which tiltsim plot and identify read; of an exported
            flight, for the whole flight
    """
    from tiltsim.logs.reading import read_log

    read = read_log(log, chart)
    if out is not None:
        read.save(out)
    if not quiet:
        print_line(f"{len(read)} samples of {len(read.units)} columns in {read.duration:g} s")
        for note in read.notes:
            print_line(f"  {note}")
        if out is not None:
            print_line(f"written to {out}")
    return 0
