"""Figures of sweeps: lines, maps and boundaries."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from tiltsim.errors import InputError
from tiltsim.scenario.messages import choose
from tiltsim.scenario.metric_names import is_metric, unit_of
from tiltsim.sweeps.dataset import Column, SweepResults
from tiltsim.sweeps.tables import GridAxis, SampledAxis
from tiltsim.views.figures import style
from tiltsim.views.figures.distributions import (
    completed_mask,
    distributions_figure,
    groups_of,
    label_of,
    spans_decades,
    text_of,
)
from tiltsim.views.figures.layout import add_heading, add_legend
from tiltsim.views.signals import FLOORS, SMALLEST, scale

MAX_PANELS: Final = 24
MAX_TICKS: Final = 8  # values of an axis of a map that are written beside it


@style.paper_style()
def sweep_figure(results: SweepResults, metrics: tuple[str, ...] = ()) -> Figure:
    """The figure that the ``[plot]`` table of a sweep requests, or else one that suits its axes.

    ``metrics`` default to the metrics of the ``[plot]`` table, else to the first three that vary.

    Raises:
        InputError: If a column or metric is unknown, or there would be too many panels.
    """
    sweep, address = results.points.sweep, results.points.definition.address
    kind = sweep.plot.kind
    if kind is None and sweep.bisect is not None:
        kind = "boundary"
    elif kind is None and any(isinstance(axis, SampledAxis) for axis in sweep.axis):
        kind = "quantiles"
    elif kind is None:
        kind = "map" if len(_axes_of(results, numeric=True)) >= 2 else "lines"
    draw = {
        "lines": _lines_figure,
        "map": _map_figure,
        "quantiles": distributions_figure,
        "boundary": _boundary_figure,
        "plane": _plane_figure,
    }[kind]
    chosen = _metrics(results, metrics)
    if not chosen and kind not in {"boundary", "plane"}:
        raise InputError(f"{address}: metrics = []: the sweep has no metric to plot")
    figure = draw(results, chosen)
    missing = len(results.points) - len(results)
    more = f"{missing} of {len(results.points)} points missing" if missing else ""
    add_heading(figure, style.verbatim(sweep.title or address), more)
    return figure


def _axes_of(results: SweepResults, *, numeric: bool) -> list[str]:
    """The first key of every axis with numbers, or of every grid axis with texts."""
    axes = [axis for axis in results.points.sweep.axis if numeric or isinstance(axis, GridAxis)]
    keys = [key for axis in axes for key in axis.targets[:1]]
    return [key for key in keys if (results.columns[key].dtype == np.float64) is numeric]


def _metrics(results: SweepResults, requested: tuple[str, ...]) -> tuple[str, ...]:
    # Results of an earlier version lack later metrics.
    available = tuple(name for name in results.points.metrics if name in results.columns)
    chosen = requested or results.points.sweep.plot.metrics
    for name in chosen:
        if name not in available:
            raise InputError(
                f"{results.points.definition.address}: plot.metrics = {name!r}: not in these "
                f"results; {choose(name, available)}"
            )
    ranges = {name: _least_range(name, results.columns[name]) for name in available}
    varying = tuple(name for name in available if ranges[name][2])
    return chosen or varying[:3] or available[:1]


def _least_range(metric: str, values: Column) -> tuple[float, float, bool]:
    """Lowest and highest value, at least the smallest range apart, and whether they differ."""
    known = values[~np.isnan(values)]
    if not known.size:
        return 0.0, 1.0, False
    least = FLOORS.get(unit_of(metric), SMALLEST) if is_metric(metric) else 0.0
    if np.ptp(known) < least:
        low, high, _ = scale([known], [False], least)
        return low, high, bool(np.ptp(known) > 1e-6 * least)
    return float(known.min()), float(known.max()), bool(np.ptp(known) > 0.0)


def _columns_for(results: SweepResults) -> tuple[str, str | None, str | None]:
    """The columns for x, lines and panels: as the file has them, else by the type of axis."""
    plot, numeric = results.points.sweep.plot, _axes_of(results, numeric=True)
    longest = max(numeric, key=lambda key: len(np.unique(results.columns[key])), default="index")
    x, text = plot.x or longest, _axes_of(results, numeric=False)
    rest = [key for key in [*text, *numeric] if key not in {x, plot.lines, plot.panels}]
    lines = plot.lines or (rest.pop(0) if rest else None)
    return x, lines, plot.panels or (rest.pop(0) if rest else None)


def _panels(
    results: SweepResults, key: str | None, rows: int, size: tuple[float, float], across: int = 0
) -> tuple[Figure, Any, list[tuple[str, Column]]]:
    """A figure with a grid of axes, and the groups of flights in its columns, or in its cells."""
    groups = [*groups_of(results, key, np.ones(len(results), dtype=bool))]
    columns = min(across or len(groups), len(groups))
    rows = -(-len(groups) // columns) if across else rows
    if rows * columns > MAX_PANELS:
        raise InputError(f"plot: {rows * columns} panels: at most {MAX_PANELS}; choose a metric")
    figure = style.new_figure(size[0] * columns, 0.6 + size[1] * rows)
    return figure, figure.subplots(rows, columns, squeeze=False), groups


def _lines(
    results: SweepResults, key: str | None, mask: Column, x: Column
) -> Iterator[tuple[str, dict[str, Any], Column, Column]]:
    """Name, look, rows and order along x of the flights of every line."""
    for number, (name, group) in enumerate(groups_of(results, key, mask)):
        look = {**style.line_style(number), "marker": style.MARKERS[number % len(style.MARKERS)]}
        yield name, {**look, "ms": 3.5, "label": name}, group, np.argsort(x[group], kind="stable")


def _legend_below(figure: Figure, axes: Axes, results: SweepResults, key: str | None) -> None:
    """A legend of the lines below the panels, so that it covers none of them."""
    handles, labels = axes.get_legend_handles_labels()
    if any(labels):
        add_legend(figure, handles, title=_legend_title(results, key))


def _legend_title(results: SweepResults, key: str | None) -> str | None:
    """The quantity that the lines differ in; cases speak for themselves unless they are labeled."""
    named = key is not None and ("." in key or key in results.points.sweep.plot.labels)
    return label_of(results, key) if key is not None and named else None


def _lines_figure(results: SweepResults, metrics: tuple[str, ...]) -> Figure:
    x, key, panels = _columns_for(results)
    single = len([*groups_of(results, panels, np.ones(len(results), dtype=bool))]) == 1
    size = (5.6, 3.0) if single else (4.2, 2.7)
    figure, grid, columns = _panels(results, panels, len(metrics), size)
    abscissa, completed = results.values(x), completed_mask(results)
    for (row, column), axes in np.ndenumerate(grid):
        metric, (title, mask) = metrics[row], columns[column]
        lines = [*_lines(results, key, mask, abscissa)]
        for number, (_, look, group, order) in enumerate(lines):
            values = np.where(completed, results.columns[metric], np.nan)[group][order]
            along = abscissa[group][order]
            axes.plot(along, values, **look)
            heights = np.full(np.isnan(values).sum(), 0.03 + 0.04 * (len(lines) - 1 - number))
            place: dict[str, Any] = {"transform": axes.get_xaxis_transform()}
            axes.plot(along[np.isnan(values)], heights, "x", color=look["color"], ms=4, **place)
        axes.set(title=title, xlabel=label_of(results, x), ylabel=label_of(results, metric))
    log = results.points.sweep.plot.log
    for axes in grid.flat if log else []:
        axes.set(**{f"{axis}scale": "log" for axis in log})
    _share_limits(grid, () if "y" in log else metrics)
    if not completed.all():
        share = 0.03 + 0.04 * len(lines)  # of a panel's height, for the marks of terminated flights
        for axes in grid.flat:
            transform = axes.yaxis.get_transform()
            low, high = transform.transform(np.array(axes.get_ylim()))
            bottom = low - (high - low) * share / (1.0 - share)
            axes.set_ylim(bottom=transform.inverted().transform(bottom))
        mark = {"color": style.GREY, "ms": 4, "label": "terminated early, in this order"}
        grid[0][0].plot([], [], "x", **mark)
    _legend_below(figure, grid[0][0], results, key)
    return figure


def _share_limits(grid: Any, metrics: tuple[str, ...] = ()) -> None:
    """Use one y scale per row, at least as wide as the smallest range of its metric."""
    for number, row in enumerate(grid):
        ends = np.array([axes.get_ylim() for axes in row])
        low, high = ends.min(), ends.max()
        if metrics:
            seen = np.array([low, high])
            low, high, _ = _least_range(metrics[number], seen)
        for axes in row:
            axes.set_ylim(low, high)


def _map_figure(results: SweepResults, metrics: tuple[str, ...]) -> Figure:
    plot, numeric = results.points.sweep.plot, _axes_of(results, numeric=True)
    x = plot.x or next((key for key in numeric if key != plot.y), None)
    y = plot.y or next((key for key in numeric if key != x), None)
    if x is None or y is None:
        raise InputError("plot.kind = 'map': needs two numeric axes, or x and y")
    panels = plot.panels or next(iter(_axes_of(results, numeric=False)), None)
    figure, grid, columns = _panels(results, panels, len(metrics), (4.0, 2.6))
    completed = completed_mask(results)
    xs, across = np.unique(results.values(x), return_inverse=True)
    ys, up = np.unique(results.values(y), return_inverse=True)
    for row, metric in zip(grid, metrics):
        values = np.where(completed, results.columns[metric], np.nan)
        low, high, _ = _least_range(metric, values)
        norm = LogNorm(low, high) if spans_decades(values) else Normalize(low, high)
        for axes, (title, mask) in zip(row, columns):
            cells = np.full((len(ys), len(xs)), np.nan)
            cells[up[mask], across[mask]] = values[mask]
            axes.set_facecolor(style.PALE)
            axes.grid(visible=False)
            look: dict[str, Any] = {"cmap": style.SEQUENTIAL, "norm": norm, "aspect": "auto"}
            image: Any = axes.imshow(np.ma.masked_invalid(cells), origin="lower", **look)
            ended = mask & ~completed
            axes.plot(across[ended], up[ended], "x", color=style.RED, ms=4, ls="none")
            axes.set(title=title, xlabel=label_of(results, x), ylabel=label_of(results, y))
            # The values that were flown, not a scale between them.
            for name, known in (("x", xs), ("y", ys)):
                shown = range(0, len(known), -(-len(known) // MAX_TICKS))
                axes.set(**{f"{name}ticks": shown, f"{name}ticklabels": map(text_of, known[shown])})
        figure.colorbar(image, ax=list(row), label=label_of(results, metric))
    if not completed.all():
        look = {"ha": "right", "size": "small", "color": style.RED}
        figure.supxlabel("× terminated early", x=0.99, **look)
    return figure


def _boundary_figure(results: SweepResults, _metrics: tuple[str, ...]) -> Figure:
    bisect = results.points.sweep.bisect
    if bisect is None:
        raise InputError("plot.kind = 'boundary': the sweep has no [bisect]")
    x, key, panels = _columns_for(results)
    figure, grid, columns = _panels(results, panels, 1, (4.2, 3.2))
    abscissa = results.values(x)
    holds, fails = results.columns[bisect.key], results.columns[f"{bisect.key}_beyond"]
    label = f"last {label_of(results, bisect.key)} that holds"
    for axes, (title, mask) in zip(grid[0], columns):
        for _, look, group, order in _lines(results, key, mask, abscissa):
            along, last, first = (v[group][order] for v in (abscissa, holds, fails))
            axes.plot(along, last, **look)
            axes.fill_between(along, last, first, color=look["color"], alpha=0.25, lw=0)
            always, never = np.isnan(first), np.isnan(last)
            axes.plot(along[always], last[always], "^", ms=6, color=look["color"])
            axes.plot(along[never], first[never], "x", ms=6, color=look["color"])
        axes.set(title=title, xlabel=label_of(results, x), ylabel=label)
    _share_limits(grid)
    _legend_below(figure, grid[0][0], results, key)
    _boundary_key(grid[0][-1], holds, fails)
    return figure


def _boundary_key(axes: Axes, holds: Column, fails: Column) -> None:
    texts = ["▲ holds to the end"] if np.isnan(fails).any() else []
    texts += ["× fails at the start"] if np.isnan(holds).any() else []
    look: dict[str, Any] = {"size": "small", "ha": "right", "va": "bottom"}
    axes.annotate("   ".join(texts), (1.0, 1.015), xycoords="axes fraction", **look)


def _plane_figure(results: SweepResults, _metrics: tuple[str, ...]) -> Figure:
    plot, bisect = results.points.sweep.plot, results.points.sweep.bisect
    if bisect is None or plot.x is None or plot.y is None:
        raise InputError("plot.kind = 'plane': needs a [bisect], x and y")
    figure, grid, columns = _panels(results, plot.panels, 1, (4.4, 3.7), across=2)
    x, y = results.values(plot.x), results.values(plot.y)
    holds, fails = results.columns[bisect.key], results.columns[f"{bisect.key}_beyond"]
    seen = np.concatenate([x[~np.isnan(holds)], y[~np.isnan(holds)], [-1e-3, 1e-3]])
    for axes, (title, mask) in zip(grid.flat, columns):
        for number, (name, group) in enumerate(groups_of(results, plot.lines, mask)):
            color = style.CYCLE[number % len(style.CYCLE)]
            reached = group & ~np.isnan(holds)
            always = reached & np.isnan(fails)
            # The outline in the order of the directions, closed.
            order = np.argsort(np.arctan2(y[reached], x[reached]), kind="stable")
            outline = np.append(order, order[:1])
            width = max(0.8, 4.0 - 0.8 * number)  # so that lines below others are visible
            label = name if reached.any() else f"{name}: fails at {bisect.start:g}"
            axes.plot(
                x[reached][outline], y[reached][outline], "-", lw=width, color=color, label=label
            )
            axes.plot(x[reached & ~always], y[reached & ~always], "o", ms=width + 3.5, color=color)
            axes.plot(x[always], y[always], "^", ms=width + 4.5, color=color)
        style.zero_lines(axes)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set(title=title, xlabel=label_of(results, plot.x), ylabel=label_of(results, plot.y))
        handles, labels = axes.get_legend_handles_labels()
        if any(labels):
            lines = _legend_title(results, plot.lines)
            axes.legend(handles, labels, title=lines, alignment="left")
        if np.isnan(holds[mask]).all():  # an empty panel: as wide as the others
            axes.plot([seen.min(), seen.max()], [seen.min(), seen.max()], alpha=0.0)
    for axes in grid.flat[len(columns) :]:
        axes.set_axis_off()
    _boundary_key(grid.flat[0], np.zeros(1), fails)
    return figure
