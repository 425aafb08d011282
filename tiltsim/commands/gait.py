"""``tiltsim gait``: analyzes the singularities of a gait, or of a multirotor's tilt angles."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

from tiltsim.commands.declaring import Option, mistakes_in
from tiltsim.commands.gait_options import DEFAULT_VEHICLE, GaitFigure, GaitOptions, parse_vehicle
from tiltsim.commands.options import Json
from tiltsim.commands.text import json_text
from tiltsim.errors import InputError
from tiltsim.views import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.scenario.scenario import Scenario
    from tiltsim_controllers.gaits.plans import Gait
    from tiltsim_controllers.vehicle.parameters import Vehicle

MULTIROTOR_FIGURES: Final = ("roll_pitch", "attainable")  # ``--figure`` for any multirotor
OPPOSITE_SPEED_RATIO: Final = 0.7  # in fault reports: speed of the rotor opposite a failed one


class SelectedGait(NamedTuple):
    """The gait to analyze, its vehicle, and the gait to compare it with, if any."""

    gait: Gait
    vehicle: Vehicle
    title: str = "gait"
    twin: Gait | None = None
    twin_title: str = ""


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
    from tiltsim.commands.gait_text import determinant_text, gait_text, list_text
    from tiltsim.studies.gait_analysis import determinant_report, fault_report, gait_report

    if list_gaits:
        from tiltsim_controllers.analysis.published_gaits import robustness_table

        if scenario is not None or gait != GaitOptions() or figure != GaitFigure():
            raise InputError("--list: takes no other option than --json")
        rows = robustness_table()
        print(json_text([asdict(row) for row in rows]) if json else list_text(rows))
        return 0
    if gait.mjcf is not None:
        return _run_multirotor(scenario, None, gait, figure, json=json)
    _check_options(scenario, gait, figure)
    if figure.kind == "determinant":
        vehicle, case = gait.vehicle or parse_vehicle(DEFAULT_VEHICLE), figure.case or "equal"
        report = determinant_report(case, vehicle)
        figure.show(
            lambda: figures.vehicles.determinant_figure(case, vehicle),
            report,
            determinant_text(report),
            json=json,
        )
        return 0
    loaded = None
    if scenario is not None:
        from tiltsim.models.rotor_table import Multirotor
        from tiltsim.scenario.loading import load_scenario

        loaded = load_scenario(scenario)
        if gait.vehicle is not None:
            raise InputError("--vehicle: the scenario defines its own vehicle; remove one of them")
        if isinstance(loaded.vehicle.resolve(), Multirotor):
            return _run_multirotor(scenario, loaded, gait, figure, json=json)
    selected = _select(gait) if loaded is None else _of_scenario(str(scenario), loaded)
    report = gait_report(selected.gait, selected.vehicle, roll=gait.roll, pitch=gait.pitch)
    if gait.faults:
        a1, a2, a3, a4 = selected.gait.angles(0.0).tolist()
        opposite_speed = OPPOSITE_SPEED_RATIO * selected.vehicle.hover_rotor_speed
        report["faults"] = fault_report((a1, a2, a3, a4), selected.vehicle, opposite_speed)
    if figure.kind == "attainable":
        report["warnings"] += _attainable_warnings(selected, figure)
    figure.show(partial(_draw, selected, figure), report, gait_text(report), json=json)
    return 0


def _check_options(scenario: str | None, gait: GaitOptions, figure: GaitFigure) -> None:
    """Refuse incompatible options, and files that cannot be written."""
    given = [scenario, gait.angles, gait.published, gait.balance]
    count = sum(one is not None for one in given)
    if figure.kind == "determinant":
        if count:
            raise InputError("--figure determinant: takes --case instead of a gait")
        if gait.roll is not None or gait.pitch is not None:
            raise InputError("--figure determinant: is drawn at level attitude")
    elif count != 1:
        raise InputError(
            "gait: give one of SCENARIO, --angles A1,A2,A3,A4, --published NAME and "
            "--balance AX,AY,AZ"
        )
    if figure.speed_limits is not None and figure.kind != "attainable":
        raise InputError("--speed-limits: needs --figure attainable")
    figure.check_kind()


def _select(options: GaitOptions) -> SelectedGait:
    """The gait and the vehicle that the options select. Raises `InputError` if one is unknown."""
    from tiltsim.models.cross import as_multirotor
    from tiltsim.studies.multirotor_analysis import balance_report
    from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS
    from tiltsim_controllers.gaits import plans

    vehicle = options.vehicle or parse_vehicle(DEFAULT_VEHICLE)
    if options.angles is not None:
        return SelectedGait(plans.fixed(options.read_angles(4)), vehicle)
    if options.balance is not None:
        with mistakes_in(f"--balance {options.acceleration}"):
            rotors = as_multirotor(vehicle, tilting=True, reverses=False)
            fixed = plans.fixed(balance_report(rotors, options.balance)["angles"])
        source = f"balances {options.acceleration} m/s^2 at level attitude"
        return SelectedGait(replace(fixed, source=source), vehicle)
    if options.published not in PUBLISHED_GAITS:
        raise InputError(
            f"--published {options.published}: unknown; choose {', '.join(PUBLISHED_GAITS)}"
        )
    published = PUBLISHED_GAITS[options.published]
    title = f"{published.key}, as printed" if published.printed else published.key
    twin_title = "" if published.bias is None else f"biased, η = {published.bias:.0%}"
    return SelectedGait(published.gait, vehicle, title, published.biased, twin_title)


def _of_scenario(address: str, scenario: Scenario) -> SelectedGait:
    """The gait and the vehicle of a scenario, and its gait without bias."""
    from tiltsim_controllers.vehicle.parameters import Vehicle

    vehicle = scenario.vehicle.resolve()
    if not isinstance(vehicle, Vehicle):
        raise InputError(
            f"{address}: vehicle.model = {scenario.vehicle.model!r}: does not have a gait of four "
            "tilt angles"
        )
    if not scenario.rotorcraft.has_standard_layout:
        raise InputError(
            f"{address}: vehicle.mjcf = {scenario.rotorcraft.mjcf!r}: its rotors are not on four "
            "equal arms at right angles, which the analysis assumes"
        )
    gait = replace(scenario.gait.plan(vehicle), source=scenario.source)
    if scenario.gait.bias == 1.0:
        return SelectedGait(gait, vehicle, gait.name)
    unbiased = scenario.gait.model_copy(update={"bias": 1.0}).plan(vehicle)
    return SelectedGait(gait, vehicle, gait.name, unbiased, "without bias")


def _attainable_warnings(selected: SelectedGait, figure: GaitFigure) -> list[str]:
    """A warning if the attainable figure is empty."""
    from tiltsim_controllers.analysis.attainable import attainable_torque_thrust

    low, high = _speed_limits(selected, figure)
    angles = selected.gait.angles(0.0)
    if not attainable_torque_thrust(angles, selected.vehicle, (low, high)).is_empty:
        return []
    return [
        f"nothing is attainable: no rotor speeds from {low:.2f} to {high:.2f} rad/s hover without "
        "yaw torque; the figure is empty"
    ]


def _speed_limits(selected: SelectedGait, figure: GaitFigure) -> tuple[float, float]:
    """Minimum and maximum rotor speed (rad/s) of the attainable figure."""
    from tiltsim_controllers.analysis.attainable import published_speed_limits

    return figure.speed_limits or published_speed_limits(selected.vehicle)


def _draw(selected: SelectedGait, options: GaitFigure) -> Figure:
    """The ``--figure`` of a gait, by default its roll-pitch diagram."""
    chosen, vehicle = selected.gait, selected.vehicle
    compared = [(selected.title, chosen)]
    if selected.twin is not None:
        compared.append((selected.twin_title, selected.twin))
    match options.kind:
        case "faults":
            return figures.gaits.fault_figure(vehicle)
        case "attainable":
            if not chosen.is_constant:
                raise InputError(f"--figure attainable: {chosen.name} moves; give fixed angles")
            limits = _speed_limits(selected, options)
            return figures.vehicles.attainable_figure(chosen, vehicle, limits)
        case "comparison":
            if len(compared) == 1:
                raise InputError(f"--figure comparison: {chosen.name} has no bias to compare with")
            return figures.gaits.comparison_figure(compared, vehicle)
        case "margin":
            return figures.gaits.margin_figure(compared, vehicle)
    return figures.gaits.gait_figure(chosen, vehicle, tuple(options.panels))


def _run_multirotor(
    address: str | None,
    scenario: Scenario | None,
    options: GaitOptions,
    figure: GaitFigure,
    *,
    json: bool,
) -> int:
    """Analyze the file of ``--mjcf``, without a scenario, or the scenario's vehicle."""
    from tiltsim.commands.gait_text import multirotor_text
    from tiltsim.models.rotor_table import Multirotor
    from tiltsim.studies.multirotor_analysis import (
        balance_report,
        multirotor_report,
        period_report,
        tilted_rotors,
    )

    _check_multirotor_options(address, options, figure)
    limits, balance, gait = figure.speed_limits, None, None
    if scenario is not None:
        resolved = scenario.vehicle.resolve()
        assert isinstance(resolved, Multirotor)
        vehicle, gait = resolved, scenario.gait.plan(resolved)
        angles = tuple(gait.angles(0.0).tolist())
    else:
        vehicle = _read_multirotor(str(options.mjcf))
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
        return figures.vehicles.multirotor_figure(rotors, figure.kind or MULTIROTOR_FIGURES[0])

    figure.show(draw, report, multirotor_text(report), json=json)
    return 0


def _check_multirotor_options(
    address: str | None, options: GaitOptions, figure: GaitFigure
) -> None:
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
    if kind is not None and kind not in MULTIROTOR_FIGURES:
        raise InputError(
            f"--figure {kind}: of a multirotor, choose {' or '.join(MULTIROTOR_FIGURES)}"
        )
    figure.check_kind()
    if figure.panels:
        raise InputError("--panels: this figure has no panels to choose from")


def _read_multirotor(path: str) -> Multirotor:
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
