"""``tiltsim plot``: the figure of a flight or of a sweep."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "plot",
        help="draw a flight or a sweep as a figure",
        description=(
            "Draw a flight on one page: attitude, altitude, position error, tilt angles, rotor "
            "speeds, singularity margin, path over the ground, roll-pitch plane. Or draw a sweep: "
            "lines, maps, distributions or boundaries, as its axes or its [plot] table have it."
        ),
    )
    parser.add_argument(
        "flight",
        type=Path,
        metavar="FLIGHT",
        help="a folder of results, a flight.parquet, or the folder of a sweep",
    )
    parser.add_argument(
        "--metric",
        action="append",
        default=[],
        metavar="NAME",
        dest="metrics",
        help="what to draw of a sweep; repeatable",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="PNG, SVG or PDF by its ending (default: flight.png or sweep.png beside the data)",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Draw and save."""
    from tiltsim.errors import InputError
    from tiltsim.sweeps.dataset import is_sweep_folder

    sweep = is_sweep_folder(arguments.flight)
    if arguments.metrics and not sweep:
        raise InputError(f"--metric {arguments.metrics[0]}: {arguments.flight} holds no sweep")
    folder = arguments.flight if arguments.flight.is_dir() else arguments.flight.parent
    out = arguments.out or folder / ("sweep.png" if sweep else "flight.png")
    figure = _sweep_figure(arguments, out) if sweep else _flight_figure(arguments, out)

    from tiltsim.figures.style import save

    save(figure, out)
    print(f"figure written to {out}")
    return 0


def _flight_figure(arguments: argparse.Namespace, out: Path) -> Figure:
    from tiltsim.files import load_flight

    flight = load_flight(arguments.flight)
    _check(out)
    from tiltsim.figures.flight import flight_figure

    return flight_figure(flight)


def _sweep_figure(arguments: argparse.Namespace, out: Path) -> Figure:
    from tiltsim.sweeps.dataset import load_results

    results = load_results(arguments.flight)
    _check(out)
    from tiltsim.figures.sweep import sweep_figure

    return sweep_figure(results, tuple(arguments.metrics))


def _check(out: Path) -> None:
    from tiltsim.figures.style import FORMATS
    from tiltsim.files import prepare_file

    prepare_file("--out", out, FORMATS)
