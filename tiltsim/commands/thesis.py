"""``tiltsim map``, ``singularity``, ``concepts`` and ``report``: the thesis, drawn and compared."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from tiltsim.commands.declaring import mistakes_in
from tiltsim.commands.gait_options import (
    DEFAULT_VEHICLE,
    Pitch,
    Roll,
    VehicleOption,
    parse_angles,
    parse_vehicle,
    vehicle_text,
)
from tiltsim.commands.options import CORES, Jobs, Json, PlotOptions, Quiet, Trust, refuse_both
from tiltsim.commands.text import aligned, print_line, show_progress, tally
from tiltsim.errors import DONE, EXPECTATION_FAILED, InputError
from tiltsim.views import figures

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from tiltsim.flight.flight import Flight
    from tiltsim_controllers.analysis.two_color_planner import Circle, Polyline
    from tiltsim_controllers.vehicle.parameters import Vehicle


def run_map(
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

    refuse_both(leg=leg, circle=circle)
    parameters = vehicle or parse_vehicle(DEFAULT_VEHICLE)
    path = _path(leg, circle, parameters)
    with mistakes_in("path" if path else f"--vehicle {vehicle_text(parameters._asdict())}"):
        report = map_report(parameters, path)

    paths = [("path", path)] if path else None
    figure.show(
        lambda: figures.gaits.map_figure(parameters, paths), report, _map_text(report), json=json
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


def _map_text(report: dict[str, Any]) -> str:
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


def run_singularity(
    vehicle_model: Literal["quadrotor"],
    *,
    vehicle: VehicleOption = None,
    roll: Roll = None,
    pitch: Pitch = None,
    json: Json = False,
    figure: PlotOptions,
) -> int:
    """Compare ch. 2's determinant of yaw-position control with the exact one.

    Ch. 2 has a surface S(theta, phi) and a singular curve. The exact determinant is not zero in
    hover up to 90 degrees.

    Args:
        vehicle_model (quadrotor): the only vehicle of ch. 2
        vehicle (PRESET): default: ar_drone_2_unrounded
    """
    parameters = vehicle or parse_vehicle("ar_drone_2_unrounded")
    report = _singularity_report(parameters, roll or 0.0, pitch or 0.0)

    figure.show(
        lambda: figures.vehicles.singularity_figure(parameters),
        report,
        _singularity_text(report),
        json=json,
    )
    return 0


def _singularity_report(vehicle: Vehicle, roll: float, pitch: float) -> dict[str, Any]:
    from math import asin, cos

    from tiltsim_controllers.analysis.singularity import (
        exact_determinant,
        normalized_determinant,
        published_determinant,
        published_singular_curve,
    )
    from tiltsim_controllers.laws.quadrotor import PUBLISHED_ZONE

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
        "published_zone": {
            f"{angle}_{side}": bound
            for angle, bounds in PUBLISHED_ZONE
            for side, bound in zip(("min", "max"), bounds, strict=True)
        },
        "exact_on_published_curve": {"min": float(on_curve.min()), "max": float(on_curve.max())},
        "published_curve": {
            "roll": (curve_roll + 0.0).tolist(),  # no negative zeros
            "pitch": (curve_pitch + 0.0).tolist(),
        },
    }


def _singularity_text(report: dict[str, Any]) -> str:
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


DECOUPLER_FLIGHTS: Final = {
    "conventional": "ch04_tracking/setpoint#rho_065_conventional",
    "modified": "ch04_tracking/setpoint#rho_065_modified",
    "exact": "beyond/setpoint_exact_decoupler#rho_065",
}
"""Addresses of the flights that show the decouplers."""


def run_concepts(*, out: Path = Path("concepts")) -> int:
    """Draw the pictures of docs/concepts.md.

    They show the vehicle with its axes and signs, gaits, decouplers (flown), singular attitudes and
    their margin, red and blue gaits.

    Args:
        out (DIR): folder for the SVG files concepts_*.svg (default: concepts)
    """
    from tiltsim.system.files import prepare_folder

    prepare_folder(out)
    with show_progress(shown=True) as progress:
        for name, draw in drawings().items():
            progress.begin(f"drawing {name}")
            file = out / f"concepts_{name}.svg"
            figures.style.save(draw(), file)
            progress.print(f"figure written to {file}")
    return 0


def drawings() -> dict[str, Callable[[], Figure]]:
    """The pictures by their names, in the order of the page."""
    concepts = figures.concepts
    return {
        "vehicle": concepts.vehicle_figure,
        "gaits": concepts.gait_figure,
        "decouplers": lambda: concepts.decoupler_figure(fly_decouplers()),
        "attitudes": concepts.attitude_figure,
        "colors": concepts.color_figure,
    }


def fly_decouplers() -> dict[str, Flight]:
    """The flights that show the decouplers, by their names."""
    from tiltsim.scenario.loading import load_scenario
    from tiltsim.simulation.simulate import simulate_to_end

    return {name: simulate_to_end(load_scenario(at)) for name, at in DECOUPLER_FLIGHTS.items()}


def run_report(
    paths: tuple[str, ...] = (),
    *,
    out: Path = Path("report"),
    markdown: Path | None = None,
    errors: Path | None = None,
    jobs: Jobs = CORES,
    trust: Trust = False,
    quiet: Quiet = False,
) -> int:
    """Fly scenarios on both plants, check every published claim, and write one HTML page.

    The page is self-contained. Flights are cached: a second report takes seconds, and an
    interrupted one continues.

    Note:
        exit codes: 0 done, 1 an expectation of a scenario failed, 2 invalid input

    Args:
        paths (PATH): files, folders or library names; default: the library and all claims
        out (DIR): folder for report.html, rows.csv, rows.json and the cached flights (default:
            report)
        markdown (FILE): also write a summary
        errors (FILE): also write the list of errors, as Markdown
        quiet: print only what failed
    """
    with show_progress(shown=not quiet) as progress:
        from tiltsim.report.claim_rows import count
        from tiltsim.report.content import failure_text
        from tiltsim.report.flights import store
        from tiltsim.report.making import Made, make_report
        from tiltsim.report.pages import errors_page, page, rows_csv, rows_json
        from tiltsim.report.pages import markdown as markdown_of
        from tiltsim.scenario.own_parts import VARIABLE
        from tiltsim.system.files import prepare_file, prepare_folder

        if trust:
            os.environ[VARIABLE] = "1"  # its processes load the scenarios again
        target = out / "report.html"
        prepare_folder(out)
        prepare_file("--out", target)
        for option, file in (("--markdown", markdown), ("--errors", errors)):
            if file is not None:
                prepare_file(option, file)
        report = make_report([*paths], out / "kept", jobs, progress.tell)
        progress.begin("writing the page")
        store(target, page(report, Made.now()).encode())
        store(out / "rows.csv", rows_csv(report).encode())
        store(out / "rows.json", rows_json(report).encode())
        if markdown is not None:
            store(markdown, markdown_of(report).encode())
        if errors is not None:
            store(errors, errors_page(report).encode())
    if not quiet:
        counts = sorted(count(report.rows).items(), key=lambda item: item[0].rank)
        print(f"{len(report.rows)} rows: {tally({kind.value: number for kind, number in counts})}")
    for failure in report.failures:
        print_line(f"FAILED  {failure_text(failure)}")
    if not quiet:
        print_line(f"report written to {target}")
    return EXPECTATION_FAILED if report.failures else DONE
