"""Figures of sweeps: lines, maps, distributions and boundaries."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import fill
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.figures.style import (
    CYCLE,
    DASHES,
    GREY,
    MARKERS,
    PALE,
    RED,
    SEQUENTIAL,
    new_figure,
    paper_style,
)
from tiltsim.metrics import METRICS
from tiltsim.sweeps.dataset import Column, SweepResults
from tiltsim.sweeps.tables import ListAxis, NormalAxis, UniformAxis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_PANELS: Final = 24
MAX_LINES: Final = len(CYCLE)
_UNITS: Final = frozenset({"m", "s", "rad", "rad/s"})
_KEY_UNITS: Final = {
    "gait.period": "s",
    "gait.amplitude": "rad",
    "gait.angles": "rad",
    "initial.attitude": "rad",
    "initial.position": "m",
    "simulation.duration": "s",
    "vehicle.mass": "kg",
}


def sweep_figure(results: SweepResults, metrics: tuple[str, ...] = ()) -> Figure:
    """The figure that suits a sweep, or the one that its ``[plot]`` table asks for.

    Parameters
    ----------
    results
        From `tiltsim.sweeps.dataset.load_results`.
    metrics
        What to draw; default: those of the ``[plot]`` table, else the first few.

    Raises
    ------
    InputError
        If a column or metric is unknown, or there would be too many panels.
    """
    plot = results.plan.sweep.plot
    kind = plot.kind or _kind(results)
    draw = {
        "lines": _lines_figure,
        "map": _map_figure,
        "quantiles": _quantiles_figure,
        "boundary": _boundary_figure,
        "plane": _plane_figure,
    }[kind]
    with paper_style():
        figure = draw(results, _metrics(results, metrics))
        title = results.plan.sweep.title or results.plan.definition.address
        missing = len(results.plan) - len(results)
        more = f" ({missing} of {len(results.plan)} points still to come)" if missing else ""
        lines = fill(title + more, round(11.0 * figure.get_figwidth()))
        figure.suptitle(lines, x=0.01, ha="left", fontsize=10.5)
        return figure


def _kind(results: SweepResults) -> str:
    if results.plan.sweep.bisect is not None:
        return "boundary"
    if _drawn(results):
        return "quantiles"
    return "map" if len(_numeric_axes(results)) >= 2 else "lines"


def _drawn(results: SweepResults) -> list[str]:
    axes = results.plan.sweep.axis
    return [a.targets[0] for a in axes if isinstance(a, UniformAxis | NormalAxis)]


def _numeric_axes(results: SweepResults) -> list[str]:
    keys = [key for axis in results.plan.sweep.axis for key in axis.targets[:1]]
    return [key for key in keys if results.columns[key].dtype == np.float64]


def _text_axes(results: SweepResults) -> list[str]:
    keys = [a.targets[0] for a in results.plan.sweep.axis if isinstance(a, ListAxis)]
    return [key for key in keys if results.columns[key].dtype != np.float64]


def _metrics(results: SweepResults, wanted: tuple[str, ...]) -> tuple[str, ...]:
    # Results of an earlier tiltsim lack the metrics that came later.
    kept = tuple(name for name in results.plan.metrics if name in results.columns)
    chosen = wanted or results.plan.sweep.plot.metrics
    for name in chosen:
        if name not in kept:
            raise InputError(
                f"{results.plan.definition.address}: plot.metrics = {name!r}: not in these "
                f"results; choose {', '.join(kept)}"
            )
    return chosen or tuple(name for name in kept if _varies(results.columns[name]))[:3] or kept[:1]


def _varies(column: Column) -> bool:
    known = column[~np.isnan(column)]
    return known.size > 0 and float(np.ptp(known)) > 0.0


def _is_wide(values: Column) -> bool:
    """Whether values are all above zero and range over more than a decade or two."""
    known = values[~np.isnan(values)]
    return bool(known.size) and 0.0 < 50.0 * float(known.min()) < float(known.max())


def _completed(results: SweepResults) -> Column:
    return np.array(results.columns["end"] == "completed")


def _groups(results: SweepResults, key: str | None, mask: Column) -> Iterator[tuple[str, Column]]:
    """The values of a column among some rows, as text, each with its rows."""
    if key is None:
        yield "", mask
        return
    column = results.values(key)
    texts = np.array([_text(value) for value in column], dtype=object)
    for text in dict.fromkeys(texts[mask].tolist()):
        yield text, mask & (texts == text)


def _text(value: Any) -> str:
    if isinstance(value, list):
        return "(" + ", ".join(map(_text, value)) + ")"
    return f"{value:g}" if isinstance(value, float | int) else str(value)


def _label(name: str) -> str:
    """A column's name with its unit, where it is known."""
    unit = METRICS.get(name, "").rpartition(", ")[2]
    if unit not in _UNITS:
        unit = _KEY_UNITS.get(name.partition("[")[0], "")
    return f"{name} ({unit})" if unit else name


