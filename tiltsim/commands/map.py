"""``tiltsim map``: the Two Color Map of a vehicle, and checks of paths on it."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any

from tiltsim.commands.angles import (
    allow_negative_lists,
    parse_angle,
    parse_angles,
    parse_vehicle,
    vehicle_text,
)
from tiltsim.commands.figure_options import add_plot, check_plot, save_figure
from tiltsim.commands.options import Subparsers, add_json, add_vehicle
from tiltsim.commands.text import aligned, json_text, print_figure_path, tally
from tiltsim.exit_codes import DONE, EXPECTATION_FAILED

if TYPE_CHECKING:
    from tiltsim_controllers.analysis.two_color_planner import Circle, Polyline
    from tiltsim_controllers.vehicle.parameters import Vehicle


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Print the Two Color Map of a vehicle: delta, P, the exact red and blue lines,
    the curve L and the grid search of ch. 6. With --leg or --circle, also check a path."""
    parser = subparsers.add_parser(
        "map",
        help="draw the Two Color Map and check a path on it",
        description=description,
        epilog="exit codes: 0 done, 1 both theorems reject the path, or it is singular although "
        "they accept it, as every blue path is, 2 invalid input",
    )
    allow_negative_lists(parser)
    add_vehicle(parser)
    leg = "COLOR A1,A2 A1,A2 ...: part of a closed path, vertices in rad or P; repeatable"
    parser.add_argument("--leg", action="append", nargs="+", metavar="WORD", help=leg)
    circle = "a circular path: centre and radius in rad"
    parser.add_argument("--circle", nargs=3, metavar=("COLOR", "A1,A2", "RADIUS"), help=circle)
    add_json(parser)
    add_plot(parser, "the map")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Compute, draw, print."""
    from tiltsim.errors import InputError
    from tiltsim.studies.gait_analysis import map_report

    check_plot(arguments)
    vehicle = parse_vehicle(arguments.vehicle)
    path = _path(arguments, vehicle)
    try:
        report = map_report(vehicle, path)
    except ValueError as error:
        place = "path" if path is not None else f"--vehicle {arguments.vehicle}"
        raise InputError(f"{place}: {error}") from None
    if arguments.plot is not None:
        from tiltsim.views.figures.two_color_map import map_figure

        draw = partial(map_figure, vehicle, [("path", path)] if path else None)
        save_figure(draw, arguments.plot, arguments)
    print(json_text(report) if arguments.json else _summary(report))
    print_figure_path(arguments)
    return DONE if path is None or report["path"]["sound"] else EXPECTATION_FAILED


def _path(arguments: argparse.Namespace, vehicle: Vehicle) -> Polyline | Circle | None:
    from tiltsim.errors import InputError
    from tiltsim_controllers.analysis.two_color_planner import Circle, Leg, Polyline

    if arguments.leg and arguments.circle:
        raise InputError("map: give either --leg or --circle")
    if arguments.circle:
        color, centre, radius = arguments.circle
        size = parse_angle("--circle radius", radius)
        first, second = parse_angles("--circle centre", centre, 2)
        return Circle(_color("--circle", color), (first, second), size)
    if not arguments.leg:
        return None
    return Polyline(
        tuple(
            Leg(_color("--leg", color), tuple(_vertex(text, vehicle) for text in vertices))
            for color, *vertices in arguments.leg
        )
    )


def _vertex(text: str, vehicle: Vehicle) -> tuple[float, float]:
    from tiltsim_controllers.analysis.two_color_map import point_p

    if text == "P":
        return point_p(vehicle)
    first, second = parse_angles("--leg", text, 2)
    return first, second


def _color(option: str, name: str) -> str:
    from tiltsim.errors import InputError
    from tiltsim_controllers.gaits.two_color import COLORS

    if name not in COLORS:
        raise InputError(f"{option} {name}: unknown color; choose {', '.join(COLORS)}")
    return name


def _summary(report: dict[str, Any]) -> str:
    blue = report["blue"]
    counts = report["roots"]["count"]
    rows = [
        ("vehicle", vehicle_text(report["vehicle"])),
        ("delta = atan(K_m / (L K_f))", f"{report['delta']:.9g} rad"),
        ("P", f"({report['P'][0]:.9g}, {report['P'][1]:.9g}) rad, on the curve L"),
        ("red", "alpha_3 = alpha_1, alpha_4 = alpha_2"),
        (
            "blue",
            f"alpha_3 = -alpha_1 + {blue['alpha_3']['offset']:.9g}, "
            f"alpha_4 = -alpha_2 - {-blue['alpha_4']['offset']:.9g}",
        ),
        ("L", f"tan alpha_2 = tan alpha_1 - {2.0 * report['drag_ratio']:.9g}"),
        (
            "roots on the 17 x 17 grid",
            f"{counts[8][8]} inside, {counts[0][8]} on sides, {counts[0][0]} in corners",
        ),
        ("their classes", tally(report["roots"]["classes"])),
    ]
    lines = aligned(rows)
    lines += [f"warning: {text}" for text in report["warnings"]]
    if "path" in report:
        path = report["path"]
        if path["accepted"]:
            lines.append(f"path: accepted by the {path['theorem']} theorem")
        lines += [f"path: rejected: {reason}" for reason in path["reasons"]]
        lines += [f"path: singular: {text}" for text in path["warnings"]]
    return "\n".join(lines)
