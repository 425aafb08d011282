"""Figures of sweeps: lines, maps and boundaries."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.scenario.messages import choose
from tiltsim.sweeps.dataset import Column, SweepResults
from tiltsim.sweeps.tables import GridAxis, SampledAxis
from tiltsim.views.figures.distributions import distributions_figure
from tiltsim.views.figures.style import (
    CYCLE,
    GREY,
    MARKERS,
    PALE,
    RED,
    SEQUENTIAL,
    line_style,
    new_figure,
    paper_style,
    verbatim,
    zero_lines,
)
from tiltsim.views.figures.sweep_columns import (
    add_legend,
    completed_mask,
    groups_of,
    label_of,
    spans_decades,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_PANELS: Final = 24
MAX_LINES: Final = len(CYCLE)


def sweep_figure(results: SweepResults, metrics: tuple[str, ...] = ()) -> Figure:
    """The figure that the ``[plot]`` table of a sweep requests, or else one that suits its axes.

    ``metrics`` default to those of the ``[plot]`` table, else to the first three that vary.

    Raises:
        InputError: If a column or metric is unknown, or there would be too many panels.
    """
    plot = results.points.sweep.plot
    kind = plot.kind or _kind(results)
    draw = {
        "lines": _lines_figure,
        "map": _map_figure,
        "quantiles": distributions_figure,
        "boundary": _boundary_figure,
        "plane": _plane_figure,
    }[kind]
    chosen = _metrics(results, metrics)
    if not chosen and kind not in {"boundary", "plane"}:
        address = results.points.definition.address
        raise InputError(f"{address}: metrics = []: the sweep has no metric to plot")
    with paper_style():
        figure = draw(results, chosen)
        title = results.points.sweep.title or results.points.definition.address
        missing = len(results.points) - len(results)
        more = f" ({missing} of {len(results.points)} points missing)" if missing else ""
        lines = fill(verbatim(title) + more, round(11.0 * figure.get_figwidth()))
        figure.suptitle(lines, x=0.01, ha="left", fontsize=10.5)
        return figure


def _kind(results: SweepResults) -> str:
    if results.points.sweep.bisect is not None:
        return "boundary"
    if any(isinstance(axis, SampledAxis) for axis in results.points.sweep.axis):
        return "quantiles"
    return "map" if len(_numeric_axes(results)) >= 2 else "lines"


def _numeric_axes(results: SweepResults) -> list[str]:
    keys = [key for axis in results.points.sweep.axis for key in axis.targets[:1]]
    return [key for key in keys if results.columns[key].dtype == np.float64]


def _text_axes(results: SweepResults) -> list[str]:
    keys = [a.targets[0] for a in results.points.sweep.axis if isinstance(a, GridAxis)]
    return [key for key in keys if results.columns[key].dtype != np.float64]


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
    varying = tuple(name for name in available if _varies(results.columns[name]))
    return chosen or varying[:3] or available[:1]


def _varies(column: Column) -> bool:
    known = column[~np.isnan(column)]
    return known.size > 0 and float(np.ptp(known)) > 0.0


def _columns_for(results: SweepResults) -> tuple[str, str | None, str | None]:
    """The columns for x, lines and panels: those of the file, else by the type of axis."""
    plot = results.points.sweep.plot
    numeric, text = _numeric_axes(results), _text_axes(results)
    longest = max(numeric, key=lambda key: len(np.unique(results.columns[key])), default="index")
    x = plot.x or longest
    rest = [key for key in [*text, *numeric] if key not in {x, plot.lines, plot.panels}]
    lines = plot.lines or (rest.pop(0) if rest else None)
    panels = plot.panels or (rest.pop(0) if rest else None)
    return x, lines, panels


def _panel_grid(rows: int, columns: int, width: float, height: float) -> tuple[Figure, Any]:
    if rows * columns > MAX_PANELS:
        raise InputError(f"plot: {rows * columns} panels: at most {MAX_PANELS}; choose a metric")
    figure = new_figure(width * columns, 0.35 + height * rows)
    return figure, figure.subplots(rows, columns, squeeze=False)


# --- lines ---------------------------------------------------------------------------------------


def _lines_figure(results: SweepResults, metrics: tuple[str, ...]) -> Figure:
    x, lines, panels = _columns_for(results)
    everything = np.ones(len(results), dtype=bool)
    columns = list(groups_of(results, panels, everything))
    width, height = (5.6, 3.0) if len(columns) == 1 else (4.2, 2.7)
    figure, grid = _panel_grid(len(metrics), len(columns), width, height)
    abscissa, completed = results.values(x), completed_mask(results)
    for row, metric in zip(grid, metrics):
        for axes, (title, mask) in zip(row, columns):
            groups = list(groups_of(results, lines, mask))
            for number, (name, group) in enumerate(groups):
                color, flown = CYCLE[number % MAX_LINES], group & completed
                order = np.argsort(abscissa[group], kind="stable")
                values = np.where(flown, results.columns[metric], np.nan)[group][order]
                line, marker = abscissa[group][order], MARKERS[number % len(MARKERS)]
                axes.plot(line, values, marker=marker, ms=3.5, label=name, **line_style(number))
                missing = line[np.isnan(values)]
                heights = np.full(len(missing), 0.03 + 0.04 * (len(groups) - 1 - number))
                bottom = axes.get_xaxis_transform()
                axes.plot(missing, heights, "x", color=color, ms=4, transform=bottom)
            axes.set(title=title, xlabel=label_of(results, x), ylabel=label_of(results, metric))
    for axis in results.points.sweep.plot.log:
        for axes in grid.flat:
            getattr(axes, f"set_{axis}scale")("log")
    _share_limits(grid)
    if not completed.all():
        for axes in grid.flat:
            _make_room_below(axes, 0.03 + 0.04 * len(groups))
        grid[0][0].plot([], [], "x", color=GREY, ms=4, label="terminated early, in this order")
    add_legend(grid[0][0], lines)
    return figure


def _share_limits(grid: Any) -> None:
    """Use one y scale per row."""
    for row in grid:
        low = min(axes.get_ylim()[0] for axes in row)
        high = max(axes.get_ylim()[1] for axes in row)
        for axes in row:
            axes.set_ylim(low, high)


def _make_room_below(axes: Any, share: float) -> None:
    """Reserve a share of a panel's height at the bottom for the marks of terminated flights."""
    scale = axes.yaxis.get_transform()
    low, high = scale.transform(np.array(axes.get_ylim()))
    axes.set_ylim(bottom=scale.inverted().transform(low - (high - low) * share / (1.0 - share)))


