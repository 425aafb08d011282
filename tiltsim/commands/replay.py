"""``tiltsim replay``: flies a model on the rotor speeds and tilts of a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import Json, Overrides, PlotOptions, Trust, load_scenarios
from tiltsim.commands.text import Columns, table
from tiltsim.views import figures

COLUMNS: Final[Columns] = {
    "channel": ("name", ""),
    "unit": ("unit", ""),
    "rms": ("rms", ".3g"),
    "largest": ("size", ".3g"),
    "in the window at (s)": ("at", ".2f"),
}
"""Columns of the printed table."""


def run(
    log: Path,
    *,
    scenario: str,
    window: float = 0.3,
    chart: Annotated[Path | None, Option("--map")] = None,
    overrides: Overrides = (),
    json: Json = False,
    trust: Trust = False,
    figure: PlotOptions,
) -> int:
    """Drive a vehicle's model, open loop, with the rotor speeds and tilts of a log.

    In each window the model starts from the measured state; the mismatch at its samples is measured
    minus predicted.

    Args:
        log (LOG): a log or a flight: FILE.mcap, .ulg, .csv, .parquet, or a folder
        scenario (SCENARIO): the vehicle: a TOML file or a library name
        window (S): length of a window, s (default: %(default)s)
        chart (FILE): a map of the log's signals, see tiltsim import
    """
    figure.check()
    (loaded,) = load_scenarios([scenario], overrides, trust)
    from tiltsim.logs.identify import replay
    from tiltsim.logs.log import UNITS
    from tiltsim.logs.reading import read_log

    read = read_log(log, chart)
    found = replay(read, loaded, window=window)

    rows = [
        {"name": name, "unit": UNITS[name], "rms": found.rms[name], "size": size, "at": at}
        for name, (size, at) in found.worst.items()
    ]
    text = table(COLUMNS, rows)
    lines = [f"{len(found.time)} windows of {window:g} s", *read.notes, text]
    figure.show(
        lambda: figures.logs.replay_figure(found), found.report(), "\n".join(lines), json=json
    )
    return 0
