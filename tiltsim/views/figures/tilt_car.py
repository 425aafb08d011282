"""The panels of a tilt-car's flight (ch. 10 and 11)."""

from __future__ import annotations

from math import ceil, log10
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.scenario.gait import PenguinGait
from tiltsim.views.figures import style
from tiltsim.views.figures.layout import legend_over
from tiltsim.views.figures.panels import Panel, of_one, plan_view, show_last_periods, widen

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tiltsim.flight.flight import Flight

SHOWN_TIME: Final = 10.0
"""Last part (s) of a flight more than twice as long for which the direction is drawn."""

SETTLED: Final = 0.01
"""Share of the largest error below which the errors of a flight have settled."""

SMALLEST: Final = 1e-9
"""Errors (m) below this are rounding."""

SHORT: Final = 0.1
"""Share of a flight below which only the time until the errors have settled is shown."""


def _errors(axes: Axes, flight: Flight) -> None:
    time = flight["time"]
    errors = {axis: flight[f"{axis}_ref"] - flight[axis] for axis in "xy"}
    for (axis, error), line in zip(errors.items(), style.AXIS_LINES):
        axes.plot(time, error, label=axis, **line)
    style.zero_lines(axes, "x")
    widen(axes, 1e-6)
    axes.set_ylabel("m")
    title = "Position error, reference minus actual"
    size = np.max(np.abs([*errors.values()]), axis=0)
    settled = time[np.flatnonzero(size > SETTLED * size.max())[-1]] if size.any() else time[-1]
    if 2.0 * settled < SHORT * time[-1]:
        axes.set_xlim(0.0, 2.0 * settled)
        axes.set_xlabel(f"time (s), the first {2.0 * settled:.0f} s")
        later = max(float(size[time > 2.0 * settled].max()), SMALLEST)
        title = f"Position error, later below $10^{{{ceil(log10(later))}}}$ m"
    legend_over(axes, title)


def _inputs(axes: Axes, flight: Flight) -> None:
    time = flight["time"]
    lines = ((1, style.AMBER, "-", 2.4), (2, style.BLUE, "-", 1.2))
    for rotor, color, dash, width in lines:
        square = flight[f"rotor_speed_{rotor}"] ** 2
        axes.plot(time, square, color=color, ls=dash, lw=width, label=f"ω{'₁₂'[rotor - 1]}²")
    style.zero_lines(axes, "x")
    later = time >= min(2.0, 0.5 * time[-1])  # the values at the start may be far larger
    top = max(float((flight[f"rotor_speed_{rotor}"] ** 2)[later].max()) for rotor in (1, 2))
    top = top or 1.0  # of a car at rest
    axes.set_ylim(-0.04 * top, 1.6 * top)
    show_last_periods(axes, [flight])
    axes.set_ylabel("rad²/s²")
    legend_over(axes, "Inputs squared")


def _direction(axes: Axes, flight: Flight) -> None:
    time = flight["time"]
    begin = time[-1] - SHOWN_TIME if time[-1] > 2.0 * SHOWN_TIME else 0.0
    shown = time >= begin
    middle, lower, upper, desired = (
        flight[f"direction{name}"][shown] for name in ("", "_lower", "_upper", "_ref")
    )
    axes.plot(time[shown], middle, color=style.AMBER, lw=2.2, label="middle of the thrusts")
    text = "desired acceleration"
    axes.plot(time[shown], desired, color=style.INK, lw=1.1, ls=(0, (4, 2)), label=text)
    axes.margins(y=0.15)
    low, high = axes.get_ylim()
    shade: dict[str, Any] = {"color": style.UNREACHABLE, "lw": 0.0, "zorder": 0.5}
    axes.fill_between(time[shown], low, lower, **shade, label="inadmissible")
    axes.fill_between(time[shown], upper, high, **shade)
    axes.set(xlim=(begin, time[-1]), ylim=(low, high), ylabel="rad")
    if begin > 0.0:
        axes.set_xlabel(f"time (s), the last {SHOWN_TIME:g} s")
    legend_over(axes, "Direction")


def _direction_error(axes: Axes, flight: Flight) -> None:
    time = flight["time"]
    half = flight.scenario.tilt_car.half_angle
    difference = flight["direction_ref"] - flight["direction"]
    style.zero_lines(axes, "x")
    axes.plot(time, difference, color=style.GREEN, label="desired minus middle")
    later = time >= min(2.0, 0.5 * time[-1])
    limit = max(1.15 * half, 1.1 * float(np.abs(difference[later]).max()))
    axes.axhspan(half, limit, color=style.UNREACHABLE, lw=0.0, label="inadmissible")
    axes.axhspan(-limit, -half, color=style.UNREACHABLE, lw=0.0)
    axes.set(ylim=(-limit, limit), ylabel="rad")
    legend_over(axes, "Direction error")


def _lyapunov(axes: Axes, flight: Flight) -> None:
    axes.plot(flight["time"], flight["lyapunov"], color=style.GREEN)
    widen(axes, 1e-6)
    show_last_periods(axes, [flight])
    axes.set_ylabel("m²/s²")
    legend_over(axes, "Lyapunov candidate, ½ ė² + ½ K e², along y")


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
    style.legend_below(axes)


TILT_CAR_PANELS: Final[dict[str, Panel]] = {
    "position_error": of_one(_errors),
    "inputs": of_one(_inputs),
    "direction": of_one(_direction),
    "direction_error": of_one(_direction_error, unless="lyapunov"),
    "lyapunov": of_one(_lyapunov, needs="lyapunov"),
    "path": of_one(plan_view, over_time=False),
    "portrait": of_one(_portrait, over_time=False),
}
"""The panels of a tilt-car's page, by name."""