def _columns_for(results: SweepResults) -> tuple[str, str | None, str | None]:
    """The columns for x, lines and panels: as the file says, else by the kind of axis."""
    plot = results.plan.sweep.plot
    numeric, text = _numeric_axes(results), _text_axes(results)
    longest = max(numeric, key=lambda key: len(np.unique(results.columns[key])), default="index")
    x = plot.x or longest
    rest = [key for key in [*text, *numeric] if key not in {x, plot.lines, plot.panels}]
    lines = plot.lines or (rest.pop(0) if rest else None)
    panels = plot.panels or (rest.pop(0) if rest else None)
    return x, lines, panels


def _panel_grid(rows: int, columns: int, width: float, height: float) -> tuple[Figure, Any]:
    if rows * columns > MAX_PANELS:
        raise InputError(f"plot: {rows * columns} panels, at most {MAX_PANELS}; choose a metric")
    figure = new_figure(width * columns, 0.35 + height * rows)
    return figure, figure.subplots(rows, columns, squeeze=False)


def _look(number: int) -> dict[str, Any]:
    """Colour and dashes of a line, by its number."""
    return {"color": CYCLE[number % MAX_LINES], "ls": DASHES[number % len(DASHES)]}


def _mark(number: int) -> dict[str, str]:
    """The marker that goes with `_look`."""
    return {"marker": MARKERS[number % len(MARKERS)]}


def _legend(axes: Axes, title: str | None) -> None:
    handles, labels = axes.get_legend_handles_labels()
    if any(labels):
        axes.legend(handles, labels, title=title, title_fontsize=8, alignment="left")


# --- lines ---------------------------------------------------------------------------------------


def _lines_figure(results: SweepResults, metrics: tuple[str, ...]) -> Figure:
    x, lines, panels = _columns_for(results)
    everything = np.ones(len(results), dtype=bool)
    columns = list(_groups(results, panels, everything))
    figure, grid = _panel_grid(len(metrics), len(columns), 4.2, 2.7)
    abscissa, completed = results.values(x), _completed(results)
    for row, metric in zip(grid, metrics):
        for axes, (title, mask) in zip(row, columns):
            for number, (name, group) in enumerate(_groups(results, lines, mask)):
                color, flown = CYCLE[number % MAX_LINES], group & completed
                order = np.argsort(abscissa[group], kind="stable")
                values = np.where(flown, results.columns[metric], np.nan)[group][order]
                line = abscissa[group][order]
                axes.plot(line, values, ms=3.5, label=name, **_look(number), **_mark(number))
                lost = line[np.isnan(values)]
                axes.plot(
                    *(lost, np.full(len(lost), 0.03 + 0.04 * number), "x"),
                    **{"color": color, "ms": 4, "transform": axes.get_xaxis_transform()},
                )
            axes.set_title(title)
            axes.set_ylabel(_label(metric))
            axes.set_xlabel(_label(x))
    _share_limits(grid)
    if not completed.all():
        grid[0][0].plot([], [], "x", color=GREY, ms=4, label="lost")
    _legend(grid[0][0], lines)
    return figure


def _share_limits(grid: Any) -> None:
    """One scale a row, so that panels compare."""
    for row in grid:
        low = min(axes.get_ylim()[0] for axes in row)
        high = max(axes.get_ylim()[1] for axes in row)
        for axes in row:
            axes.set_ylim(low, high)


# --- map -----------------------------------------------------------------------------------------


