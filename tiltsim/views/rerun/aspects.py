"""How each kind of vehicle is shown: its plots, its plane, and where the camera stands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from tiltsim.laws.assembling import loop_of
from tiltsim.views.rerun.car_series import (
    car_limit_series,
    car_measured_series,
    car_panels,
    car_series_values,
)
from tiltsim.views.rerun.plane import AttitudePlane
from tiltsim.views.rerun.series import (
    Panel,
    Series,
    limit_series,
    measured_series,
    panels,
    series_values,
)
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario


@dataclass(frozen=True)
class Aspect:
    """How one kind of vehicle is shown.

    Attributes
    ----------
    panels
        The plots of a scenario's flights, from top to bottom.
    measured, limits, values
        Series of a scenario's flights, level lines with their values, and a flight's series by
        entity.
    plane
        What draws the roll-pitch plane; None where there is no attitude to draw.
    eye, up
        Where the camera stands, seen from the vehicle, in radii of it, and which way is up there.
    overview
        Whether the trajectory, too, is seen from above.
    """

    panels: Callable[[Scenario], tuple[Panel, ...]]
    measured: Callable[[Scenario], list[Series]]
    limits: Callable[[Scenario], list[tuple[Series, float]]]
    values: Callable[[Flight], dict[str, Floats]]
    plane: type[AttitudePlane] | None
    eye: tuple[float, float, float]
    up: tuple[float, float, float]
    overview: bool


ASPECTS: Final = {
    "rotorcraft": Aspect(
        panels=panels,
        measured=measured_series,
        limits=limit_series,
        values=series_values,
        plane=AttitudePlane,
        eye=(-2.4, -2.4, 1.9),
        up=(0.0, 0.0, 1.0),
        overview=False,
    ),
    "tilt_car": Aspect(
        panels=car_panels,
        measured=car_measured_series,
        limits=car_limit_series,
        values=car_series_values,
        plane=None,
        eye=(0.0, -0.6, 6.5),
        up=(0.0, 1.0, 0.0),
        overview=True,
    ),
}
"""Aspects by the name of the kind (`tiltsim.closed_loop.vehicle_kind`)."""


def aspect_of(scenario: Scenario) -> Aspect:
    """How a scenario's flights are shown."""
    return ASPECTS[loop_of(scenario).kind.name]


def comparison_series(name: str, color: tuple[int, int, int], scenario: Scenario) -> list[Series]:
    """The series that stand for one flight, in its colour, when several are compared."""
    return [
        Series(f"{panel.path}/{series}", name, color)
        for panel in aspect_of(scenario).panels(scenario)
        for series, _ in panel.compared
    ]
