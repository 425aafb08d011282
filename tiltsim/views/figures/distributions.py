"""The figure of a random set of flights: how many come through, how well, and what decides it."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.sweeps.dataset import Column, SweepResults
from tiltsim.sweeps.tables import GridAxis
from tiltsim.views.figures.style import CYCLE, DASHES, INK, MARKERS, new_figure
from tiltsim.views.figures.sweep_columns import (
    completed_mask,
    groups_of,
    label_of,
    sampled_keys,
    spans_decades,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

QUANTILES: Final = (0.05, 0.5, 0.95)
"""Marked on the curves."""

MOST_TELLING: Final = 4
"""Drawn keys that get a panel each."""

HATCHES: Final = ("", "///", "...", "\\\\\\", "xxx", "---", "+++")
"""Of the bars, beside the colours of `CYCLE`, as dashes and markers are of curves and dots."""

NORMAL_95: Final = 1.959963984540054


def distributions_figure(results: SweepResults, metrics: tuple[str, ...]) -> Figure:
    """Shares of completed flights, distributions of metrics, and the first metric over the draws.

    A lost flight counts as the worst: a curve of errors ends at the share that came through, one
    of margins (``min_...``) begins at the share that did not.
    """
    key = results.points.sweep.plot.lines or next(iter(_grid_keys(results)), None)
    groups = list(groups_of(results, key, np.ones(len(results), dtype=bool)))
    keys = _most_telling(results, metrics[0], groups)
    figure = new_figure(10.0, 6.2 if keys else 3.2)
    parts: Any = figure.subfigures(2 if keys else 1, 1, squeeze=False)
    above, below = parts[0, 0], parts[-1, 0]
    ratios = [0.62, *(1.0 for _ in metrics)]
    shares, *curves = above.subplots(1, 1 + len(metrics), width_ratios=ratios)
    _draw_shares(shares, results, groups)
    for axes, metric in zip(curves, metrics):
        for number, (_, group) in enumerate(groups):
            _draw_curve(axes, results, metric, group, number % len(CYCLE))
        if spans_decades(results.columns[metric][completed_mask(results)]):
            axes.set_xscale("log")
        axes.margins(x=0.1)  # room for the numbers
        axes.set_ylim(0.0, 1.03)
        axes.set_xlabel(label_of(metric))
        axes.set_ylabel("share of flights at or below")
    if not keys:
        return figure
    panels = np.atleast_1d(below.subplots(1, len(keys), sharey=True))
    for axes, drawn in zip(panels, keys):
        _draw_scatter(axes, results, drawn, metrics[0], groups)
    panels[0].set_ylabel(label_of(metrics[0]))
    if not completed_mask(results).all():
        panels[0].set_title("× lost", pad=10.0 + 6.0 * len(groups))
    return figure


def _grid_keys(results: SweepResults) -> list[str]:
    """Keys of crossed axes, those of text first."""
    keys = [a.targets[0] for a in results.points.sweep.axis if isinstance(a, GridAxis)]
    return sorted(keys, key=lambda key: results.columns[key].dtype == np.float64)


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Between which shares the true one lies with 95 percent confidence (Wilson, 1927)."""
    share, square = successes / trials, NORMAL_95**2 / trials
    middle = (share + square / 2.0) / (1.0 + square)
    reach = sqrt(share * (1.0 - share) * square + square**2 / 4.0) / (1.0 + square)
    return max(0.0, middle - reach), min(1.0, middle + reach)


