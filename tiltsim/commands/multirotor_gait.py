"""``tiltsim gait`` for a multirotor: an MJCF file at fixed tilt angles, or a scenario's gait."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from tiltsim.commands.declaring import mistakes_in
from tiltsim.commands.gait_options import GaitFigure, GaitOptions
from tiltsim.commands.gait_text import multirotor_text
from tiltsim.errors import InputError
from tiltsim.views import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.scenario.scenario import Scenario

FIGURES: Final = ("roll_pitch", "attainable")  # values of ``--figure`` for any multirotor


def run_multirotor(
    address: str | None,
    scenario: Scenario | None,
    options: GaitOptions,
    figure: GaitFigure,
    *,
    json: bool,
) -> int:
    """Analyze the file of ``--mjcf`` or the scenario's vehicle, draw, print.

    Args:
        address: The scenario that was given, if any.
        scenario: The loaded scenario; None with ``--mjcf``.
        options, figure, json: The options of `tiltsim gait`.
    """
    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.studies.multirotor_analysis import (
        balance_report,
        multirotor_report,
        period_report,
        tilted_rotors,
    )

    _check_options(address, options, figure)
    limits, balance, gait = figure.speed_limits, None, None
    if scenario is not None:
        resolved = scenario.vehicle.resolve()
        assert isinstance(resolved, Multirotor)
        vehicle, gait = resolved, scenario.gait.plan(resolved)
        angles = tuple(gait.angles(0.0).tolist())
    else:
        vehicle = _read(str(options.mjcf))
        angles = _tilt_angles(options, vehicle)
        if options.balance is not None:
            with mistakes_in(f"--balance {options.acceleration}"):
                balance = balance_report(vehicle, options.balance, limits)
            angles = tuple(balance["angles"])
    roll, pitch = options.roll or 0.0, options.pitch or 0.0
    report = {
        "vehicle": options.mjcf or address,
        **multirotor_report(
            vehicle, angles, limits=limits, roll=roll, pitch=pitch, faults=options.faults
        ),
    }
    if balance is not None:
        report["balance"] = balance
    if gait is not None and not gait.is_constant:
        report |= period_report(vehicle, gait, roll, pitch)

    def draw() -> Figure:
        rotors = tilted_rotors(vehicle, angles, limits)
        return figures.multirotor.multirotor_figure(rotors, figure.kind or FIGURES[0])

    figure.show(draw, report, multirotor_text(report), json=json)
    return 0


def _check_options(address: str | None, options: GaitOptions, figure: GaitFigure) -> None:
    """Refuse options of the thesis's vehicle, and files that cannot be written."""
    of_four_rotors = {
        "SCENARIO": address,
        "--published": options.published,
        "--vehicle": options.vehicle,
        "--case": figure.case,
    }
    for option, value in of_four_rotors.items():
        if options.mjcf is not None and value is not None:
            raise InputError(f"--mjcf: cannot be combined with {option}")
    if options.angles is not None and options.balance is not None:
        raise InputError("--mjcf: give either --angles or --balance")
    kind = figure.kind
    if kind is not None and kind not in FIGURES:
        raise InputError(f"--figure {kind}: of a multirotor, choose {' or '.join(FIGURES)}")
    figure.check_kind()
    if figure.panels:
        raise InputError("--panels: this figure has no panels to choose from")


def _read(path: str) -> Multirotor:
    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.models.user_vehicle import read_user_vehicle

    with mistakes_in(f"--mjcf {path}"):
        vehicle = read_user_vehicle(path, "multirotor").vehicle
    assert isinstance(vehicle, Multirotor)
    return vehicle


def _tilt_angles(options: GaitOptions, vehicle: Multirotor) -> tuple[float, ...]:
    """One angle (rad) for each hinge of the file; all zero by default."""
    text = options.angles
    if text is None:
        return (0.0,) * vehicle.tilts
    if vehicle.tilts == 0:
        raise InputError(f"--angles {text}: no rotor of {options.mjcf} tilts; leave it out")
    return options.read_angles(vehicle.tilts)