def _map_figure(results: SweepResults, metrics: tuple[str, ...]) -> Figure:
    from matplotlib.colors import LogNorm, Normalize

    plot, numeric = results.plan.sweep.plot, _numeric_axes(results)
    x = plot.x or numeric[0]
    y = plot.y or next(key for key in numeric if key != x)
    panels = plot.panels or next(iter(_text_axes(results)), None)
    columns = list(_groups(results, panels, np.ones(len(results), dtype=bool)))
    figure, grid = _panel_grid(len(metrics), len(columns), 4.0, 3.1)
    abscissa, ordinate, completed = results.values(x), results.values(y), _completed(results)
    for row, metric in zip(grid, metrics):
        values = np.where(completed, results.columns[metric], np.nan)
        known = values[~np.isnan(values)]
        low, high = (known.min(), known.max()) if known.size else (0.0, 1.0)
        norm = LogNorm(low, high) if _is_wide(values) else Normalize(low, high)
        for axes, (title, mask) in zip(row, columns):
            xs, ys = np.unique(abscissa[mask]), np.unique(ordinate[mask])
            cells = np.full((len(ys), len(xs)), np.nan)
            rows, places = np.searchsorted(ys, ordinate[mask]), np.searchsorted(xs, abscissa[mask])
            cells[rows, places] = values[mask]
            axes.set_facecolor(PALE)
            axes.grid(visible=False)
            image = axes.pcolormesh(
                *(xs, ys, np.ma.masked_invalid(cells)),
                **{"cmap": SEQUENTIAL, "shading": "nearest", "rasterized": True, "norm": norm},
            )
            lost = mask & ~completed
            axes.plot(abscissa[lost], ordinate[lost], "x", color=RED, ms=4, ls="none")
            axes.set_title(title)
            axes.set_xlabel(_label(x))
            axes.set_ylabel(_label(y))
        figure.colorbar(image, ax=list(row), label=_label(metric))
    if not completed.all():
        figure.supxlabel("× lost", x=0.99, ha="right", fontsize=8, color=RED)
    return figure


# --- quantiles -----------------------------------------------------------------------------------


def _quantiles_figure(results: SweepResults, metrics: tuple[str, ...]) -> Figure:
    drawn = _drawn(results)[:4]
    lines = results.plan.sweep.plot.lines or next(iter(_text_axes(results)), None)
    groups = list(_groups(results, lines, np.ones(len(results), dtype=bool)))
    completed = _completed(results)
    figure = new_figure(max(9.0, 2.6 * len(drawn)), 6.0)
    halves: Any = figure.subfigures(2, 1)
    above, below = halves
    for axes, metric in zip(np.atleast_1d(above.subplots(1, len(metrics))), metrics):
        for number, (name, group) in enumerate(groups):
            values = results.columns[metric][group & completed]
            values = np.sort(values[~np.isnan(values)])
            share = np.arange(len(values) + 1) / group.sum()
            lost = int(group.sum() - (group & completed).sum())
            label = f"{name}, {lost} of {group.sum()} lost".lstrip(", ")
            values = np.append(values[:1], values)  # the first step begins at none
            axes.step(values, share[: len(values)], where="post", label=label, **_look(number))
        axes.set_ylim(0.0, 1.02)
        axes.set_xlabel(_label(metric))
        axes.set_ylabel("share of flights at or below")
    _legend(above.axes[0], lines)
    for axes, key in zip(np.atleast_1d(below.subplots(1, len(drawn), sharey=True)), drawn):
        for number, (_, group) in enumerate(groups):
            color, flown, fallen = CYCLE[number % MAX_LINES], group & completed, group & ~completed
            axes.plot(
                *(results.columns[key][flown], results.columns[metrics[0]][flown]),
                **{"ls": "", "ms": 3.0, "alpha": 0.7, "mew": 0, "color": color},
                **_mark(number),
            )
            axes.plot(
                *(results.columns[key][fallen], np.full(fallen.sum(), 1.03 + 0.04 * number), "x"),
                **{"ms": 3.0, "color": color, "clip_on": False, "mew": 0.8},
                transform=axes.get_xaxis_transform(),
            )
        axes.set_xlabel(_label(key))
        if _is_wide(results.columns[metrics[0]][completed]):
            axes.set_yscale("log")
    if not completed.all():
        below.axes[0].set_title("× lost", pad=10.0 + 6.0 * len(groups))
    below.axes[0].set_ylabel(_label(metrics[0]))
    return figure


# --- boundary and plane --------------------------------------------------------------------------


