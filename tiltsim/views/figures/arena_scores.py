"""The scores of the arena: tasks by controllers for two vehicles, and the totals of all."""

from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from tiltsim.studies.arena import Standing
from tiltsim.studies.arena_page import cell
from tiltsim.system.text import in_words
from tiltsim.views.figures import style
from tiltsim.views.figures.layout import add_heading

DETAILED: Final = 2  # vehicles with a separate panel; all have a row in the panel of totals
WIDE: Final = 9  # letters of a controller's name that fit above its column
ALL: Final = "all tasks"
LEGEND: Final = "100 without error; default → tuned gains; – where refused"

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
    } | {ALL: {one.controller: (one.total, one.tuned_total) for one in ranked}}


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
    grid: Any = figure.subplots(
        len(heights), 1, squeeze=False, gridspec_kw={"height_ratios": heights}
    )
    for axes, (title, cells) in zip(grid[:, 0], panels.items(), strict=True):
        _draw(axes, cells, names)
        axes.set_title(style.verbatim(in_words(title)))
    add_heading(figure, "Scores", LEGEND)
    return figure


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