# --- map -----------------------------------------------------------------------------------------


def _map_figure(results: SweepResults, metrics: tuple[str, ...]) -> Figure:
    from matplotlib.colors import LogNorm, Normalize

    plot, numeric = results.points.sweep.plot, _numeric_axes(results)
    x = plot.x or next((key for key in numeric if key != plot.y), None)
    y = plot.y or next((key for key in numeric if key != x), None)
    if x is None or y is None:
        raise InputError("plot.kind = 'map': needs two numeric axes, or x and y")
    panels = plot.panels or next(iter(_text_axes(results)), None)
    columns = list(groups_of(results, panels, np.ones(len(results), dtype=bool)))
    figure, grid = _panel_grid(len(metrics), len(columns), 4.0, 3.1)
    abscissa, ordinate, completed = results.values(x), results.values(y), completed_mask(results)
    for row, metric in zip(grid, metrics):
        values = np.where(completed, results.columns[metric], np.nan)
        known = values[~np.isnan(values)]
        low, high = (known.min(), known.max()) if known.size else (0.0, 1.0)
        norm = LogNorm(low, high) if spans_decades(values) else Normalize(low, high)
        for axes, (title, mask) in zip(row, columns):
            xs, ys = np.unique(abscissa[mask]), np.unique(ordinate[mask])
            cells = np.full((len(ys), len(xs)), np.nan)
            rows, places = np.searchsorted(ys, ordinate[mask]), np.searchsorted(xs, abscissa[mask])
            cells[rows, places] = values[mask]
            axes.set_facecolor(PALE)
            axes.grid(visible=False)
            known_cells = np.ma.masked_invalid(cells)
            image = axes.pcolormesh(
                xs, ys, known_cells, cmap=SEQUENTIAL, norm=norm, shading="nearest", rasterized=True
            )
            ended = mask & ~completed
            axes.plot(abscissa[ended], ordinate[ended], "x", color=RED, ms=4, ls="none")
            axes.set(title=title, xlabel=label_of(results, x), ylabel=label_of(results, y))
        figure.colorbar(image, ax=list(row), label=label_of(results, metric))
    if not completed.all():
        figure.supxlabel("× terminated early", x=0.99, ha="right", fontsize=8, color=RED)
    return figure


