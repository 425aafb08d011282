"""``tiltsim export``, ``import``, ``replay`` and ``identify``: logs, and flights as logs."""

from pathlib import Path
from typing import Annotated, Any, Final, Literal

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import (
    Json,
    Names,
    Overrides,
    PlotOptions,
    Silent,
    Trust,
    file_in,
    load_scenarios,
)
from tiltsim.commands.text import Columns, aligned, print_line, table
from tiltsim.errors import InputError
from tiltsim.views import figures


def run_export(
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
    from tiltsim.system.files import prepare_file

    loaded = load_flight(flight)
    name = f"flight{FORMATS[format or 'mcap']}"
    file = file_in(out, flight, name)
    prepare_file("--out", file)
    export(loaded, file, format)
    if not quiet:
        print_line(f"{len(loaded)} samples of {len(loaded.units)} columns written to {file}")
    return 0


def run_import(
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


COLUMNS: Final[Columns] = {
    "channel": ("name", ""),
    "unit": ("unit", ""),
    "rms": ("rms", ".3g"),
    "largest": ("size", ".3g"),
    "in the window at (s)": ("at", ".2f"),
}
"""Columns of the printed table."""


def run_replay(
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


def _noise(text: str) -> dict[str, float]:
    try:
        pairs = [part.split("=") for part in text.split(",")]
        return {name.strip(): float(value) for name, value in pairs}
    except ValueError:
        raise ValueError("write position=0.005,attitude=0.002") from None


def run_identify(
    log: Path,
    *,
    scenario: str,
    free: Names,
    window: float = 0.3,
    noise: Annotated[Any, Option(read=_noise)] = None,
    chart: Annotated[Path | None, Option("--map")] = None,
    out: Path | None = None,
    overrides: Overrides = (),
    json: Json = False,
    trust: Trust = False,
    figure: PlotOptions,
) -> int:
    """Find parameters of a vehicle in a log of its flight, with their standard deviations.

    The rotor speeds and tilts of the log drive the model in windows, whose initial states are found
    as well.

    Args:
        log (LOG): a log or a flight: FILE.mcap, .ulg, .csv, .parquet, or a folder
        scenario (SCENARIO): the vehicle as assumed: a TOML file or a library name
        free (KEY,...): keys to find, such as vehicle.mass,vehicle.inertia
        window (S): length of a window, s (default: %(default)s)
        noise (NAME=SIGMA,...): standard deviations of position (m), velocity (m/s), attitude (rad)
            and body_rates (rad/s) (default: estimated from the log)
        chart (FILE): a map of the log's signals, see tiltsim import
        out (FILE): also write the scenario with the values found
    """
    (loaded,) = load_scenarios([scenario], overrides, trust)
    from tiltsim.logs.identify import identify
    from tiltsim.logs.reading import read_log

    read = read_log(log, chart)
    found = identify(read, loaded, free, window=window, noise=noise)
    if out is not None:
        from tiltsim.scenario.loading import scenario_toml
        from tiltsim.system.files import prepare_file, replacing

        prepare_file("--out", out, (".toml",))
        if out.exists():
            raise InputError(f"--out {out}: exists; choose another file")
        text = scenario_toml(loaded.replace(found.overrides()))
        with replacing(out) as temporary:
            temporary.write_text(text, encoding="utf-8")

    rows = [
        (name, f"{value:.6g} ± {found.sigma[name]:.2g} {found.units[name]}")
        for name, value in found.values.items()
    ]
    low, high = found.chi2_band
    lines = [*aligned(rows), f"chi2 {found.chi2:.4g} ({low:.3f} to {high:.3f} for a true model)"]
    lines += [f"{found.windows} windows of {window:g} s", *found.warnings, *read.notes]
    figure.show(
        lambda: figures.logs.estimate_figure(found), found.report(), "\n".join(lines), json=json
    )
    return 0
