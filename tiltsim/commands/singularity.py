"""``tiltsim singularity``: a quadrotor's published and exact determinants."""

from __future__ import annotations

import argparse
import json
from functools import partial
from typing import TYPE_CHECKING, Any

from tiltsim.commands.angles import allow_negative_lists, parse_angle, parse_vehicle
from tiltsim.commands.figure_options import add_plot, check_plot, save_figure
from tiltsim.commands.options import Subparsers, add_json
from tiltsim.commands.text import aligned, print_figure_path

if TYPE_CHECKING:
    from tiltsim_controllers.vehicle.parameters import Vehicle


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Compare ch. 2's determinant surface S(theta, phi) of yaw-position control and
    its singular curve with the exact determinant, which is not zero in hover up to 90 degrees."""
    summary = "compare the quadrotor's published and exact determinants"
    parser = subparsers.add_parser("singularity", help=summary, description=description)
    allow_negative_lists(parser)
    parser.add_argument("vehicle_model", metavar="quadrotor", choices=("quadrotor",))
    parser.add_argument("--vehicle", metavar="PRESET", help="default: ar_drone_2_unrounded")
    parser.add_argument(
        "--roll", metavar="RAD", default="0", help="attitude to evaluate (default 0)"
    )
    parser.add_argument("--pitch", metavar="RAD", default="0")
    add_json(parser)
    add_plot(parser, "surfaces, curve and zone")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Compute, draw, print."""
    vehicle = parse_vehicle(arguments.vehicle or "ar_drone_2_unrounded")
    attitude = (parse_angle("--roll", arguments.roll), parse_angle("--pitch", arguments.pitch))
    check_plot(arguments)
    report = _report(vehicle, *attitude)
    if arguments.plot is not None:
        from tiltsim.views.figures.quadrotor_singularity import singularity_figure

        save_figure(partial(singularity_figure, vehicle), arguments.plot, arguments)
    print(json.dumps(report, indent=2) if arguments.json else _summary(report))
    print_figure_path(arguments)
    return 0


def _report(vehicle: Vehicle, roll: float, pitch: float) -> dict[str, Any]:
    from math import asin, cos

    from tiltsim_controllers.analysis.quadrotor_singularity import (
        exact_determinant,
        normalized_determinant,
        published_determinant,
        published_singular_curve,
    )
    from tiltsim_controllers.laws.switching import PUBLISHED_ZONE

    hover = vehicle.mass * vehicle.gravity
    curve_roll, curve_pitch = published_singular_curve()
    on_curve = normalized_determinant(curve_roll, curve_pitch, hover, vehicle)
    return {
        "vehicle": vehicle._asdict(),
        "roll": roll,
        "pitch": pitch,
        "published_determinant": float(published_determinant(roll, pitch)),
        "exact_determinant": float(exact_determinant(roll, pitch, hover, vehicle)),
        "normalized_determinant": float(normalized_determinant(roll, pitch, hover, vehicle)),
        "singularity_margin": asin(cos(roll) * cos(pitch)),
        "published_zone": PUBLISHED_ZONE._asdict(),
        "exact_on_published_curve": {"min": float(on_curve.min()), "max": float(on_curve.max())},
        "published_curve": {
            "roll": (curve_roll + 0.0).tolist(),  # no negative zeros
            "pitch": (curve_pitch + 0.0).tolist(),
        },
    }


def _summary(report: dict[str, Any]) -> str:
    zone, on_curve = report["published_zone"], report["exact_on_published_curve"]
    curve = report["published_curve"]
    rows = [
        ("attitude", f"roll {report['roll']:g}, pitch {report['pitch']:g} rad"),
        ("published determinant S", f"{report['published_determinant']:.6g}"),
        ("exact determinant", f"{report['normalized_determinant']:.6g} of that in level hover"),
        ("singularity margin", f"{report['singularity_margin']:.6g} rad, exact"),
        (
            "published curve S = 0",
            f"roll {min(curve['roll']):.4g} to {max(curve['roll']):.4g}, "
            f"pitch {min(curve['pitch']):.4g} to {max(curve['pitch']):.4g} rad",
        ),
        ("exact on that curve", f"{on_curve['min']:.6g} to {on_curve['max']:.6g}, never singular"),
        (
            "published zone",
            f"roll {zone['roll_min']:.4g} to {zone['roll_max']:.4g}, "
            f"pitch {zone['pitch_min']:.4g} to {zone['pitch_max']:.4g} rad",
        ),
    ]
    return "\n".join(aligned(rows))
