"""``tiltsim gait``: the singularities of a gait."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tiltsim.commands.angles import (
    allow_negative_lists,
    parse_angle,
    parse_angles,
    parse_speed_limits,
    parse_vehicle,
    vehicle_text,
)
from tiltsim.commands.text import aligned, json_text, number, numbers, print_figure_path, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim_controllers.gaits.plans import Gait
    from tiltsim_controllers.vehicle.parameters import Vehicle

FIGURES: Final = ("roll_pitch", "comparison", "margin", "attainable", "determinant", "faults")
CASES: Final = ("equal", "half", "negative", "negative_half")


@dataclass(frozen=True)
class _Chosen:
    """The gait to analyze, its vehicle, and the gait it is compared with, if any."""

    gait: Gait
    vehicle: Vehicle
    title: str = "gait"
    twin: Gait | None = None
    twin_title: str = ""


OPPOSITE_SHARE: Final = 0.7
"""Speed of the rotor opposite a lost one, over that of hover, in the report on faults."""

CURVES: Final = {
    "graph": "one pitch for each roll",
    "vertical": "two rolls, at any pitch",
    "none": "none: no attitude is out of reach",
    "everywhere": "every attitude",
}
"""Shapes of the unacceptable-attitude curve in words."""


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "gait",
        help="analyze the singularities of a gait",
        description=(
            "Rank and singular values of the torque matrix, the residuals R, R_phi and R_theta, "
            "the singularity margin and the unacceptable attitudes of a gait; over one period, if "
            "it moves."
        ),
    )
    allow_negative_lists(parser)
    parser.add_argument(
        "scenario", nargs="?", metavar="SCENARIO", help="a scenario, for its gait and vehicle"
    )
    parser.add_argument(
        "--angles", metavar="A1,A2,A3,A4", help="tilt angles in rad, instead of a scenario"
    )
    parser.add_argument(
        "--published", metavar="NAME", help="a gait of the thesis, such as ch06_gait_3"
    )
    parser.add_argument(
        "--balance",
        metavar="AX,AY,AZ",
        help="find the least tilted gait that hovers level under this acceleration, m/s^2, world",
    )
    parser.add_argument(
        "--list",
        action="store_true",
        help="the gaits of the thesis and where its robustness claims hold",
    )
    parser.add_argument(
        "--vehicle",
        metavar="VEHICLE",
        help="ar_drone_2 (default), luukkonen, KEY=VALUE,..., or a preset with KEY=VALUE,...",
    )
    parser.add_argument("--roll", metavar="RAD", help="attitude to analyze, default level")
    parser.add_argument("--pitch", metavar="RAD")
    parser.add_argument(
        "--faults", action="store_true", help="also which losses of a rotor the vehicle hovers with"
    )
    parser.add_argument("--json", action="store_true", help="machine-readable")
    parser.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw a figure: FILE.png, .svg or .pdf"
    )
    parser.add_argument(
        "--figure",
        choices=FIGURES,
        help=(
            "what to draw: roll_pitch (default); comparison, two roll-pitch diagrams, with and "
            "without bias; margin over a period; attainable torques, thrusts and accelerations "
            "(ch. 9); determinant surfaces and zero curves (ch. 3), which need no gait; faults: "
            "rotor speeds that hover needs after one, whatever the gait"
        ),
    )
    parser.add_argument(
        "--case",
        choices=CASES,
        help="of the determinant figure: how alpha_1 goes with alpha_3 (default: equal)",
    )
    parser.add_argument(
        "--speed-limits",
        metavar="LEAST,GREATEST",
        help="of the attainable figure: rotor speeds in rad/s (default: those of ch. 9)",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Analyze, print, draw."""
    _check_options(arguments)
    if arguments.list:
        _print(arguments, _list_report(), _list_text)
        return 0
    if arguments.figure == "determinant":
        return _run_determinant(arguments)
    chosen = _choose(arguments)
    roll = None if arguments.roll is None else parse_angle("--roll", arguments.roll)
    pitch = None if arguments.pitch is None else parse_angle("--pitch", arguments.pitch)

    from tiltsim.studies.gait_analysis import fault_report, gait_report

    if arguments.plot is not None:
        from tiltsim.views.figures.style import save

        save(_draw(arguments, chosen), arguments.plot)
    report = gait_report(chosen.gait, chosen.vehicle, roll=roll, pitch=pitch)
    if arguments.faults:
        a1, a2, a3, a4 = chosen.gait.angles(0.0).tolist()
        opposite_speed = OPPOSITE_SHARE * chosen.vehicle.hover_rotor_speed
        report["faults"] = fault_report((a1, a2, a3, a4), chosen.vehicle, opposite_speed)
    if arguments.figure == "attainable":
        report["warnings"] += _attainable_warnings(arguments, chosen)
    _print(arguments, report, _summary)
    print_figure_path(arguments)
    return 0