def _boundary_figure(results: SweepResults, _metrics: tuple[str, ...]) -> Figure:
    bisect = results.plan.sweep.bisect
    if bisect is None:
        raise InputError("plot.kind = 'boundary': the sweep has no [bisect]")
    x, lines, panels = _columns_for(results)
    columns = list(_groups(results, panels, np.ones(len(results), dtype=bool)))
    figure, grid = _panel_grid(1, len(columns), 4.2, 3.2)
    abscissa = results.values(x)
    holds, fails = results.columns[bisect.key], results.columns[f"{bisect.key}_beyond"]
    for axes, (title, mask) in zip(grid[0], columns):
        for number, (name, group) in enumerate(_groups(results, lines, mask)):
            color = CYCLE[number % MAX_LINES]
            order = np.argsort(abscissa[group], kind="stable")
            line, last, first = (v[group][order] for v in (abscissa, holds, fails))
            axes.plot(line, last, marker="o", ms=3.5, label=name, **_look(number))
            axes.fill_between(line, last, first, color=color, alpha=0.25, lw=0)
            whole = np.isnan(first)
            axes.plot(line[whole], last[whole], "^", ms=6, color=color)
            nowhere = np.isnan(last)
            axes.plot(line[nowhere], first[nowhere], "x", ms=6, color=color)
        axes.set_title(title)
        axes.set_xlabel(_label(x))
        axes.set_ylabel(f"last {bisect.key} that holds")
    _share_limits(grid)
    _legend(grid[0][0], lines)
    _boundary_key(grid[0][-1], holds, fails)
    return figure


def _boundary_key(axes: Axes, holds: Column, fails: Column) -> None:
    words = ["▲ holds to the end"] if np.isnan(fails).any() else []
    words += ["× fails at the start"] if np.isnan(holds).any() else []
    place: Any = {"xycoords": "axes fraction", "ha": "right", "va": "bottom", "fontsize": 8}
    axes.annotate("   ".join(words), (1.0, 1.015), **place)


def _plane_figure(results: SweepResults, _metrics: tuple[str, ...]) -> Figure:
    plot, bisect = results.plan.sweep.plot, results.plan.sweep.bisect
    if bisect is None or plot.x is None or plot.y is None:
        raise InputError("plot.kind = 'plane': needs a [bisect], x and y")
    columns = list(_groups(results, plot.panels, np.ones(len(results), dtype=bool)))
    wide = min(2, len(columns))
    figure, grid = _panel_grid(-(-len(columns) // wide), wide, 4.4, 3.7)
    x, y = results.values(plot.x), results.values(plot.y)
    holds, fails = results.columns[bisect.key], results.columns[f"{bisect.key}_beyond"]
    for axes, (title, mask) in zip(grid.flat, columns):
        for number, (name, group) in enumerate(_groups(results, plot.lines, mask)):
            color = CYCLE[number % MAX_LINES]
            reached = group & ~np.isnan(holds)
            whole = reached & np.isnan(fails)
            # The outline in the order of the directions, closed.
            turn = np.argsort(np.arctan2(y[reached], x[reached]), kind="stable")
            outline = np.append(turn, turn[:1])
            width = max(0.8, 4.0 - 0.8 * number)  # so that lines show under lines
            label = name if reached.any() else f"{name}: fails at {bisect.start:g}"
            axes.plot(
                *(x[reached][outline], y[reached][outline], "-"),
                **{"lw": width, "color": color, "label": label},
            )
            axes.plot(x[reached & ~whole], y[reached & ~whole], "o", ms=width + 3.5, color=color)
            axes.plot(x[whole], y[whole], "^", ms=width + 4.5, color=color)
        axes.axhline(0.0, color=GREY, lw=0.6)
        axes.axvline(0.0, color=GREY, lw=0.6)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_title(title)
        axes.set_xlabel(_label(plot.x))
        axes.set_ylabel(_label(plot.y))
        _legend(axes, plot.lines)
    for axes in grid.flat[len(columns) :]:
        axes.set_axis_off()
    reached = np.concatenate([x[~np.isnan(holds)], y[~np.isnan(holds)], [-1e-3, 1e-3]])
    for axes, (_, mask) in zip(grid.flat, columns):
        if np.isnan(holds[mask]).all():  # nothing to see: as wide as the others
            axes.plot([reached.min(), reached.max()], [reached.min(), reached.max()], alpha=0.0)
    _boundary_key(grid.flat[0], np.zeros(1), fails)
    return figure
