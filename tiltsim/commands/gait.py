"""``tiltsim gait``: analyzes the singularities of a gait, or of a multirotor's tilt angles."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple, TypeAlias

from tiltsim.commands.declaring import Option, mistakes_in
from tiltsim.commands.gait_options import DEFAULT_VEHICLE, GaitFigure, GaitOptions, parse_vehicle
from tiltsim.commands.options import Json
from tiltsim.commands.text import json_text
from tiltsim.errors import InputError
from tiltsim.views import figures

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from tiltsim.models.rotor_table import Multirotor
    from tiltsim_controllers.gaits.plans import Gait
    from tiltsim_controllers.vehicle.parameters import Vehicle

MULTIROTOR_FIGURES: Final = ("roll_pitch", "attainable")  # ``--figure`` for any multirotor


Analysis: TypeAlias = "tuple[Callable[[], Figure], dict[str, Any], str]"
"""An analysis to show: how to draw it, its report, and its text."""


class SelectedGait(NamedTuple):
    """The gait to analyze, its vehicle, and the gait to compare it with, if any."""

    gait: Gait
    vehicle: Vehicle | Multirotor
    title: str = "gait"
    twin: Gait | None = None
    twin_title: str = ""
    shown: tuple[tuple[str, Any], ...] = ()  # further entries of the report


def run(
    scenario: str | None = None,
    *,
    list_gaits: Annotated[bool, Option("--list")] = False,
    json: Json = False,
    gait: GaitOptions,
    figure: GaitFigure,
) -> int:
    """Analyze the singularities of a gait; a moving gait over one period.

    Prints rank and singular values of the torque matrix, the residuals R, R_phi and R_theta, the
    singularity margin and the singular attitudes.

    Args:
        scenario (SCENARIO): take gait and vehicle from a scenario
        list_gaits: list the thesis's gaits and their robustness claims
    """
    if list_gaits:
        from tiltsim.commands.gait_text import list_text
        from tiltsim_controllers.analysis.published_gaits import robustness_table

        if scenario is not None or gait != GaitOptions() or figure != GaitFigure():
            raise InputError("--list: takes no other option than --json")
        rows = robustness_table()
        print(json_text([asdict(row) for row in rows]) if json else list_text(rows))
        return 0
    _check_options(scenario, gait, figure)
    if figure.kind == "determinant" and gait.mjcf is None:
        analysis = _of_determinant(gait, figure)
    else:
        limits = figure.speed_limits
        chosen = _select(gait, limits) if scenario is None else _of_scenario(scenario, gait)
        analysis = _of_gait(chosen, gait, figure)
    figure.show(*analysis, json=json)
    return 0


def _check_options(scenario: str | None, gait: GaitOptions, figure: GaitFigure) -> None:
    """Refuse incompatible options, and files that cannot be written."""
    if gait.mjcf is not None:
        of_four_rotors = {
            "SCENARIO": scenario,
            "--published": gait.published,
            "--vehicle": gait.vehicle,
            "--case": figure.case,
        }
        for option, value in of_four_rotors.items():
            if value is not None:
                raise InputError(f"--mjcf: cannot be combined with {option}")
        if gait.angles is not None and gait.balance is not None:
            raise InputError("--mjcf: give either --angles or --balance")
        return
    count = sum(one is not None for one in (scenario, gait.angles, gait.published, gait.balance))
    if figure.kind == "determinant":
        if count:
            raise InputError("--figure determinant: takes --case instead of a gait")
        if gait.roll is not None or gait.pitch is not None:
            raise InputError("--figure determinant: is drawn at level attitude")
    elif count != 1:
        raise InputError(
            "gait: give one of SCENARIO, --angles A1,A2,A3,A4, --published NAME, "
            "--balance AX,AY,AZ or --mjcf FILE"
        )
    figure.check_kind()


def _of_determinant(gait: GaitOptions, figure: GaitFigure) -> Analysis:
    """The analysis of the restrictions of ch. 3, without a gait."""
    from tiltsim.commands.gait_text import determinant_text
    from tiltsim.studies.gait_analysis import determinant_report

    vehicle, case = gait.vehicle or parse_vehicle(DEFAULT_VEHICLE), figure.case or "equal"
    report = determinant_report(case, vehicle)
    draw = partial(figures.vehicles.determinant_figure, case, vehicle)
    return draw, report, determinant_text(report)


def _of_gait(chosen: SelectedGait, gait: GaitOptions, figure: GaitFigure) -> Analysis:
    """The analysis of a gait of any vehicle."""
    from tiltsim.commands.gait_text import gait_text
    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.studies.multirotor_analysis import gait_report

    figure.check_kind()
    planned, vehicle = chosen.gait, chosen.vehicle
    if isinstance(vehicle, Multirotor):
        if figure.kind not in (None, *MULTIROTOR_FIGURES):
            choices = " or ".join(MULTIROTOR_FIGURES)
            raise InputError(f"--figure {figure.kind}: of a multirotor, choose {choices}")
        if figure.panels:
            raise InputError("--panels: this figure has no panels to choose from")
    attitude = gait.roll or 0.0, gait.pitch or 0.0
    about: Any = {"limits": figure.speed_limits, "attitude": attitude, "faults": gait.faults}
    report = dict(chosen.shown) | gait_report(planned, vehicle, **about)
    if figure.kind == "attainable" and not isinstance(vehicle, Multirotor):
        report["warnings"] += _attainable_warnings(planned, vehicle, figure)
    return partial(_draw, chosen, figure), report, gait_text(report)


def _select(options: GaitOptions, limits: tuple[float, float] | None) -> SelectedGait:
    """The gait and the vehicle that the options select. Raises `InputError` if one is unknown."""
    from tiltsim.models.cross import as_multirotor
    from tiltsim.studies.multirotor_analysis import balance_report
    from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS
    from tiltsim_controllers.gaits import plans

    vehicle: Vehicle | Multirotor = options.vehicle or parse_vehicle(DEFAULT_VEHICLE)
    shown: dict[str, Any] = {}
    if options.mjcf is not None:
        vehicle, shown = _read_multirotor(options.mjcf), {"vehicle": options.mjcf}
    if options.balance is not None:
        with mistakes_in(f"--balance {options.acceleration}"):
            craft = as_multirotor(vehicle, tilting=True, reverses=False)
            shown["balance"] = balance_report(craft, options.balance, limits)
        source = f"balances {options.acceleration} m/s^2 at level attitude"
        balanced = plans.fixed(shown["balance"]["angles"], source=source)
        return SelectedGait(balanced, vehicle, shown=tuple(shown.items()))
    if options.published is None:
        gait = plans.fixed(_tilt_angles(options, vehicle))
        return SelectedGait(gait, vehicle, shown=tuple(shown.items()))
    if options.published not in PUBLISHED_GAITS:
        raise InputError(
            f"--published {options.published}: unknown; choose {', '.join(PUBLISHED_GAITS)}"
        )
    published = PUBLISHED_GAITS[options.published]
    title = f"{published.key}, as printed" if published.printed else published.key
    twin_title = "" if published.bias is None else f"biased, η = {published.bias:.0%}"
    return SelectedGait(published.gait, vehicle, title, published.biased, twin_title)


def _of_scenario(address: str, options: GaitOptions) -> SelectedGait:
    """The gait and the vehicle of a scenario, and its gait without bias."""
    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.scenario.loading import load_scenario
    from tiltsim_controllers.vehicle.parameters import Vehicle

    scenario = load_scenario(address)
    if options.vehicle is not None:
        raise InputError("--vehicle: the scenario defines its own vehicle; remove one of them")
    vehicle, at = scenario.vehicle.resolve(), scenario.address
    if not isinstance(vehicle, Vehicle | Multirotor):
        raise InputError(
            f"{at}: vehicle.model = {scenario.vehicle.model!r}: does not have a gait of four tilt "
            "angles"
        )
    gait = replace(scenario.gait.plan(vehicle), source=scenario.source)
    if isinstance(vehicle, Multirotor):
        return SelectedGait(gait, vehicle, shown=(("vehicle", address),))
    if not scenario.rotorcraft.has_standard_layout:
        raise InputError(
            f"{at}: vehicle.mjcf = {scenario.rotorcraft.mjcf!r}: its rotors are not on four "
            "equal arms at right angles, which the analysis assumes"
        )
    if scenario.gait.bias == 1.0:
        return SelectedGait(gait, vehicle, gait.name)
    unbiased = scenario.gait.model_copy(update={"bias": 1.0}).plan(vehicle)
    return SelectedGait(gait, vehicle, gait.name, unbiased, "without bias")


def _attainable_warnings(gait: Gait, vehicle: Vehicle, figure: GaitFigure) -> list[str]:
    """A warning if the attainable figure is empty."""
    from tiltsim_controllers.analysis.attainable import attainable_torque_thrust

    low, high = _speed_limits(vehicle, figure)
    if not attainable_torque_thrust(gait.angles(0.0), vehicle, (low, high)).is_empty:
        return []
    return [
        f"nothing is attainable: no rotor speeds from {low:.2f} to {high:.2f} rad/s hover without "
        "yaw torque; the figure is empty"
    ]


def _speed_limits(vehicle: Vehicle, figure: GaitFigure) -> tuple[float, float]:
    """Minimum and maximum rotor speed (rad/s) of the attainable figure."""
    from tiltsim_controllers.analysis.attainable import published_speed_limits

    return figure.speed_limits or published_speed_limits(vehicle)


def _draw(selected: SelectedGait, options: GaitFigure) -> Figure:
    """The ``--figure`` of a gait, by default its roll-pitch diagram."""
    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.studies.multirotor_analysis import tilted_rotors

    chosen, vehicle = selected.gait, selected.vehicle
    if isinstance(vehicle, Multirotor):
        rotors = tilted_rotors(vehicle, chosen.angles(0.0), options.speed_limits)
        return figures.vehicles.multirotor_figure(rotors, options.kind or MULTIROTOR_FIGURES[0])
    compared = [(selected.title, chosen)]
    if selected.twin is not None:
        compared.append((selected.twin_title, selected.twin))
    match options.kind:
        case "faults":
            return figures.gaits.fault_figure(vehicle)
        case "attainable":
            if not chosen.is_constant:
                raise InputError(f"--figure attainable: {chosen.name} moves; give fixed angles")
            limits = _speed_limits(vehicle, options)
            return figures.vehicles.attainable_figure(chosen, vehicle, limits)
        case "comparison":
            if len(compared) == 1:
                raise InputError(f"--figure comparison: {chosen.name} has no bias to compare with")
            return figures.gaits.comparison_figure(compared, vehicle)
        case "margin":
            return figures.gaits.margin_figure(compared, vehicle)
    return figures.gaits.gait_figure(chosen, vehicle, tuple(options.panels))


def _read_multirotor(path: str) -> Multirotor:
    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.models.user_vehicle import read_user_vehicle

    with mistakes_in(f"--mjcf {path}"):
        vehicle = read_user_vehicle(path, "multirotor").vehicle
    assert isinstance(vehicle, Multirotor)
    return vehicle


def _tilt_angles(options: GaitOptions, vehicle: Vehicle | Multirotor) -> tuple[float, ...]:
    """One angle (rad) for each hinge; all zero by default."""
    text = options.angles
    if text is None:
        return (0.0,) * vehicle.tilts
    if vehicle.tilts == 0:
        raise InputError(f"--angles {text}: no rotor of {options.mjcf} tilts; leave it out")
    return options.read_angles(vehicle.tilts)