def _check_options(arguments: argparse.Namespace) -> None:
    """Refuse what does not go together, and files that cannot be written."""
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
        raise InputError(f"--case {arguments.case}: goes with --figure determinant")
    if arguments.speed_limits is not None and kind != "attainable":
        raise InputError("--speed-limits: goes with --figure attainable")
    if arguments.plot is not None:
        from tiltsim.system.files import prepare_file
        from tiltsim.views.figures.style import FORMATS

        prepare_file("--plot", arguments.plot, FORMATS)


def _choose(arguments: argparse.Namespace) -> _Chosen:
    """The gait and the vehicle that the arguments name."""
    from tiltsim.errors import InputError
    from tiltsim_controllers.gaits import plans
    from tiltsim_controllers.vehicle.parameters import Vehicle

    if arguments.scenario is not None:
        if arguments.vehicle is not None:
            raise InputError("--vehicle: the scenario has a vehicle of its own; leave one out")
        from tiltsim.scenario.loading import load_scenario

        scenario = load_scenario(arguments.scenario)
        vehicle = scenario.vehicle.resolve()
        if not isinstance(vehicle, Vehicle):
            raise InputError(
                f"{arguments.scenario}: vehicle.model = {scenario.vehicle.model!r}: has no gait of "
                "four tilt angles to analyze"
            )
        gait = replace(scenario.gait.plan(vehicle), source=scenario.source)
        if scenario.gait.bias == 1.0:
            return _Chosen(gait, vehicle, gait.name)
        unbiased = scenario.gait.model_copy(update={"bias": 1.0}).plan(vehicle)
        return _Chosen(gait, vehicle, gait.name, unbiased, "without bias")
    vehicle = parse_vehicle(arguments.vehicle)
    if arguments.angles is not None:
        return _Chosen(plans.fixed(parse_angles("--angles", arguments.angles)), vehicle)
    if arguments.balance is not None:
        return _Chosen(_balanced(arguments.balance, vehicle), vehicle)
    from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS

    if arguments.published not in PUBLISHED_GAITS:
        raise InputError(
            f"--published {arguments.published}: unknown; choose {', '.join(PUBLISHED_GAITS)}"
        )
    published = PUBLISHED_GAITS[arguments.published]
    title = f"{published.key}, as printed" if published.printed else published.key
    twin_title = "" if published.bias is None else f"biased, η = {published.bias:.0%}"
    return _Chosen(published.gait, vehicle, title, published.biased, twin_title)


def _draw(arguments: argparse.Namespace, chosen: _Chosen) -> Figure:
    """The figure of a gait that the arguments name."""
    from tiltsim.errors import InputError
    from tiltsim.views.figures import attainable, faults, gait

    compared = [(chosen.title, chosen.gait)]
    if chosen.twin is not None:
        compared.append((chosen.twin_title, chosen.twin))
    kind = arguments.figure or "roll_pitch"
    if kind == "comparison" and len(compared) == 1:
        raise InputError(f"--figure comparison: {chosen.gait.name} has no bias to compare with")
    if kind == "faults":
        return faults.fault_figure(chosen.vehicle)
    if kind == "attainable":
        if not chosen.gait.is_constant:
            raise InputError(f"--figure attainable: {chosen.gait.name} moves; give fixed angles")
        limits = _speed_limits(arguments, chosen)
        return attainable.attainable_figure(chosen.gait, chosen.vehicle, limits)
    if kind == "comparison":
        return gait.comparison_figure(compared, chosen.vehicle)
    if kind == "margin":
        return gait.margin_figure(compared, chosen.vehicle)
    return gait.gait_figure(chosen.gait, chosen.vehicle)


def _speed_limits(arguments: argparse.Namespace, chosen: _Chosen) -> tuple[float, float]:
    """Least and greatest rotor speed (rad/s) of the attainable figure."""
    from tiltsim_controllers.analysis.attainable import published_speed_limits

    if arguments.speed_limits is None:
        return published_speed_limits(chosen.vehicle)
    return parse_speed_limits(arguments.speed_limits)


def _attainable_warnings(arguments: argparse.Namespace, chosen: _Chosen) -> list[str]:
    """What an empty attainable figure means."""
    from tiltsim_controllers.analysis.attainable import attainable_torque_thrust

    limits = _speed_limits(arguments, chosen)
    if not attainable_torque_thrust(chosen.gait.angles(0.0), chosen.vehicle, limits).is_empty:
        return []
    return [
        f"nothing is attainable: no rotor speeds from {limits[0]:.2f} to {limits[1]:.2f} rad/s "
        "hover without yaw torque; the figure holds a sentence alone"
    ]


def _run_determinant(arguments: argparse.Namespace) -> int:
    """The restrictions of ch. 3, Sec. 5.1: a figure, and how far from singular they are."""
    from tiltsim.studies.gait_analysis import determinant_report
    from tiltsim.views.figures.determinant import determinant_figure
    from tiltsim.views.figures.style import save

    vehicle, case = parse_vehicle(arguments.vehicle), arguments.case or "equal"
    save(determinant_figure(case, vehicle), arguments.plot)
    _print(arguments, determinant_report(case, vehicle), _determinant_text)
    print_figure_path(arguments)
    return 0


