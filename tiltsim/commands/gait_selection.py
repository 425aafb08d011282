"""The gait and the vehicle that the options of ``tiltsim gait`` select."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tiltsim.commands.angles import parse_acceleration, parse_angles, parse_vehicle
from tiltsim.errors import InputError

if TYPE_CHECKING:
    from tiltsim_controllers.gaits.plans import Gait
    from tiltsim_controllers.vehicle.parameters import Vehicle


@dataclass(frozen=True)
class SelectedGait:
    """The gait to analyze, its vehicle, and the gait to compare it with, if any."""

    gait: Gait
    vehicle: Vehicle
    title: str = "gait"
    twin: Gait | None = None
    twin_title: str = ""


def select_gait(arguments: argparse.Namespace) -> SelectedGait:
    """The gait and the vehicle that the arguments select. Raises `InputError` if one is unknown."""
    from tiltsim_controllers.gaits import plans

    if arguments.scenario is not None:
        if arguments.vehicle is not None:
            raise InputError("--vehicle: the scenario defines its own vehicle; remove one of them")
        return _gait_of_scenario(arguments.scenario)
    vehicle = parse_vehicle(arguments.vehicle)
    if arguments.angles is not None:
        return SelectedGait(plans.fixed(parse_angles("--angles", arguments.angles)), vehicle)
    if arguments.balance is not None:
        return SelectedGait(_balanced(arguments.balance, vehicle), vehicle)
    from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS

    if arguments.published not in PUBLISHED_GAITS:
        raise InputError(
            f"--published {arguments.published}: unknown; choose {', '.join(PUBLISHED_GAITS)}"
        )
    published = PUBLISHED_GAITS[arguments.published]
    title = f"{published.key}, as printed" if published.printed else published.key
    twin_title = "" if published.bias is None else f"biased, η = {published.bias:.0%}"
    return SelectedGait(published.gait, vehicle, title, published.biased, twin_title)


def _gait_of_scenario(address: str) -> SelectedGait:
    from tiltsim.scenario.loading import load_scenario
    from tiltsim_controllers.vehicle.parameters import Vehicle

    scenario = load_scenario(address)
    vehicle = scenario.vehicle.resolve()
    if not isinstance(vehicle, Vehicle):
        raise InputError(
            f"{address}: vehicle.model = {scenario.vehicle.model!r}: does not have a gait of four "
            "tilt angles"
        )
    if not scenario.rotorcraft.has_standard_layout:
        raise InputError(
            f"{address}: vehicle.mjcf = {scenario.rotorcraft.mjcf!r}: its rotors are not on four "
            "equal arms at right angles, of which the analysis is"
        )
    gait = replace(scenario.gait.plan(vehicle), source=scenario.source)
    if scenario.gait.bias == 1.0:
        return SelectedGait(gait, vehicle, gait.name)
    unbiased = scenario.gait.model_copy(update={"bias": 1.0}).plan(vehicle)
    return SelectedGait(gait, vehicle, gait.name, unbiased, "without bias")


def _balanced(text: str, vehicle: Vehicle) -> Gait:
    """The gait that balances an acceleration, given as ``AX,AY,AZ``."""
    from tiltsim_controllers.analysis.balance import balanced_gait
    from tiltsim_controllers.gaits import plans

    acceleration = parse_acceleration(text)
    try:
        angles = balanced_gait(acceleration, vehicle)
    except ValueError as error:
        raise InputError(f"--balance {text}: {error}") from None
    return replace(plans.fixed(angles), source=f"balances {text} m/s^2 at level attitude")
