"""``tiltsim plot``: the figure of a flight."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Final

FORMATS: Final = (".png", ".svg", ".pdf")


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "plot",
        help="draw a flight as a figure",
        description=(
            "Draw a flight on one page: attitude, altitude, position error, tilt angles, rotor "
            "speeds, singularity margin, path over the ground, roll-pitch plane."
        ),
    )
    parser.add_argument(
        "flight", type=Path, metavar="FLIGHT", help="a folder of results, or a flight.parquet"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="PNG, SVG or PDF by its ending (default: flight.png beside the flight)",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Draw and save."""
    from tiltsim.errors import InputError
    from tiltsim.files import load_flight, prepare_file

    flight = load_flight(arguments.flight)
    folder = arguments.flight if arguments.flight.is_dir() else arguments.flight.parent
    out = arguments.out or folder / "flight.png"
    if out.suffix.lower() not in FORMATS:
        allowed = ", ".join(FORMATS)
        raise InputError(f"--out {out}: unknown format {out.suffix!r}; choose {allowed}")
    prepare_file("--out", out)

    from tiltsim.figures.flight import flight_figure
    from tiltsim.figures.style import save

    save(flight_figure(flight), out)
    print(f"figure written to {out}")
    return 0
