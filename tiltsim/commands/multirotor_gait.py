"""``tiltsim gait --mjcf FILE``: any multirotor at fixed tilt angles."""

from __future__ import annotations

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from tiltsim.commands.angles import (
    parse_acceleration,
    parse_angle,
    parse_angles,
    parse_speed_limits,
)
from tiltsim.commands.figure_options import check_plot, save_figure
from tiltsim.commands.text import aligned, json_text, number, numbers, print_figure_path
from tiltsim.errors import InputError
from tiltsim.system.text import printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tiltsim.models.rotor_table import Multirotor
    from tiltsim_controllers.gaits.plans import Gait

FIGURES: Final = ("roll_pitch", "attainable")
"""Values of ``--figure`` for any multirotor."""

OF_FOUR_ROTORS: Final = ("scenario", "published", "vehicle", "case")
"""Arguments that are about the thesis's vehicle or a scenario's."""

SETS: Final = {
    "all": "every attitude",
    "great circle": "those with world up in a plane of the body (a great circle)",
    "two directions": "those with world up along one line of the body (two directions)",
    "none": "none",
}


def flies_multirotor(scenario: str | None) -> bool:
    """Whether a scenario, by its address, is of a multirotor."""
    from tiltsim.scenario.loading import load_scenario

    return scenario is not None and load_scenario(scenario).vehicle.model == "multirotor"


def run_multirotor(arguments: argparse.Namespace) -> int:
    """Analyze the file of ``--mjcf`` or the scenario's vehicle, draw, print."""
    _check_options(arguments)
    text = arguments.speed_limits
    limits = None if text is None else parse_speed_limits(text)
    balance = gait = None
    if arguments.mjcf is None:
        vehicle, gait = _of_scenario(arguments.scenario)
        angles: Sequence[float] = gait.angles(0.0).tolist()
    else:
        vehicle = _read(arguments.mjcf)
        if arguments.balance is not None:
            balance = _balance(arguments.balance, vehicle, limits)
        angles = _tilt_angles(arguments, vehicle) if balance is None else balance["angles"]
    roll = 0.0 if arguments.roll is None else parse_angle("--roll", arguments.roll)
    pitch = 0.0 if arguments.pitch is None else parse_angle("--pitch", arguments.pitch)

    from tiltsim.studies.multirotor_analysis import multirotor_report, period_report, tilted_rotors

    if arguments.plot is not None:
        from tiltsim.views.figures.multirotor import multirotor_figure

        rotors = tilted_rotors(vehicle, angles, limits)
        draw = partial(multirotor_figure, rotors, arguments.figure or FIGURES[0])
        save_figure(draw, arguments.plot, arguments)
    report = {
        "vehicle": arguments.mjcf or arguments.scenario,
        **multirotor_report(
            vehicle, angles, limits=limits, roll=roll, pitch=pitch, faults=arguments.faults
        ),
    }
    if balance is not None:
        report["balance"] = balance
    if gait is not None and not gait.is_constant:
        report |= period_report(vehicle, gait, roll, pitch)
    print(json_text(report) if arguments.json else multirotor_text(report))
    print_figure_path(arguments)
    return 0


def _check_options(arguments: argparse.Namespace) -> None:
    for name in OF_FOUR_ROTORS:
        if arguments.mjcf is not None and getattr(arguments, name) is not None:
            option = "SCENARIO" if name == "scenario" else f"--{name}"
            raise InputError(f"--mjcf: cannot be combined with {option}")
    if arguments.list:
        raise InputError("--list: takes no other option than --json")
    if arguments.angles is not None and arguments.balance is not None:
        raise InputError("--mjcf: give either --angles or --balance")
    kind = arguments.figure
    if kind is not None and kind not in FIGURES:
        raise InputError(f"--figure {kind}: of a multirotor, choose {' or '.join(FIGURES)}")
    if kind is not None and arguments.plot is None:
        raise InputError(f"--figure {kind}: needs --plot FILE")
    check_plot(arguments)


def _read(path: str) -> Multirotor:
    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.models.user_vehicle import read_user_vehicle

    try:
        vehicle = read_user_vehicle(path, "multirotor").vehicle
    except ValueError as error:
        raise InputError(f"--mjcf {path}: {error}") from None
    assert isinstance(vehicle, Multirotor)
    return vehicle


