"""``tiltsim gait``: analyzes the singularities of a gait."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from tiltsim.commands.angles import allow_negative_lists, parse_angle, parse_vehicle
from tiltsim.commands.figure_options import add_plot, check_plot, save_figure
from tiltsim.commands.options import Subparsers, add_json, add_vehicle
from tiltsim.commands.text import json_text, print_figure_path

if TYPE_CHECKING:
    from collections.abc import Callable

FIGURES: Final = ("roll_pitch", "comparison", "margin", "attainable", "determinant", "faults")
CASES: Final = ("equal", "half", "negative", "negative_half")

OPPOSITE_SPEED_RATIO: Final = 0.7
"""Speed of the rotor opposite a failed one, relative to hover, in the fault report."""


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Print rank and singular values of the torque matrix, the residuals R, R_phi and
    R_theta, the singularity margin and the singular attitudes of a gait; for a moving gait over one
    period."""
    summary = "analyze the singularities of a gait"
    parser = subparsers.add_parser("gait", help=summary, description=description)
    allow_negative_lists(parser)
    add = parser.add_argument
    add("scenario", nargs="?", metavar="SCENARIO", help="take gait and vehicle from a scenario")
    add("--angles", metavar="A1,A2,A3,A4", help="tilt angles in rad, instead of a scenario")
    mjcf = "the MJCF file of a vehicle of 4 to 16 rotors; --angles are those of its tilt hinges"
    add("--mjcf", metavar="FILE", help=mjcf)
    add("--published", metavar="NAME", help="a gait of the thesis, such as ch06_gait_3")
    balance = "the gait of least tilt that hovers level under an acceleration, m/s^2, world"
    add("--balance", metavar="AX,AY,AZ", help=balance)
    add("--list", action="store_true", help="list the thesis's gaits and their robustness claims")
    add_vehicle(parser)
    add("--roll", metavar="RAD", help="attitude to analyze (default: level)")
    add("--pitch", metavar="RAD")
    add("--faults", action="store_true", help="also print which rotor losses allow hovering")
    add_json(parser)
    add_plot(parser, "a figure", panels=True)
    figure = """roll_pitch (default); comparison, two roll-pitch diagrams, with and without bias;
    margin over a period; attainable torques, thrusts and accelerations (ch. 9); determinant
    surfaces and zero curves (ch. 3), without a gait; faults: rotor speeds that hover needs after a
    rotor loss, for any gait"""
    add("--figure", choices=FIGURES, help=figure)
    case = "for --figure determinant: relation of alpha_1 and alpha_3 (default: equal)"
    add("--case", choices=CASES, help=case)
    limits = """rotor speeds in rad/s: for --figure attainable (default: those of ch. 9), and with
    --mjcf (default: those of the file)"""
    add("--speed-limits", metavar="MIN,MAX", help=limits)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Analyze, draw, print."""
    from tiltsim.commands.multirotor_gait import flies_multirotor, run_multirotor

    if arguments.mjcf is not None:
        return run_multirotor(arguments)
    from tiltsim.commands.gait_figures import attainable_warnings, draw_gait
    from tiltsim.commands.gait_selection import select_gait
    from tiltsim.commands.gait_text import gait_text, list_text

    _check_options(arguments)
    if arguments.list:
        _print(arguments, _list_report(), list_text)
        return 0
    if arguments.figure == "determinant":
        return _run_determinant(arguments)
    if flies_multirotor(arguments.scenario):
        return run_multirotor(arguments)
    selected = select_gait(arguments)
    roll = None if arguments.roll is None else parse_angle("--roll", arguments.roll)
    pitch = None if arguments.pitch is None else parse_angle("--pitch", arguments.pitch)

    from tiltsim.studies.gait_analysis import fault_report, gait_report

    if arguments.plot is not None:
        kind, limits = arguments.figure, arguments.speed_limits
        draw = partial(draw_gait, selected, kind, limits, arguments.panels)
        save_figure(draw, arguments.plot, arguments)
    report = gait_report(selected.gait, selected.vehicle, roll=roll, pitch=pitch)
    if arguments.faults:
        a1, a2, a3, a4 = selected.gait.angles(0.0).tolist()
        opposite_speed = OPPOSITE_SPEED_RATIO * selected.vehicle.hover_rotor_speed
        report["faults"] = fault_report((a1, a2, a3, a4), selected.vehicle, opposite_speed)
    if arguments.figure == "attainable":
        report["warnings"] += attainable_warnings(selected, arguments.speed_limits)
    _print(arguments, report, gait_text)
    print_figure_path(arguments)
    return 0


def _check_options(arguments: argparse.Namespace) -> None:
    """Refuse incompatible options, and files that cannot be written."""
    from tiltsim.errors import InputError

    gaits = [arguments.scenario, arguments.angles, arguments.published, arguments.balance]
    given = sum(gait is not None for gait in gaits)
    kind = arguments.figure
    if arguments.list:
        others = [*gaits, arguments.vehicle, arguments.roll, arguments.pitch]
        others += [arguments.plot, kind, arguments.case, arguments.speed_limits]
        if any(other is not None for other in others):
            raise InputError("--list: takes no other option than --json")
    elif kind == "determinant":
        if given:
            raise InputError("--figure determinant: takes --case instead of a gait")
        if arguments.roll is not None or arguments.pitch is not None:
            raise InputError("--figure determinant: is drawn at level attitude")
    elif given != 1:
        raise InputError(
            "gait: give one of SCENARIO, --angles A1,A2,A3,A4, --published NAME and "
            "--balance AX,AY,AZ"
        )
    if kind is not None and arguments.plot is None:
        raise InputError(f"--figure {kind}: needs --plot FILE")
    if arguments.case is not None and kind != "determinant":
        raise InputError(f"--case {arguments.case}: needs --figure determinant")
    if arguments.speed_limits is not None and kind != "attainable":
        raise InputError("--speed-limits: needs --figure attainable")
    check_plot(arguments, has_panels=kind in (None, "roll_pitch"))


def _run_determinant(arguments: argparse.Namespace) -> int:
    """Draw the restrictions of ch. 3, Sec. 5.1, and print how far from singular they are."""
    from tiltsim.commands.gait_text import determinant_text
    from tiltsim.studies.gait_analysis import determinant_report
    from tiltsim.views.figures.determinant import determinant_figure

    vehicle, case = parse_vehicle(arguments.vehicle), arguments.case or "equal"
    save_figure(partial(determinant_figure, case, vehicle), arguments.plot, arguments)
    _print(arguments, determinant_report(case, vehicle), determinant_text)
    print_figure_path(arguments)
    return 0


def _print(arguments: argparse.Namespace, report: Any, text: Callable[[Any], str]) -> None:
    print(json_text(report) if arguments.json else text(report))


def _list_report() -> list[dict[str, Any]]:
    from dataclasses import asdict

    from tiltsim_controllers.analysis.published_gaits import robustness_table

    return [asdict(row) for row in robustness_table()]
