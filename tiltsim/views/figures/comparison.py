"""Several flights on one page: their margins to singularities and their tracking errors."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.laws.layers.supervision import SUPERVISION
from tiltsim.views.attitude_plane import margin_threshold
from tiltsim.views.figures import style
from tiltsim.views.titles import common_title, flight_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tiltsim.flight.flight import Flight
    from tiltsim_controllers.mathematics.scalar import Floats

MAX_FLIGHTS: Final = len(style.CYCLE)


def comparison_figure(flights: Sequence[Flight], names: Sequence[str] = ()) -> Figure:
    """Margin, determinant, supervisor and position error of rotorcraft flights over time.

    ``names`` are those of the flights, by default `flight_names`.

    Raises:
        InputError: If there are more flights than colours, or a vehicle has no singularity margin.
    """
    if len(flights) > MAX_FLIGHTS:
        raise InputError(f"plot: {len(flights)} flights: at most {MAX_FLIGHTS} fit on one page")
    scenarios = [flight.scenario for flight in flights]
    names = names or flight_names(scenarios)
    for flight, name in zip(flights, names, strict=True):
        if "singularity_margin" not in flight.units:
            model = flight.scenario.vehicle.model
            raise InputError(f"plot: {name}: the {model} has no singularity margin to compare")
    panels: list[tuple[Any, str, str]] = [(_margin, "Singularity margin", "rad")]
    if all("determinant" in flight.units for flight in flights):
        panels.append((_determinant, "Determinant, 4 for a level untilted vehicle", "n · r₃"))
    if any(SUPERVISION in flight.columns for flight in flights):
        panels.append((_supervision, "Supervisor output", "0 to 1"))
    panels.append((_error, "Distance from the reference", "m"))
    with style.paper_style():
        figure = style.new_figure(8.2, 1.9 * len(panels) + 1.1)
        rows: Any = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (draw, title, unit) in zip(rows, panels, strict=True):
            for number, flight in enumerate(flights):
                line = draw(axes, flight)
                if line is not None:
                    _plot(axes, flight, line, number)
            axes.set(title=title, ylabel=unit)
        rows[-1].set_xlim(0.0, max(float(flight["time"][-1]) for flight in flights))
        rows[-1].set_xlabel("time (s)")
        for number, (flight, name) in enumerate(zip(flights, names, strict=True)):
            label = style.verbatim(name)
            if flight.end.kind != "completed":
                label += f", {flight.end.kind} at {flight.end.time:.2f} s"
            rows[0].plot([], [], label=label, **style.line_style(number))
        # The heading is the title of the legend, so that it stays above its rows.
        heading = common_title(scenarios) or f"{len(flights)} flights compared"
        figure.legend(
            loc="outside upper left",
            ncols=2,
            alignment="left",
            title=style.verbatim(heading),
            title_fontproperties={"size": 12, "weight": "bold"},
        )
        return figure


def _plot(axes: Axes, flight: Flight, line: Floats, number: int) -> None:
    """A line over the time of a flight, with a cross where it terminated early."""
    look = style.line_style(number)
    axes.plot(flight["time"], line, lw=1.3, **look)
    if flight.end.kind != "completed":
        end = float(np.clip(line[-1], *axes.get_ylim()))
        axes.plot(flight["time"][-1], end, "X", color=look["color"], ms=7, zorder=6, clip_on=False)


def _margin(axes: Axes, flight: Flight) -> Floats:
    if SUPERVISION in flight.columns:
        axes.axhline(margin_threshold(flight.scenario), color=style.GREY, ls="--", lw=0.9)
    style.angle_axis(axes, "y", pi / 2)
    axes.set_ylim(0.0, pi / 2 * 1.02)
    return np.maximum(flight["singularity_margin"], 0.0)


def _determinant(axes: Axes, flight: Flight) -> Floats:
    supervisor = flight.scenario.controller.supervision
    if supervisor is not None:
        axes.axhline(supervisor.min_determinant, color=style.GREY, ls="--", lw=0.9)
    line = np.maximum(flight["determinant"], 0.0)
    axes.set_ylim(0.0, max(axes.get_ylim()[1], 4.0, 1.05 * float(line.max())))
    return line


def _supervision(axes: Axes, flight: Flight) -> Floats | None:
    axes.set_ylim(-0.03, 1.03)
    return flight.columns.get(SUPERVISION)


def _error(_axes: Axes, flight: Flight) -> Floats:
    names = "xyz" if flight.assembly.follows_position else "z"
    errors = [flight[f"{axis}_ref"] - flight[axis] for axis in names]
    return np.asarray(np.linalg.norm(errors, axis=0))
