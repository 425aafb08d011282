"""``tiltsim plot``: draws a flight, a comparison of several, or a sweep."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tiltsim.commands.figure_options import add_figure_options, prepare_figure, save_figure
from tiltsim.commands.options import Subparsers
from tiltsim.commands.text import print_line

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Draw a flight on one page, several in the same axes, or a sweep: lines, maps,
    distributions or boundaries, according to its axes or its [plot] table."""
    epilog = """panels of a flight: position_error, altitude, margin, attitude, tilt_angles,
    rotor_speeds, path, attitude_plane; of a tilt-car: position_error, inputs, direction,
    direction_error, lyapunov, path, portrait; of several flights: position_error, margin,
    determinant, supervisor, attitude, path; of a sweep: its metrics. Every column or vector of a
    flight, such as vx or velocity, is the name of a panel, too."""
    summary = "draw a flight, several, or a sweep as a figure"
    parser = subparsers.add_parser("plot", help=summary, description=description, epilog=epilog)
    add = parser.add_argument
    flights = "folder of results, flight.parquet or folder of a sweep; several flights are compared"
    add("flights", type=Path, nargs="+", metavar="FLIGHT", help=flights)
    metrics = "metric of a sweep to draw; repeatable"
    add("--metric", action="append", default=[], metavar="NAME", dest="metrics", help=metrics)
    out = "PNG, SVG or PDF (default: flight.png, flights.png or sweep.png beside the first flight)"
    add("--out", type=Path, metavar="FILE", help=out)
    add_figure_options(parser)
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
        draw = _sweep_figure(sweep, [*arguments.metrics, *arguments.panels])
    else:
        draw = _flights_figure(arguments.flights, arguments)
    prepare_figure("--out", out)
    save_figure(draw, out, arguments, is_named=sweep is None)
    print_line(f"figure written to {out}")
    return 0


def _flights_figure(paths: list[Path], arguments: argparse.Namespace) -> Callable[[], Figure]:
    from tiltsim.flight.reading import load_flight
    from tiltsim.views.titles import flight_names

    flights = [load_flight(path) for path in paths]
    names = flight_names([flight.scenario for flight in flights], paths) if paths[1:] else [""]
    texts = {name: name.replace("_", " ") for name in names if name} | arguments.labels

    def draw() -> Figure:
        from tiltsim.views.figures.plot import draw_flights

        panels, title = arguments.panels, arguments.title
        return draw_flights(flights, names, texts, panels=panels, title=title)

    return draw


def _sweep_figure(folder: Path, metrics: list[str]) -> Callable[[], Figure]:
    from tiltsim.sweeps.dataset import load_results

    results = load_results(folder)

    def draw() -> Figure:
        from tiltsim.views.figures.sweep import sweep_figure

        return sweep_figure(results, tuple(metrics))

    return draw