def _of_scenario(address: str) -> tuple[Multirotor, Gait]:
    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.scenario.loading import load_scenario

    scenario = load_scenario(address)
    vehicle = scenario.vehicle.resolve()
    assert isinstance(vehicle, Multirotor)
    return vehicle, scenario.gait.plan(vehicle)


def _tilt_angles(arguments: argparse.Namespace, vehicle: Multirotor) -> tuple[float, ...]:
    """One angle (rad) for each hinge of the file; all zero by default."""
    text = arguments.angles
    if text is None:
        return (0.0,) * vehicle.tilts
    if vehicle.tilts == 0:
        raise InputError(f"--angles {text}: no rotor of {arguments.mjcf} tilts; leave it out")
    return parse_angles("--angles", text, vehicle.tilts)


def _balance(
    text: str, vehicle: Multirotor, limits: tuple[float, float] | None
) -> dict[str, list[float]]:
    """The least tilt angles that hold the vehicle level under the acceleration ``AX,AY,AZ``."""
    from tiltsim.studies.multirotor_analysis import balance_report

    try:
        return balance_report(vehicle, parse_acceleration(text), limits)
    except ValueError as error:
        raise InputError(f"--balance {text}: {error}") from None


def multirotor_text(report: dict[str, Any]) -> str:
    """The analysis in aligned lines."""
    direction, hover = report["torque_free_direction"], report["hover"]
    attitude = f"roll {number(report['roll'])}, pitch {number(report['pitch'])} rad"
    rows = [
        ("vehicle", printable(report["vehicle"])),
        ("rotors, tilt hinges", f"{report['rotors']}, {report['tilts']}"),
        ("tilt angles", numbers(report["angles"]) + " rad" if report["angles"] else "none"),
        ("rank of tau", str(report["rank"])),
        ("singular values", numbers(report["singular_values"]) + " of tau, by its largest column"),
        ("torque-free forces", f"of dimension {report['torque_free_dimension']}"),
        ("", "nearest to the z axis: " + numbers(direction) if direction else "none upward"),
        ("singular attitudes", SETS[report["singular_attitudes"]]),
        ("singularity margin", f"{number(report['singularity_margin'])} rad at {attitude}"),
        *_period_rows(report),
        ("hover", "none" if hover is None else _hover_text(hover)),
    ]
    if hover is not None:
        rows.append(("hover rotor speeds", numbers(hover["rotor_speeds"]) + " rad/s along spins"))
    if report["side_force_share"] is not None:
        share = f"{100.0 * report['side_force_share']:.4g} % of the weight in every direction"
        rows.append(("level side force", share))
    if "balance" in report:
        speeds = numbers(report["balance"]["rotor_speeds"]) + " rad/s along spins"
        rows.append(("balanced rotor speeds", speeds))
    for name, unit in (("forces", "N without torque"), ("torques", "N m at hover lift")):
        extent = (report["attainable"] or {}).get(name)
        if extent is not None and extent["lower"] is not None:
            bounds = zip(extent["lower"], extent["upper"], strict=True)
            ranges = ", ".join(
                f"{number(low, '.4g')}..{number(high, '.4g')}" for low, high in bounds
            )
            rows.append((f"attainable {name}", f"{ranges} {unit} (x, y, z)"))
    for loss in report.get("faults", ()):
        hover = loss["hover"]
        text = "no hover" if hover is None else _hover_text(hover)
        rows.append((f"without rotor {loss['rotor']}", text))
        if loss["free_tilts"] is not None:
            control = _control(loss["free_tilts"])
            rows.append(("", f"level, {control}, at {numbers(loss['free_tilts']['angles'])} rad"))
    return "\n".join([*aligned(rows), *(f"warning: {text}" for text in report["warnings"])])


def _period_rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    """The worst of a moving gait, whose other values are those at time zero."""
    if "time" not in report:
        return []
    margin = number(report["min_singularity_margin"])
    return [
        ("over the gait", f"dimension {report['min_torque_free_dimension']} or more"),
        ("", f"margin {margin} rad or more; all else at t = 0"),
    ]


def _hover_text(hover: dict[str, Any]) -> str:
    level = "level" if hover["lean"] < 1e-6 else f"leaning by {number(hover['lean'], '.4g')} rad"
    return f"{level}, {_control(hover)}, up to {hover['max_rotor_speed']:.4g} rad/s"


def _control(hover: dict[str, Any]) -> str:
    return "controllable" if hover["controllable"] else "not controllable"
