"""The scores of the arena: tasks by controllers, a panel for each vehicle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tiltsim.studies.arena import Standing, shown
from tiltsim.views.figures import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def arena_figure(every: Mapping[str, Sequence[Standing]]) -> Figure:
    """Every score as a number on its shade; the best controllers first."""
    with style.paper_style():
        heights = [1 + len(ranked[0].scores) for ranked in every.values()]
        width = 1.6 + 0.75 * max(len(ranked) for ranked in every.values())
        figure = style.new_figure(max(4.0, width), 0.9 * len(heights) + 0.26 * sum(heights))
        grid: Any = figure.subplots(
            len(heights), 1, squeeze=False, gridspec_kw={"height_ratios": heights}
        )
        for axes, (vehicle, ranked) in zip(grid[:, 0], every.items(), strict=True):
            _draw(axes, ranked)
            axes.set_title(f"{vehicle}: score, 100 without error, – where refused")
        return figure


def _draw(axes: Any, ranked: Sequence[Standing]) -> None:
    tasks = [*ranked[0].scores]
    rows = [[standing.scores[task] for standing in ranked] for task in tasks]
    rows.append([standing.total for standing in ranked])
    values = np.array(rows, dtype=float)
    axes.imshow(values, cmap="Blues", vmin=0.0, vmax=100.0, aspect="auto")
    for place, row in enumerate(rows):
        for column, value in enumerate(row):
            dark = value is not None and value > 60.0
            axes.text(
                column,
                place,
                shown(value).replace("-", "–"),
                ha="center",
                va="center",
                color="white" if dark else "black",
                weight="bold" if place == len(tasks) else "normal",
                size="small",
            )
    axes.axhline(len(tasks) - 0.5, color="black", lw=1.0)
    names = [style.verbatim(standing.controller) for standing in ranked]
    axes.set_xticks(range(len(names)), names, rotation=20, ha="right", rotation_mode="anchor")
    labels = [style.verbatim(task) for task in tasks]
    axes.set_yticks(range(len(rows)), [*labels, "all tasks"])
    axes.grid(visible=False)
    axes.tick_params(length=0)
