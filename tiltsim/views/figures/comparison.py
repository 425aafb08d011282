"""Several flights on one page: how close each came to a singularity, and what it cost."""

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
    from matplotlib.figure import Figure

    from tiltsim.flight.flight import Flight

MAX_FLIGHTS: Final = len(style.CYCLE)


def comparison_figure(flights: Sequence[Flight], names: Sequence[str] = ()) -> Figure:
    """Margin, determinant, supervisor and position error of rotorcraft flights over time.

    ``names`` are those of the flights, by default `flight_names`.

    Raises
    ------
    InputError
        If there are more flights than colours, or one is of a vehicle that has no margin.
    """
    if len(flights) > MAX_FLIGHTS:
        raise InputError(f"plot: {len(flights)} flights, at most {MAX_FLIGHTS} on one page")
    scenarios = [flight.scenario for flight in flights]
    names = names or flight_names(scenarios)
    for flight, name in zip(flights, names, strict=True):
        if "singularity_margin" not in flight.units:
            model = flight.scenario.vehicle.model
            raise InputError(f"plot: {name}: the {model} has no margin to compare")
    panels: list[tuple[Any, str, str]] = [(_margin, "Singularity margin", "rad")]
    if all("determinant" in flight.units for flight in flights):
        panels.append((_determinant, "Determinant, 4 for a level untilted vehicle", "n · r₃"))
    if any(SUPERVISION in flight.columns for flight in flights):
        panels.append((_supervision, "What the supervisor takes away", "share"))
    panels.append((_error, "Distance from the reference", "m"))
    with style.paper_style():
        figure = style.new_figure(8.2, 1.9 * len(panels) + 1.1)
        rows: Any = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (draw, title, unit) in zip(rows, panels, strict=True):
            for number, flight in enumerate(flights):
                look = style.line_style(number)
                line = draw(axes, flight)
                if line is None:
                    continue
                time = flight["time"]
                axes.plot(time, line, lw=1.3, **look)
                if flight.end.kind != "completed":
                    low, high = axes.get_ylim()
                    last = float(np.clip(line[-1], low, high))
                    axes.plot(
                        *(time[-1], last, "X"),
                        **{"color": look["color"], "ms": 7, "zorder": 6, "clip_on": False},
                    )
            axes.set_title(title)
            axes.set_ylabel(unit)
        rows[-1].set_xlim(0.0, max(float(flight["time"][-1]) for flight in flights))
        rows[-1].set_xlabel("time (s)")
        for number, (flight, name) in enumerate(zip(flights, names, strict=True)):
            lost = flight.end.kind != "completed"
            label = style.verbatim(name) + (f", lost at {flight.end.time:.2f} s" if lost else "")
            rows[0].plot([], [], label=label, **style.line_style(number))
        # As the legend's title the heading keeps clear of it, however many rows that has.
        heading = common_title(scenarios) or f"{len(flights)} flights compared"
        figure.legend(
            loc="outside upper left",
            ncols=2,
            alignment="left",
            title=style.verbatim(heading),
            title_fontproperties={"size": 12, "weight": "bold"},
        )
        return figure


def _margin(axes: Any, flight: Flight) -> Any:
    if SUPERVISION in flight.columns:
        axes.axhline(margin_threshold(flight.scenario), color=style.GREY, ls="--", lw=0.9)
    style.angle_axis(axes, "y", pi / 2)
    axes.set_ylim(0.0, pi / 2 * 1.02)
    return np.maximum(flight["singularity_margin"], 0.0)


def _determinant(axes: Any, flight: Flight) -> Any:
    supervisor = flight.scenario.controller.supervision
    if supervisor is not None:
        axes.axhline(supervisor.min_determinant, color=style.GREY, ls="--", lw=0.9)
    line = np.maximum(flight["determinant"], 0.0)
    axes.set_ylim(0.0, max(axes.get_ylim()[1], 4.0, 1.05 * float(line.max())))
    return line


def _supervision(axes: Any, flight: Flight) -> Any:
    axes.set_ylim(-0.03, 1.03)
    return flight.columns.get(SUPERVISION)


def _error(axes: Any, flight: Flight) -> Any:
    names = "xyz" if flight.assembly.follows_position else "z"
    return np.linalg.norm([flight[f"{axis}_ref"] - flight[axis] for axis in names], axis=0)
