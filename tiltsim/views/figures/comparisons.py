"""Comparisons of controllers: errors, tolerated disturbances, scores, setpoints and periods."""

from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tiltsim.studies.arena import Standing
from tiltsim.studies.arena_page import cell, shown
from tiltsim.studies.comparison import Compared, is_last_tried, why_none
from tiltsim.system.text import in_words
from tiltsim.views.figures import style
from tiltsim.views.figures.layout import add_heading, add_legend
from tiltsim.views.titles import address_in_words, law_in_words

SURVIVED: Final = {
    "max_latency": ("latency", 0.0, "{:.3f} s"),
    "max_mass_factor": ("larger mass", 1.0, "× {:.2f}"),
    "min_thrust_factor": ("less thrust", 1.0, "× {:.2f}"),
    "max_inertia_factor": ("larger inertia", 1.0, "× {:.1f}"),
}
"""Measures: name, true value, and form of the value."""

SMALLEST: Final = 1e-6  # m, below which errors are as good as zero

LEFT_OUT: Final = 0.02
"""Share of the smallest errors, such as the start of a flight, that the scale leaves out."""


@style.paper_style()
def comparison_figure(rows: Sequence[Compared]) -> Figure:
    """One line of panels for every scenario."""
    scenarios = list(dict.fromkeys(compared.row["scenario"] for compared in rows))
    names = list(dict.fromkeys(compared.row["controller"] for compared in rows))
    searched = any(c.row[key] is not None for c in rows for key in SURVIVED)
    looks = {name: style.line_style(number) for number, name in enumerate(names)}
    figure = style.new_figure(9.0 if searched else 5.6, 2.9 * len(scenarios) + 0.5)
    ratios = {"width_ratios": [1.1, 1.0]} if searched else {}
    grid = figure.subplots(len(scenarios), 1 + searched, squeeze=False, gridspec_kw=ratios or None)
    for line, scenario in zip(grid, scenarios, strict=True):
        chosen = [c for c in rows if c.row["scenario"] == scenario]
        _draw_errors(line[0], chosen, looks)
        line[0].set_title(style.verbatim(address_in_words(scenario)))
        if searched:
            _draw_survived(line[1], chosen, looks)
    handles = [
        grid[0][0].plot([], [], label=style.verbatim(law_in_words(name)), **looks[name])[0]
        for name in names
    ]
    add_legend(figure, handles)
    return figure


def _draw_errors(axes: Axes, rows: Sequence[Compared], looks: Mapping[str, Any]) -> None:
    """Distances from the reference over time."""
    end, lows = 0.0, []
    for compared in rows:
        if not len(compared.time):
            continue
        error = np.maximum(compared.error, SMALLEST)
        axes.plot(compared.time, error, **looks[compared.row["controller"]])
        end = max(end, float(compared.time[-1]))
        lows.append(float(np.quantile(error, LEFT_OUT)))
        if compared.row["end"] != "completed":
            color = looks[compared.row["controller"]]["color"]
            axes.plot(compared.time[-1:], error[-1:], "x", ms=8, mew=2.0, color=color)
    style.time_axis(axes, end)
    axes.set(xlabel="time (s)", ylabel="position error (m)", yscale="log")
    if lows:
        axes.set_ylim(bottom=0.7 * min(lows))


def _draw_survived(axes: Axes, rows: Sequence[Compared], looks: Mapping[str, Any]) -> None:
    """The largest disturbances that each survives, as a share of the best."""
    height = 0.8 / len(rows)
    for place, (key, (_, true, form)) in enumerate(SURVIVED.items()):
        values = [compared.row[key] for compared in rows]
        best = max((abs(value - true) for value in values if value is not None), default=0.0)
        for number, (compared, value) in enumerate(zip(rows, values, strict=True)):
            y = place - 0.4 + (number + 0.5) * height
            share = abs(value - true) / best if value is not None and best > 0.0 else 0.0
            color = looks[compared.row["controller"]]["color"]
            axes.barh(y, share, 0.85 * height, color=color)
            text = why_none(compared.row, key) if value is None else form.format(value)
            text += ", the last tried" * is_last_tried(compared.row, key)
            axes.text(share + 0.02, y, text, va="center", size="x-small")
    axes.set(
        title="Errors of the model, and latency, survived",
        xlabel="share of the best",
        xlim=(0.0, 1.45),
    )
    axes.set_yticks(range(len(SURVIVED)), [name for name, _, _ in SURVIVED.values()])
    axes.set_xticks([0.0, 0.5, 1.0])
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")


DETAILED: Final = 2  # vehicles with a separate panel; all have a row in the panel of totals
WIDE: Final = 9  # letters of a controller's name that fit above its column
ALL: Final = "all tasks"

Point = tuple[float, float]  # errors along x and y, m
Cells = dict[str, dict[str, tuple[float | None, float | None]]]
"""Scores with default and tuned gains, by row and controller."""


def panels_of(every: Mapping[str, Sequence[Standing]]) -> dict[str, Cells]:
    """Tasks of the first vehicles, and the totals of all."""
    panels = {vehicle: tasks_of(ranked) for vehicle, ranked in islice(every.items(), DETAILED)}
    if len(every) > DETAILED:
        panels["all tasks of every vehicle"] = vehicles_of(every)
    return panels


def tasks_of(ranked: Sequence[Standing]) -> Cells:
    """Scores by task, and their mean."""
    return {
        task: {one.controller: (one.scores[task], one.tuned[task]) for one in ranked}
        for task in ranked[0].scores
    } | vehicles_of({ALL: ranked})


