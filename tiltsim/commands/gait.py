"""``tiltsim gait``: the singularities of a gait."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tiltsim.commands.angles import allow_negative_lists, parse_angle, parse_angles, parse_vehicle

if TYPE_CHECKING:
    from controllers.gaits.plans import Gait
    from controllers.vehicle import Vehicle


def add_parser(subparsers: Any) -> None:
    """Declare the command."""
    parser = subparsers.add_parser(
        "gait",
        help="analyse the singularities of a gait",
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
    parser.add_argument("--vehicle", metavar="PRESET", help="ar_drone_2 (default) or luukkonen")
    parser.add_argument("--roll", metavar="RAD", help="attitude to analyse, default level")
    parser.add_argument("--pitch", metavar="RAD")
    parser.add_argument("--json", action="store_true", help="machine-readable")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw the roll-pitch diagram")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Analyse, print, draw."""
    gait, vehicle = _choose(arguments)
    roll = None if arguments.roll is None else parse_angle("--roll", arguments.roll)
    pitch = None if arguments.pitch is None else parse_angle("--pitch", arguments.pitch)

    from tiltsim.analysis import gait_report

    report = gait_report(gait, vehicle, roll=roll, pitch=pitch)
    if arguments.plot is not None:
        from tiltsim.figures.gait import gait_figure
        from tiltsim.figures.style import save

        save(gait_figure(gait, vehicle), arguments.plot)
    print(json.dumps(report, indent=2, allow_nan=False) if arguments.json else _summary(report))
    return 0


def _choose(arguments: argparse.Namespace) -> tuple[Gait, Vehicle]:
    """The gait and the vehicle that the arguments name."""
    from controllers.gaits import plans
    from tiltsim.errors import InputError

    sources = [arguments.scenario, arguments.angles, arguments.published, arguments.balance]
    if sum(source is not None for source in sources) != 1:
        raise InputError(
            "gait: give one of SCENARIO, --angles A1,A2,A3,A4, --published NAME and "
            "--balance AX,AY,AZ"
        )
    if arguments.scenario is not None:
        if arguments.vehicle is not None:
            raise InputError("--vehicle: the scenario has a vehicle of its own; leave one out")
        from tiltsim.loading import load_scenario

        scenario = load_scenario(arguments.scenario)
        vehicle = scenario.vehicle.resolve()
        return replace(scenario.gait.plan(vehicle), source=scenario.source), vehicle
    vehicle = parse_vehicle(arguments.vehicle)
    if arguments.angles is not None:
        return plans.fixed(parse_angles("--angles", arguments.angles)), vehicle
    if arguments.balance is not None:
        return _balanced(arguments.balance, vehicle), vehicle
    from controllers.published_gaits import PUBLISHED_GAITS

    if arguments.published not in PUBLISHED_GAITS:
        raise InputError(
            f"--published {arguments.published}: unknown; choose {', '.join(PUBLISHED_GAITS)}"
        )
    return PUBLISHED_GAITS[arguments.published].gait, vehicle


def _balanced(text: str, vehicle: Vehicle) -> Gait:
    """The gait that balances an acceleration, given as ``AX,AY,AZ``."""
    from controllers.balance import balanced_gait
    from controllers.gaits import plans
    from tiltsim.errors import InputError

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
    rows = [
        ("gait", report["gait"] + (f" ({report['source']})" if report["source"] else "")),
        ("vehicle", str(report["vehicle"])),
        ("tilt angles", _numbers(report["angles"]) + " rad"),
        ("rank of tau", str(report["rank"])),
        ("singular values", _numbers(report["singular_values"]) + " of tau / (L K_f)"),
        ("R, R_phi, R_theta", _numbers([report["R"], report["R_phi"], report["R_theta"]])),
        ("torque-free force", _numbers(direction) + " along" if direction else "none"),
        ("singularity margin", f"{report['singularity_margin']:.6g} rad"),
        (
            "acceptable share",
            f"{100.0 * report['acceptable_share']:.2f} % of the roll-pitch square",
        ),
        ("unacceptable curve", report["unacceptable_attitudes"]["kind"]),
    ]
    if "determinant" in report:
        attitude = f"roll {report['roll']:g}, pitch {report['pitch']:g} rad"
        rows.insert(8, ("determinant", f"{report['determinant']:.6g} at {attitude}"))
    if "time" in report:
        rate = "jumps" if report["max_rate"] is None else f"{report['max_rate']:.6g} rad/s"
        rows += [
            ("period", f"{report['period']:g} s; the values above are those at t = 0"),
            ("amplitude", f"{report['amplitude']:.6g} rad"),
            ("largest rate", rate),
            ("least rank", str(report["min_rank"])),
            ("least margin", f"{report['min_singularity_margin']:.6g} rad over the period"),
        ]
    width = max(len(name) for name, _ in rows)
    lines = [f"{name:<{width}}  {value}" for name, value in rows]
    return "\n".join([*lines, *(f"warning: {text}" for text in report["warnings"])])


def _numbers(values: list[float]) -> str:
    return ", ".join(f"{value:.6g}" for value in values)
