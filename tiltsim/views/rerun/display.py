"""What the viewer shows for a kind of vehicle: events, plots, roll-pitch plane, camera."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from tiltsim.closed_loop.assembly import Assembly
    from tiltsim.flight.flight import Flight
    from tiltsim.views.events import Condition
    from tiltsim.views.rerun.palette import Color
    from tiltsim.views.rerun.plane import AttitudePlane
    from tiltsim_controllers.mathematics.scalar import Floats

    Values = str | Callable[[Flight], Floats]  # the name of a column, or computed

MEASURED_WIDTH: Final = 1.8
REFERENCE_WIDTH: Final = 1.0
LIMIT_WIDTH: Final = 1.2


@dataclass(frozen=True)
class Series:
    """A line of a plot."""

    path: str  # entity: panel and name
    label: str
    color: Color
    values: Values  # one per sample
    width: float = MEASURED_WIDTH


@dataclass(frozen=True)
class Level:
    """A horizontal line of a plot."""

    path: str
    label: str
    color: Color
    value: float
    width: float = LIMIT_WIDTH


class Compared(NamedTuple):
    """A series that is plotted for every flight of a comparison, in a plot of its own."""

    name: str  # of the entity below the panel's
    title: str
    values: Values


@dataclass(frozen=True)
class Panel:
    """A plot and what replaces it in a comparison."""

    path: str
    title: str  # with the unit
    height: float  # relative to the other panels
    compared: tuple[Compared, ...] = ()
    levels: tuple[str, ...] = ()  # names of the levels that a comparison shows, too
    limits: Callable[[Assembly], tuple[float, float] | None] = lambda _assembly: None
    """Of the y axis when the recording is opened; None for those of the values."""


@dataclass(frozen=True)
class VehicleDisplay:
    """What the viewer shows for one kind of vehicle.

    Attributes:
        conditions: The conditions of a flight that are reported as events.
        panels, series, levels: The plots of a flight from top to bottom, and their lines.
        plane: Draws the roll-pitch plane; None for vehicles without one.
        eye, up: Camera position relative to the vehicle, in vehicle radii, and the camera's up
            direction.
        overview: Whether the trajectory, too, is viewed from above.
    """

    conditions: Callable[[Flight], Iterator[Condition]]
    panels: Callable[[Assembly], tuple[Panel, ...]]
    series: Callable[[Assembly], list[Series]]
    levels: Callable[[Assembly], list[Level]]
    plane: type[AttitudePlane] | None
    eye: tuple[float, float, float]
    up: tuple[float, float, float]
    overview: bool


def error(axis: str) -> Callable[[Flight], Floats]:
    """The position error along an axis: reference minus actual, m."""
    return lambda flight: flight[f"{axis}_ref"] - flight[axis]


def distance(flight: Flight, axes: str) -> Floats:
    """The norm of the position error along some axes, m."""
    return np.asarray(np.linalg.norm([error(axis)(flight) for axis in axes], axis=0))