def vehicles_of(every: Mapping[str, Sequence[Standing]]) -> Cells:
    """Means of all tasks by vehicle."""
    return {
        vehicle: {one.controller: (one.total, one.tuned_total) for one in ranked}
        for vehicle, ranked in every.items()
    }


@style.paper_style()
def arena_figure(panels: Mapping[str, Cells]) -> Figure:
    """Every score as numbers on the shade of the one with tuned gains."""
    # All panels have these columns.
    rows = [row for cells in panels.values() for row in cells.values()]
    names = [*dict.fromkeys(name for row in rows for name in row)]
    heights = [1 + len(cells) for cells in panels.values()]
    height = 1.1 + 0.5 * len(heights) + 0.24 * sum(heights)
    figure = style.new_figure(max(4.5, 1.4 + 0.72 * len(names)), height)
    grid = figure.subplots(len(heights), 1, squeeze=False, gridspec_kw={"height_ratios": heights})
    for axes, (title, cells) in zip(grid[:, 0], panels.items(), strict=True):
        _draw(axes, cells, names)
        axes.set_title(style.verbatim(in_words(title)))
    add_heading(figure, "Scores", _legend([pair for row in rows for pair in row.values()]))
    return figure


def _legend(pairs: Sequence[tuple[float | None, float | None]]) -> str:
    """The meaning of the numbers that are drawn."""
    words = ["100 without error"]
    if any(shown(default) != shown(tuned) for default, tuned in pairs):
        words.append("default → tuned gains")
    if any(tuned is None for _, tuned in pairs):
        words.append("– where refused")
    return "; ".join(words)


def _draw(axes: Any, cells: Cells, names: Sequence[str]) -> None:
    rows = [*cells]
    pairs = [[cells[row].get(name) for name in names] for row in rows]
    values = np.array([[None if p is None else p[1] for p in line] for line in pairs], dtype=float)
    axes.imshow(values, cmap="Blues", vmin=0.0, vmax=100.0, aspect="auto")
    for (place, column), value in np.ndenumerate(values):
        pair = pairs[place][column]
        text = "" if pair is None else cell(*pair).replace("-", "–")
        look = {"ha": "center", "va": "center", "size": "small"}
        look["color"] = "white" if value > 60.0 else style.INK
        axes.text(column, place, text, weight="bold" if rows[place] == ALL else "normal", **look)
    if rows[-1] == ALL:
        axes.axhline(len(rows) - 1.5, color=style.INK, lw=1.0)
    words = [in_words(name) for name in names]
    labels = [word.replace(" ", "\n") if len(word) > WIDE else word for word in words]
    axes.set_xticks(range(len(names)), [*map(style.verbatim, labels)])
    axes.set_yticks(range(len(rows)), [style.verbatim(in_words(row)) for row in rows])
    axes.grid(visible=False)
    axes.tick_params(length=0)


@style.paper_style()
def setpoint_figure(families: Mapping[str, tuple[Mapping[str, Point], Sequence[Point]]]) -> Figure:
    """Steady position errors, reference minus actual, by title and name, and published ones.

    One panel per family, each with its own scale, so that every point has room for its name.
    """
    figure = style.new_figure(4.2 * len(families), 4.3)
    row = figure.subplots(1, len(families), squeeze=False)[0]
    colors = (style.RED, style.BLUE)
    for axes, (title, (points, published)), color in zip(row, families.items(), colors):
        style.zero_lines(axes)
        look: dict[str, Any] = {"ms": 10, "mfc": "none", "mec": style.INK}
        axes.plot(*zip(*published, strict=True), "s", **look, label="published")
        axes.plot(*zip(*points.values(), strict=True), "o", ms=4.5, color=color, label="measured")
        for name, point in points.items():
            text = axes.annotate(name, point, (7, 5), textcoords="offset points")
            text.set(size="small", color=color)
        axes.set(xlabel="error along x (m)", ylabel="error along y (m)", title=title)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.14)
    row[0].legend(loc="upper right")
    return figure


@style.paper_style()
def period_figure(panels: Mapping[str, Mapping[str, Mapping[float, float | None]]]) -> Figure:
    """Largest error after 20 s by period, on a logarithmic scale that all panels share.

    Errors (m) by title, label and period (s). A cross at the upper edge marks a flight that
    terminated early, whose error is None.
    """
    figure = style.new_figure(2.5 * len(panels) + 0.9, 3.0)
    row = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    looks = [(style.RED, "o-"), (style.BLUE, "s-"), (style.RED, "o:"), (style.BLUE, "s:")]
    terminated = False
    for axes, (title, series) in zip(row, panels.items(), strict=True):
        for (label, errors), (color, look) in zip(series.items(), looks, strict=False):
            flown = zip(*((period, error) for period, error in errors.items() if error is not None))
            fill = "white" if ":" in look else color
            axes.plot(*flown, look, color=color, ms=4.5, mfc=fill, label=label)
            ended = [period for period, error in errors.items() if error is None]
            cross = {"color": color, "ms": 8, "mew": 2.0, "transform": axes.get_xaxis_transform()}
            axes.plot(ended, [0.96] * len(ended), "x", **cross)
            terminated |= bool(ended)
            axes.set_xticks([*errors])
        axes.set(title=title, xlabel="period (s)", yscale="log")
        axes.margins(x=0.12, y=0.12)
    row[0].set_ylabel("largest error after 20 s (m)")
    if terminated:
        row[0].plot([], [], "x", color=style.INK, ms=8, mew=2.0, label="terminated early")
    add_legend(figure, row[0].get_legend_handles_labels()[0])
    return figure
