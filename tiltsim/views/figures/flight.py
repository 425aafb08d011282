"""One flight on a page."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from tiltsim.views.figures.rotorcraft import rotorcraft_figure
from tiltsim.views.figures.tilt_car import tilt_car_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim.flight.flight import Flight

FIGURES: Final[dict[str, Callable[[Flight], Figure]]] = {
    "rotorcraft": rotorcraft_figure,
    "tilt_car": tilt_car_figure,
}
"""Figures by the name of the kind of vehicle."""


def flight_figure(flight: Flight) -> Figure:
    """The page of a flight, with the panels of its kind of vehicle."""
    return FIGURES[flight.assembly.loop.kind.name](flight)
