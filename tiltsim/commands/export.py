"""``tiltsim export``: writes a flight in the format of other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from tiltsim.commands.options import Silent, file_in
from tiltsim.commands.text import print_line


def run(
    flight: Path,
    *,
    format: Literal["mcap", "ulog", "csv"] | None = None,  # noqa: A002
    out: Path | None = None,
    quiet: Silent = False,
) -> int:
    """Write all columns of a flight, every bit of them, for Foxglove, PlotJuggler or PX4's tools.

    Args:
        flight (FLIGHT): a folder of results, or a flight.parquet
        format: mcap (default), ulog or csv; by default according to the suffix of --out
        out (FILE): the file, or a folder (default: flight.mcap, .ulg or .csv beside the flight)
    """
    from tiltsim.flight.reading import load_flight
    from tiltsim.logs.formats import FORMATS, export

    loaded = load_flight(flight)
    name = f"flight{FORMATS[format or 'mcap']}"
    file = file_in(out, flight, name)
    export(loaded, file, format)
    if not quiet:
        print_line(f"{len(loaded)} samples of {len(loaded.units)} columns written to {file}")
    return 0