def _print(arguments: argparse.Namespace, report: Any, text: Any) -> None:
    print(json_text(report) if arguments.json else text(report))


def _list_report() -> list[dict[str, Any]]:
    from dataclasses import asdict

    from tiltsim_controllers.analysis.published_gaits import robustness_table

    return [asdict(row) for row in robustness_table()]


def _list_text(report: list[dict[str, Any]]) -> str:
    header = ["gait", "color", "angles", "margin", "exact", "biased", "condition", "claim"]
    claims = {True: "yes", False: "no", None: "-"}
    rows = [
        (
            row["key"],
            row["color"] or "-",
            "printed" if row["printed"] else "ours",
            number(row["margin"], ".4f"),
            number(row["margin_exact"], ".4f"),
            "-" if row["margin_biased"] is None else number(row["margin_biased"], ".4f"),
            number(row["conditioning"], ".2e") if row["conditioning"] > 1e-12 else "0",
            claims[row["claim_holds"]],
        )
        for row in report
    ]
    return "\n".join(
        [
            table(header, rows, frozenset({3, 4, 5, 6})),
            "",
            "margin: smallest over a period at level attitude, rad; below 0: R changes sign",
            "exact: the same on the exact lines of the color; biased: of the biased twin",
            "condition: smallest over largest singular value of tau, on the exact lines",
            "claim: more robust than the biased twin, and not singular itself",
        ]
    )


def _determinant_text(report: dict[str, Any]) -> str:
    rows = [
        (number(pair["alpha_1"]), number(pair["alpha_3"]), number(pair["least_R"]))
        for pair in report["pairs"]
    ]
    header = ("alpha_1 (rad)", "alpha_3 (rad)", "least R in the triangle U V M")
    return table(header, rows, frozenset({0, 1, 2}))


def _balanced(text: str, vehicle: Vehicle) -> Gait:
    """The gait that balances an acceleration, given as ``AX,AY,AZ``."""
    from tiltsim.errors import InputError
    from tiltsim_controllers.analysis.balance import balanced_gait
    from tiltsim_controllers.gaits import plans

    try:
        ax, ay, az = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--balance {text}: must be three numbers, m/s^2") from None
    try:
        angles = balanced_gait((ax, ay, az), vehicle)
    except ValueError as error:
        raise InputError(f"--balance {text}: {error}") from None
    return replace(plans.fixed(angles), source=f"balances {text} m/s^2 at level attitude")


def _summary(report: dict[str, Any]) -> str:
    """The report in aligned lines; what moves is given at time zero and as its worst."""
    direction = report["torque_free_direction"]
    at_start = " at the gait's start" if "time" in report else ""
    rows = [
        ("gait", report["gait"] + (f" ({report['source']})" if report["source"] else "")),
        ("vehicle", vehicle_text(report["vehicle"])),
        ("tilt angles", numbers(report["angles"]) + " rad"),
        ("rank of tau", str(report["rank"])),
        ("singular values", numbers(report["singular_values"]) + " of tau / (L K_f)"),
        ("R, R_phi, R_theta", numbers([report["R"], report["R_phi"], report["R_theta"]])),
        ("torque-free force", "along " + numbers(direction) if direction else "none"),
        ("singularity margin", f"{number(report['singularity_margin'])} rad{at_start}"),
        (
            "acceptable share",
            f"{100.0 * report['acceptable_share']:.2f} % of the roll-pitch square",
        ),
        ("unacceptable curve", CURVES[report["unacceptable_attitudes"]["kind"]]),
    ]
    if "determinant" in report:
        attitude = f"roll {number(report['roll'])}, pitch {number(report['pitch'])} rad"
        rows.insert(8, ("determinant", f"{number(report['determinant'])} at {attitude}"))
    if report["hover_rotor_speeds"] is not None:
        speeds = numbers(report["hover_rotor_speeds"])
        rows.append(("hover rotor speeds", f"{speeds} rad/s along the spins"))
    if "time" in report:
        rate = "jumps" if report["max_rate"] is None else f"{report['max_rate']:.6g} rad/s"
        rows += [
            ("period", f"{report['period']:g} s; the values above are those at t = 0"),
            ("largest tilt angle", f"{report['amplitude']:.6g} rad"),
            ("largest rate", rate),
            ("least rank", str(report["min_rank"])),
            ("least margin", f"{number(report['min_singularity_margin'])} rad over the period"),
            ("", "its sign counts from the gait's start: negative once R has changed sign"),
        ]
    if "faults" in report:
        for loss in report["faults"]["rotor_loss"]:
            free = loss["free_tilts"]
            fixed = (
                "these tilts hover, without control"
                if loss["hovers_with_fixed_tilts"]
                else f"these tilts miss a hover by {number(loss['fixed_tilts_miss'])} rad"
            )
            rows.append(
                (
                    f"without rotor {loss['rotor']}",
                    f"{fixed}; free tilts hover from {loss['least_speed']:.4g} rad/s on, as at "
                    f"{numbers(free['angles'])} rad",
                )
            )
    return "\n".join([*aligned(rows), *(f"warning: {text}" for text in report["warnings"])])
