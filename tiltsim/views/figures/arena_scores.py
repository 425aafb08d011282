"""The scores of the arena: tasks by controllers for two vehicles, and the totals of all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.studies.arena import Standing
from tiltsim.studies.arena_page import cell
from tiltsim.views.figures import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DETAILED: Final = 2
"""Vehicles with a panel of their own, the first ones; all have a row in the panel of totals."""

Cells = dict[str, dict[str, tuple[float | None, float | None]]]
"""Scores with default and tuned gains, by row and controller."""


def arena_figure(every: Mapping[str, Sequence[Standing]]) -> Figure:
    """Every score as numbers on the shade of the one with tuned gains; the best first."""
    panels = {
        f"{vehicle}: score, 100 without error, – where refused": _by_task(ranked)
        for vehicle, ranked in islice(every.items(), DETAILED)
    }
    if len(every) > DETAILED:
        panels["all tasks of every vehicle"] = {
            vehicle: {one.controller: (one.total, one.tuned_total) for one in ranked}
            for vehicle, ranked in every.items()
        }
    with style.paper_style():
        heights = [1 + len(cells) for cells in panels.values()]
        width = 1.6 + 0.9 * max(len(_columns(cells)) for cells in panels.values())
        figure = style.new_figure(max(4.0, width), 0.9 * len(heights) + 0.26 * sum(heights))
        grid: Any = figure.subplots(
            len(heights), 1, squeeze=False, gridspec_kw={"height_ratios": heights}
        )
        for axes, (title, cells) in zip(grid[:, 0], panels.items(), strict=True):
            _draw(axes, cells)
            axes.set_title(title)
        return figure


def _by_task(ranked: Sequence[Standing]) -> Cells:
    rows: Cells = {
        task: {one.controller: (one.scores[task], one.tuned[task]) for one in ranked}
        for task in ranked[0].scores
    }
    return rows | {"all tasks": {one.controller: (one.total, one.tuned_total) for one in ranked}}


def _columns(cells: Cells) -> list[str]:
    return list(dict.fromkeys(name for row in cells.values() for name in row))


def _draw(axes: Any, cells: Cells) -> None:
    names, rows = _columns(cells), [*cells]
    pairs = [[cells[row].get(name) for name in names] for row in rows]
    values = np.array([[None if p is None else p[1] for p in line] for line in pairs], dtype=float)
    axes.imshow(values, cmap="Blues", vmin=0.0, vmax=100.0, aspect="auto")
    for (place, column), value in np.ndenumerate(values):
        pair = pairs[place][column]
        axes.text(
            column,
            place,
            "" if pair is None else cell(*pair).replace("-", "–"),
            ha="center",
            va="center",
            color="white" if value > 60.0 else "black",
            weight="bold" if rows[place] == "all tasks" else "normal",
            size="small",
        )
    if rows[-1] == "all tasks":
        axes.axhline(len(rows) - 1.5, color="black", lw=1.0)
    labels = [style.verbatim(name) for name in names]
    axes.set_xticks(range(len(names)), labels, rotation=20, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(rows)), list(map(style.verbatim, rows)))
    axes.grid(visible=False)
    axes.tick_params(length=0)
