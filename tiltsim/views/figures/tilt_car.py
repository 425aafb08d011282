"""The figure of a tilt-car's flight, with the panels of ch. 10 and 11."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.scenario.gait import PenguinGait
from tiltsim.views.figures import style
from tiltsim.views.figures.flight_layout import (
    SIZE,
    add_headings,
    label,
    legend_below,
    plan_view,
    widen,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tiltsim.flight.flight import Flight

SHOWN_TIME: Final = 10.0
"""Last part (s) of a flight more than twice as long for which the direction is drawn."""


def tilt_car_figure(flight: Flight) -> Figure:
    """Errors, inputs, directions and plan view."""
    with style.paper_style():
        figure = style.new_figure(*SIZE)
        add_headings(figure, flight)
        halves: Any = figure.subfigures(1, 2, width_ratios=[1.75, 1.0])
        left, right = halves
        series: Any = left.subplots(4, 1)
        last = _direction_error if "lyapunov" not in flight.columns else _lyapunov
        for axes, panel in zip(series, (_errors, _inputs, _direction, last), strict=True):
            panel(axes, flight)
        series[-1].set_xlabel("time (s)")
        above, below = right.subplots(2, 1)
        plan_view(above, flight)
        _portrait(below, flight)
        return figure


def _errors(axes: Axes, flight: Flight) -> None:
    style.zero_lines(axes, "x")
    for axis, line in zip("xy", style.AXIS_LINES):
        error = flight[f"{axis}_ref"] - flight[axis]
        axes.plot(flight["time"], error, label=axis, **line)
    _whole(axes, flight)
    widen(axes, 1e-6)
    label(axes, "Dynamic state error, reference minus actual", "m")


def _inputs(axes: Axes, flight: Flight) -> None:
    time = flight["time"]
    lines = ((1, style.AMBER, "-", 2.4), (2, style.BLUE, "-", 1.2))
    for rotor, color, dash, width in lines:
        square = flight[f"rotor_speed_{rotor}"] ** 2
        axes.plot(time, square, color=color, ls=dash, lw=width, label=f"ω{'₁₂'[rotor - 1]}²")
    style.zero_lines(axes, "x")
    later = time >= min(2.0, 0.5 * time[-1])  # the values at the start may be far larger
    top = max(float((flight[f"rotor_speed_{rotor}"] ** 2)[later].max()) for rotor in (1, 2))
    axes.set_ylim(-0.04 * top, 1.6 * top)
    _whole(axes, flight)
    label(axes, "Inputs squared", "rad²/s²")


def _direction(axes: Axes, flight: Flight) -> None:
    time = flight["time"]
    begin = time[-1] - SHOWN_TIME if time[-1] > 2.0 * SHOWN_TIME else 0.0
    shown = time >= begin
    middle, lower, upper, desired = (
        flight[f"direction{name}"][shown] for name in ("", "_lower", "_upper", "_ref")
    )
    axes.fill_between(time[shown], lower, upper, color=style.PALE, lw=0.0, label="admissible")
    axes.plot(time[shown], middle, color=style.AMBER, lw=2.2, label="middle")
    dashes = (0, (4, 2))
    axes.plot(
        time[shown], desired, color=style.INK, lw=1.1, ls=dashes, label="desired acceleration"
    )
    axes.set_xlim(begin, time[-1])
    label(axes, "Direction of the thrusts", "rad")


def _direction_error(axes: Axes, flight: Flight) -> None:
    time = flight["time"]
    half = flight.scenario.tilt_car.half_angle
    difference = flight["direction_ref"] - flight["direction"]
    axes.fill_between(time, -half, half, color=style.PALE, lw=0.0)
    style.zero_lines(axes, "x")
    axes.plot(time, difference, color=style.GREEN)
    later = time >= min(2.0, 0.5 * time[-1])
    limit = max(1.15 * half, 1.1 * float(np.abs(difference[later]).max()))
    axes.set_ylim(-limit, limit)
    _whole(axes, flight)
    title = "Desired acceleration relative to the middle of the thrusts; shaded: admissible"
    label(axes, title, "rad")


def _lyapunov(axes: Axes, flight: Flight) -> None:
    axes.plot(flight["time"], flight["lyapunov"], color=style.GREEN)
    _whole(axes, flight)
    widen(axes, 1e-6)
    label(axes, "Lyapunov candidate, ½ ė² + ½ K e², along y", "m²/s²")


def _whole(axes: Axes, flight: Flight) -> None:
    style.time_axis(axes, flight["time"][-1])


def _portrait(axes: Axes, flight: Flight) -> None:
    """The phase portrait of the error along y."""
    error = flight["y_ref"] - flight["y"]
    rate = flight["vy_ref"] - flight["vy"]
    style.zero_lines(axes)
    axes.plot(error, rate, color=style.BLUE, lw=1.0, label="path")
    gait = flight.scenario.gait
    if isinstance(gait, PenguinGait):
        half = flight["time"] / (0.5 * gait.period)
        at = (np.abs(half - np.round(half)) < 1e-6) & (half > 0.5)
        axes.plot(error[at], rate[at], "o", color=style.RED, ms=4.5, zorder=4, label="at n T/2")
    axes.plot(error[0], rate[0], "o", color=style.INK, mfc="white", ms=5, label="start")
    axes.plot(error[-1], rate[-1], "s", color=style.INK, ms=4, label="end")
    widen(axes, 1e-6)
    axes.margins(0.08)
    title = "Error along y and its rate"
    axes.set(xlabel="error e_y (m)", ylabel="rate of the error (m/s)", title=title)
    legend_below(axes)
