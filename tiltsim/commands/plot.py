"""``tiltsim plot``: draws a flight, a comparison of several, or a sweep."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tiltsim.commands.options import Subparsers, prepare_figure
from tiltsim.commands.text import print_line

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Draw a flight on one page: attitude, altitude, position error, tilt angles,
    rotor speeds, singularity margin, path over the ground, roll-pitch plane. Several flights:
    margin, determinant and position error of each over time. A sweep: lines, maps, distributions or
    boundaries, according to its axes or its [plot] table."""
    summary = "draw a flight, several, or a sweep as a figure"
    parser = subparsers.add_parser("plot", help=summary, description=description)
    add = parser.add_argument
    flights = "folder of results, flight.parquet or folder of a sweep; several flights are compared"
    add("flights", type=Path, nargs="+", metavar="FLIGHT", help=flights)
    metrics = "metric of a sweep to draw; repeatable"
    add("--metric", action="append", default=[], metavar="NAME", dest="metrics", help=metrics)
    out = "PNG, SVG or PDF (default: flight.png, flights.png or sweep.png beside the first flight)"
    add("--out", type=Path, metavar="FILE", help=out)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Draw and save."""
    from tiltsim.errors import InputError
    from tiltsim.sweeps.dataset import is_sweep_folder

    first, *others = arguments.flights
    sweep = next((path for path in arguments.flights if is_sweep_folder(path)), None)
    if sweep is not None and others:
        raise InputError(
            f"{sweep}: a sweep cannot be drawn together with others; remove the other paths"
        )
    if arguments.metrics and sweep is None:
        raise InputError(f"--metric {arguments.metrics[0]}: {first} is not the folder of a sweep")
    folder = first if first.is_dir() else first.parent
    name = "flights.png" if others else "flight.png"
    out = arguments.out or folder / (name if sweep is None else "sweep.png")
    if sweep is not None:
        figure = _sweep_figure(sweep, arguments.metrics, out)
    else:
        figure = _flights_figure(arguments.flights, out)

    from tiltsim.views.figures.style import save

    save(figure, out)
    print_line(f"figure written to {out}")
    return 0


def _flights_figure(paths: list[Path], out: Path) -> Figure:
    from tiltsim.flight.reading import load_flight

    flights = [load_flight(path) for path in paths]
    prepare_figure("--out", out)
    if len(flights) > 1:
        from tiltsim.views.figures.comparison import comparison_figure
        from tiltsim.views.titles import flight_names

        names = flight_names([flight.scenario for flight in flights], paths)
        return comparison_figure(flights, names)
    from tiltsim.views.vehicle_views import flight_figure

    return flight_figure(flights[0])


def _sweep_figure(folder: Path, metrics: list[str], out: Path) -> Figure:
    from tiltsim.sweeps.dataset import load_results

    results = load_results(folder)
    prepare_figure("--out", out)
    from tiltsim.views.figures.sweep import sweep_figure

    return sweep_figure(results, tuple(metrics))