def _draw_shares(axes: Axes, results: SweepResults, groups: list[tuple[str, Column]]) -> None:
    completed = completed_mask(results)
    for number, (name, group) in enumerate(groups):
        flown, trials = int((group & completed).sum()), int(group.sum())
        low, high = wilson_interval(flown, trials)
        share, color = flown / trials, CYCLE[number % len(CYCLE)]
        hatch = HATCHES[number % len(CYCLE)]
        axes.barh(
            number, share, height=0.34, color=color, alpha=0.85, hatch=hatch, ec="white", lw=0
        )
        axes.plot([low, high], [number, number], color=INK, lw=1.6, solid_capstyle="butt")
        words = f"{name}: {flown} of {trials}".lstrip(": ")
        axes.annotate(words, (0.01, number - 0.25), fontsize=8.5, color=color).set_in_layout(False)
    axes.set_yticks([])
    axes.grid(visible=False, axis="y")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(len(groups) - 0.65, -0.6)
    axes.set_xlabel("share that completes")


def _draw_curve(axes: Axes, results: SweepResults, metric: str, group: Column, look: int) -> None:
    color, marker = CYCLE[look], MARKERS[look]
    values = results.columns[metric][group & completed_mask(results)]
    values = np.sort(values[~np.isnan(values)])
    total = int(group.sum())
    lost = total - len(values) if metric.startswith("min_") else 0
    share = (lost + np.arange(1, len(values) + 1)) / total
    axes.step(values, share, where="post", color=color, ls=DASHES[look])
    for quantile in QUANTILES:
        place = int(np.searchsorted(share, quantile - 1e-12))
        if place == len(values) or (place == 0 and lost):
            continue  # among the lost
        value = float(values[place])
        axes.plot(value, share[place], marker, ms=4.5, color=color)
        axes.annotate(
            f"{value:.3g}",
            (value, share[place]),
            xytext=(5.0, -3.0),
            textcoords="offset points",
            fontsize=8,
            color=color,
        ).set_in_layout(False)


def _most_telling(
    results: SweepResults, metric: str, groups: list[tuple[str, Column]]
) -> list[str]:
    """The drawn keys that go with the metric most closely, by rank, in the order of the file."""
    keys = sampled_keys(results)
    values = np.where(completed_mask(results), results.columns[metric], np.inf)
    values = np.where(np.isnan(values), np.inf, values)

    def strength(key: str) -> float:
        draws = results.columns[key]
        # Too much and too little may both do harm.
        both = (draws, np.abs(draws - np.median(draws)))
        found = [_rank_correlation(d[group], values[group]) for _, group in groups for d in both]
        return max(map(abs, found))

    chosen = sorted(keys, key=strength, reverse=True)[:MOST_TELLING]
    return [key for key in keys if key in chosen]


def _rank_correlation(first: Column, second: Column) -> float:
    """Spearman's; 0 where either does not vary."""
    left, right = _ranks(first), _ranks(second)
    if np.ptp(left) == 0.0 or np.ptp(right) == 0.0:
        return 0.0
    return float(np.corrcoef(left, right)[0, 1])


def _ranks(values: Column) -> Column:
    """Ranks, those of equal values alike."""
    _, places, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return np.asarray((last - (counts - 1) / 2.0)[places])


def _draw_scatter(
    axes: Axes,
    results: SweepResults,
    key: str,
    metric: str,
    groups: list[tuple[str, Column]],
) -> None:
    draws, values, completed = (
        results.columns[key],
        results.columns[metric],
        completed_mask(results),
    )
    many = len(results) > 1000
    for number, (_, group) in enumerate(groups):
        look, flown, lost = number % len(CYCLE), group & completed, group & ~completed
        color, marker = CYCLE[look], MARKERS[look]
        dots: Any = {"ms": 1.6 if many else 2.5, "alpha": 0.5 if many else 0.7, "mew": 0}
        axes.plot(draws[flown], values[flown], marker, color=color, rasterized=many, **dots)
        height = np.full(int(lost.sum()), 1.03 + 0.04 * number)
        crosses: Any = {"ms": 3.0, "mew": 0.8, "clip_on": False}
        above = axes.get_xaxis_transform()
        (line,) = axes.plot(draws[lost], height, "x", color=color, transform=above, **crosses)
        line.set_in_layout(False)
    axes.set_xlabel(label_of(key))
    if spans_decades(values[completed]):
        axes.set_yscale("log")