# --- boundary and plane --------------------------------------------------------------------------


def _boundary_figure(results: SweepResults, _metrics: tuple[str, ...]) -> Figure:
    bisect = results.points.sweep.bisect
    if bisect is None:
        raise InputError("plot.kind = 'boundary': the sweep has no [bisect]")
    x, lines, panels = _columns_for(results)
    columns = list(groups_of(results, panels, np.ones(len(results), dtype=bool)))
    figure, grid = _panel_grid(1, len(columns), 4.2, 3.2)
    abscissa = results.values(x)
    holds, fails = results.columns[bisect.key], results.columns[f"{bisect.key}_beyond"]
    for axes, (title, mask) in zip(grid[0], columns):
        for number, (name, group) in enumerate(groups_of(results, lines, mask)):
            color = CYCLE[number % MAX_LINES]
            order = np.argsort(abscissa[group], kind="stable")
            line, last, first = (v[group][order] for v in (abscissa, holds, fails))
            axes.plot(line, last, marker="o", ms=3.5, label=name, **line_style(number))
            axes.fill_between(line, last, first, color=color, alpha=0.25, lw=0)
            always, never = np.isnan(first), np.isnan(last)
            axes.plot(line[always], last[always], "^", ms=6, color=color)
            axes.plot(line[never], first[never], "x", ms=6, color=color)
        axes.set(title=title, xlabel=label_of(results, x), ylabel=f"last {bisect.key} that holds")
    _share_limits(grid)
    add_legend(grid[0][0], lines)
    _boundary_key(grid[0][-1], holds, fails)
    return figure


def _boundary_key(axes: Axes, holds: Column, fails: Column) -> None:
    texts = ["▲ holds to the end"] if np.isnan(fails).any() else []
    texts += ["× fails at the start"] if np.isnan(holds).any() else []
    text = axes.annotate("   ".join(texts), (1.0, 1.015), xycoords="axes fraction", fontsize=8)
    text.set(ha="right", va="bottom")


def _plane_figure(results: SweepResults, _metrics: tuple[str, ...]) -> Figure:
    plot, bisect = results.points.sweep.plot, results.points.sweep.bisect
    if bisect is None or plot.x is None or plot.y is None:
        raise InputError("plot.kind = 'plane': needs a [bisect], x and y")
    columns = list(groups_of(results, plot.panels, np.ones(len(results), dtype=bool)))
    per_row = min(2, len(columns))
    figure, grid = _panel_grid(-(-len(columns) // per_row), per_row, 4.4, 3.7)
    x, y = results.values(plot.x), results.values(plot.y)
    holds, fails = results.columns[bisect.key], results.columns[f"{bisect.key}_beyond"]
    for axes, (title, mask) in zip(grid.flat, columns):
        for number, (name, group) in enumerate(groups_of(results, plot.lines, mask)):
            color = CYCLE[number % MAX_LINES]
            reached = group & ~np.isnan(holds)
            always = reached & np.isnan(fails)
            # The outline in the order of the directions, closed.
            order = np.argsort(np.arctan2(y[reached], x[reached]), kind="stable")
            outline = np.append(order, order[:1])
            width = max(0.8, 4.0 - 0.8 * number)  # so that lines below others are visible
            label = name if reached.any() else f"{name}: fails at {bisect.start:g}"
            outline_x, outline_y = x[reached][outline], y[reached][outline]
            axes.plot(outline_x, outline_y, "-", lw=width, color=color, label=label)
            axes.plot(x[reached & ~always], y[reached & ~always], "o", ms=width + 3.5, color=color)
            axes.plot(x[always], y[always], "^", ms=width + 4.5, color=color)
        zero_lines(axes)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set(title=title, xlabel=label_of(results, plot.x), ylabel=label_of(results, plot.y))
        add_legend(axes, plot.lines)
    for axes in grid.flat[len(columns) :]:
        axes.set_axis_off()
    reached = np.concatenate([x[~np.isnan(holds)], y[~np.isnan(holds)], [-1e-3, 1e-3]])
    for axes, (_, mask) in zip(grid.flat, columns):
        if np.isnan(holds[mask]).all():  # an empty panel: as wide as the others
            axes.plot([reached.min(), reached.max()], [reached.min(), reached.max()], alpha=0.0)
    _boundary_key(grid.flat[0], np.zeros(1), fails)
    return figure
