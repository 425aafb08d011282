"""``tiltsim map``: the Two Color Map of a vehicle, and checks of paths on it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tiltsim.commands.declaring import mistakes_in
from tiltsim.commands.gait_options import (
    DEFAULT_VEHICLE,
    VehicleOption,
    parse_angles,
    parse_vehicle,
    vehicle_text,
)
from tiltsim.commands.options import Json, PlotOptions, refuse_both
from tiltsim.commands.text import aligned, tally
from tiltsim.errors import InputError
from tiltsim.exit_codes import DONE, EXPECTATION_FAILED
from tiltsim.views import figures

if TYPE_CHECKING:
    from tiltsim_controllers.analysis.two_color_planner import Circle, Polyline
    from tiltsim_controllers.vehicle.parameters import Vehicle


def run(
    *,
    vehicle: VehicleOption = None,
    leg: tuple[tuple[str, ...], ...] = (),
    circle: tuple[str, str, str] | None = None,
    json: Json = False,
    figure: PlotOptions,
) -> int:
    """Print the Two Color Map of a vehicle, and check a path with --leg or --circle.

    The map has delta, P, the exact red and blue lines, the curve L and the grid search of ch. 6.

    Note:
        exit codes: 0 done, 1 both theorems reject the path, or it is singular although they accept
        it, as every blue path is, 2 invalid input

    Args:
        leg (WORD): COLOR A1,A2 A1,A2 ...: part of a closed path, vertices in rad or P; repeatable
        circle (COLOR A1,A2 RADIUS): a circular path: center and radius in rad
    """
    from tiltsim.studies.gait_analysis import map_report

    figure.check()
    refuse_both(leg=leg, circle=circle)
    parameters = vehicle or parse_vehicle(DEFAULT_VEHICLE)
    path = _path(leg, circle, parameters)
    with mistakes_in("path" if path else f"--vehicle {vehicle_text(parameters._asdict())}"):
        report = map_report(parameters, path)

    paths = [("path", path)] if path else None
    figure.show(
        lambda: figures.gaits.map_figure(parameters, paths), report, _summary(report), json=json
    )
    return DONE if path is None or report["path"]["sound"] else EXPECTATION_FAILED


def _path(
    legs: tuple[tuple[str, ...], ...], circle: tuple[str, str, str] | None, vehicle: Vehicle
) -> Polyline | Circle | None:
    from tiltsim_controllers.analysis.two_color_map import point_p
    from tiltsim_controllers.analysis.two_color_planner import Circle, Leg, Polyline
    from tiltsim_controllers.gaits.colors import COLORS

    def color(option: str, name: str) -> str:
        if name not in COLORS:
            raise InputError(f"{option} {name}: unknown color; choose {', '.join(COLORS)}")
        return name

    def read(option: str, text: str, count: int) -> Any:
        with mistakes_in(f"{option} {text}"):
            return parse_angles(text, count)

    if circle is not None:
        name, center, size = circle
        (radius,) = read("--circle radius", size, 1)
        return Circle(color("--circle", name), read("--circle center", center, 2), radius)
    if not legs:
        return None
    at_p = point_p(vehicle)
    return Polyline(
        tuple(
            Leg(
                color("--leg", name),
                tuple(at_p if text == "P" else read("--leg", text, 2) for text in vertices),
            )
            for name, *vertices in legs
        )
    )


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
    lines = [*aligned(rows), *(f"warning: {text}" for text in report["warnings"])]
    path = report.get("path")
    if path is not None:
        if path["accepted"]:
            lines.append(f"path: accepted by the {path['theorem']} theorem")
        lines += [f"path: rejected: {reason}" for reason in path["reasons"]]
        lines += [f"path: singular: {text}" for text in path["warnings"]]
    return "\n".join(lines)
