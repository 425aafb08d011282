"""Flights in one panel over time: a line each, or the median and quantiles of many."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple
from warnings import catch_warnings, simplefilter

import numpy as np
from matplotlib.axes import Axes

from tiltsim.flight.flight import Flight
from tiltsim.laws.law import SUPERVISION
from tiltsim.views.figures import style
from tiltsim_controllers.mathematics.scalar import Floats

MAX_PERIODS: Final = 10  # periods of a gait beyond which a line would be a solid band
MOST_LINES: Final = len(style.CYCLE)  # flights up to which each has its own line
BANDS: Final = ((0.05, 0.95, 0.18, "90 % of {} flights"), (0.25, 0.75, 0.35, "half of them"))
"""Lower and upper quantile, opacity and name of each band."""


class Shown(NamedTuple):
    """A flight of a figure, with the text of its legend and the look of its lines."""

    flight: Flight
    name: str
    look: Mapping[str, Any]


def plot_flights(axes: Axes, shown: Sequence[Shown], values: Sequence[Floats]) -> None:
    """A line for every flight, or quantiles of many."""
    if len(shown) > MOST_LINES:
        _draw_bands(axes, [one.flight["time"] for one in shown], values)
    for one, own in () if len(shown) > MOST_LINES else zip(shown, values, strict=True):
        _plot(axes, one, own)


def _plot(axes: Axes, one: Shown, values: Floats) -> None:
    """A line over a whole flight; where it would be a solid band, its range over every period."""
    time, period = one.flight["time"], many_periods([one.flight])
    if period > 0.0:
        starts = np.searchsorted(time, np.arange(0.0, time[-1], period))
        low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        color, middle = one.look["color"], time[starts] + 0.5 * period
        label = "range over each period"
        axes.fill_between(middle, low, high, color=color, alpha=0.3, lw=0.0, label=label)
        axes.plot(middle, 0.5 * (low + high), **{**one.look, "markevery": None, "marker": ""})
    else:
        axes.plot(time, values, **one.look)
    if "marker" in one.look:
        mark_end(axes, one, values)


def mark_end(axes: Axes, one: Shown, values: Floats) -> None:
    """A cross where a flight terminated early."""
    if one.flight.end.kind != "completed":
        at, color = (one.flight["time"][-1], values[-1]), one.look["color"]
        axes.plot(*at, "X", color=color, ms=6, zorder=6, clip_on=False)


def many_periods(flights: Sequence[Flight]) -> float:
    """The longest period (s) of gaits whose periods would be a solid band, else 0."""
    end = max(float(flight["time"][-1]) for flight in flights)
    if any(SUPERVISION in flight.units for flight in flights):
        return 0.0
    periods = [
        flight.assembly.gait.period or 0.0
        for flight in flights
        if flight.scenario.vehicle.has_tilting_rotors
    ]
    return max((period for period in periods if end > MAX_PERIODS * period), default=0.0)


def _draw_bands(axes: Axes, times: Sequence[Floats], values: Sequence[Floats]) -> None:
    """Draw quantiles over time, at each time of the flights that have not ended by then.

    Args:
        axes: Axes over time, s.
        times: The times of the samples of each flight, s.
        values: Their values.
    """
    grid = max(times, key=lambda time: float(time[-1]))
    rows = [np.interp(grid, time, own, right=np.nan) for time, own in zip(times, values)]
    shares = [0.5, *(share for low, high, _, _ in BANDS for share in (low, high))]
    with catch_warnings():
        simplefilter("ignore", RuntimeWarning)  # none of the values at a time is finite
        median, *edges = np.nanquantile(np.stack(rows), shares, axis=0)
    for (_, _, alpha, label), low, high in zip(BANDS, edges[::2], edges[1::2], strict=True):
        look: dict[str, Any] = {"color": style.BLUE, "alpha": alpha, "lw": 0.0}
        axes.fill_between(grid, low, high, label=label.format(len(rows)), **look)
    for edge in edges[:2]:  # lines set the limits of the axes
        axes.plot(grid, edge, color=style.BLUE, alpha=BANDS[0][2], lw=0.5)
    axes.plot(grid, median, color=style.BLUE, lw=1.4, label="median")
