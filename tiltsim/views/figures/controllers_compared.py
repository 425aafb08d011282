"""Controllers side by side: tracking errors and tolerated disturbances of each."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tiltsim.studies.comparison import Compared, is_last_tried, why_none
from tiltsim.views.figures import style
from tiltsim.views.figures.layout import add_legend
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
    grid: Any = figure.subplots(
        len(scenarios), 1 + searched, squeeze=False, gridspec_kw=ratios or None
    )
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
