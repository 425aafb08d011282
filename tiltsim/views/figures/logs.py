"""Figures of logs: several side by side, and how a model's predictions differ from one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.flight.flight import VECTORS, components
from tiltsim.logs.identify import Estimate, Replay
from tiltsim.logs.log import UNITS, Log
from tiltsim.system.text import in_words
from tiltsim.views.figures import style
from tiltsim.views.figures.layout import add_heading, add_legend

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim_controllers.mathematics.scalar import Floats

SHOWN: Final = ("position", "velocity", "attitude", "body_rates", "rotor_speeds", "tilt_angles")
"""Vectors of logs that are drawn, a panel for each column."""

MOST: Final = len(style.CYCLE)


def logs_figure(logs: Sequence[Log], names: Sequence[str], title: str | None) -> Figure:
    """Measured columns of logs and flights over time, a panel for each.

    Args:
        logs: One or several.
        names: Their names.
        title: Instead of the names; empty for none.
    """
    if len(logs) > MOST:
        raise InputError(f"plot: {len(logs)} logs: at most {MOST} fit on one page")
    known = dict.fromkeys(name for log in logs for name in log.units)
    rows = [components(vector, known) for vector in SHOWN]
    rows = [row[start : start + 3] for row in rows for start in range(0, len(row), 3)]
    if not rows:
        raise InputError(f"{logs[0].name}: nothing to draw: no column of a vehicle's motion")
    figure = style.new_figure(9.0, 1.4 * len(rows) + 0.9)
    grid = figure.subplots(len(rows), 3, sharex=True, squeeze=False)
    looks = [style.marked_line(number, max(map(len, logs))) for number in range(len(logs))]
    for axes, row in zip(grid, rows, strict=True):
        for one in axes[len(row) :]:
            one.set_visible(False)
        for one, name in zip(axes, row, strict=False):
            for log, look in zip(logs, looks, strict=True):
                if name in log.columns:
                    one.plot(log["time"], log[name], **look)
            one.set_ylabel(f"{in_words(name)} ({UNITS[name]})")
    for one in grid[-1]:
        one.set_xlabel("time (s)")
    handles = [
        grid[0, 0].plot([], [], **look, label=style.verbatim(name))[0]
        for look, name in zip(looks, names, strict=True)
    ]
    heading = names[0] if title is None and len(names) == 1 else title or ""
    add_heading(figure, style.verbatim(heading), "", handles if len(logs) > 1 else [])
    return figure


@style.paper_style()
def replay_figure(found: Replay) -> Figure:
    """Measured minus predicted over time, a panel for each vector."""
    vectors = [name for name in VECTORS if {*VECTORS[name]} & {*found.channels}]
    figure = style.new_figure(7.0, 1.7 * len(vectors) + 0.8)
    column = figure.subplots(len(vectors), 1, sharex=True, squeeze=False)[:, 0]
    for axes, vector in zip(column, vectors, strict=True):
        for name, color in zip(VECTORS[vector], style.CYCLE, strict=False):
            values = found.mismatch[:, :, found.channels.index(name)]
            _draw_windows(axes, found.time, values, color=color, label=in_words(name))
        axes.set_ylabel(f"{in_words(vector)} ({UNITS[VECTORS[vector][0]]})")
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    column[-1].set_xlabel("time (s)")
    column[0].set_title("measured minus predicted, from a measured state in each window")
    return figure


@style.paper_style()
def estimate_figure(found: Estimate) -> Figure:
    """Residuals over their noise: in order of time, and their distribution beside a normal one."""
    figure = style.new_figure(7.0, 3.0)
    left, right = figure.subplots(1, 2, width_ratios=(2, 1), sharey=True)
    values = found.residuals.reshape(len(found.residuals), -1)
    limit = max(4.0, float(np.quantile(np.abs(values), 0.99)))
    places = np.linspace(0.0, len(values), values.size)
    left.plot(places, values.ravel(), ".", ms=1.5, color=style.BLUE, alpha=0.5, rasterized=True)
    left.axhspan(-2.0, 2.0, color=style.PALE, zorder=0)
    left.set(xlabel="window", ylabel="residual / noise", ylim=(-limit, limit))
    left.set_title(f"χ² = {found.chi2:.3g} per degree of freedom")
    edges = np.linspace(-limit, limit, 61)
    known = values[values != 0.0]
    right.hist(known, edges, density=True, orientation="horizontal", color=style.SKY)
    bell = np.exp(-0.5 * edges**2) / (2.0 * np.pi) ** 0.5
    (line,) = right.plot(bell, edges, color=style.INK, label="noise alone")
    right.set(xlabel="density")
    add_legend(figure, [line])
    return figure


def _draw_windows(axes: Any, time: Floats, values: Floats, *, color: str, label: str) -> None:
    """One line with a hole between windows."""
    gap = np.full((len(time), 1), np.nan)
    axes.plot(
        np.hstack([time, gap]).ravel(), np.hstack([values, gap]).ravel(), color=color, label=label
    )
