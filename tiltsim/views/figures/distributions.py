"""The figure of randomly sampled flights: completed share, metrics, effect of the samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
"""Quantiles that are marked on the curves."""

MAX_KEYS: Final = 4
"""Largest number of sampled keys with a panel of their own."""

HATCHES: Final = ("", "///", "...", "\\\\\\", "xxx", "---", "+++")
"""Hatches of bars that accompany the colours of `CYCLE`."""

NORMAL_95: Final = 1.959963984540054


def distributions_figure(results: SweepResults, metrics: tuple[str, ...]) -> Figure:
    """Completed share, distributions of metrics, and the first metric over the sampled keys.

    A flight that terminated early counts as the worst value: a curve of errors ends at the
    completed share, one of margins (``min_...``) begins at the share that terminated early.
    """
    key = results.points.sweep.plot.lines or next(iter(_grid_keys(results)), None)
    groups = list(groups_of(results, key, np.ones(len(results), dtype=bool)))
    keys = _most_effective(results, metrics[0], groups)
    figure = new_figure(10.0, 6.2 if keys else 3.2)
    parts: Any = figure.subfigures(2 if keys else 1, 1, squeeze=False)
    above, below = parts[0, 0], parts[-1, 0]
    ratios = [0.62, *(1.0 for _ in metrics)]
    shares, *curves = above.subplots(1, 1 + len(metrics), width_ratios=ratios)
    _draw_shares(shares, results, groups)
    for axes, metric in zip(curves, metrics):
        marked = [
            _draw_curve(axes, results, metric, group, number % len(CYCLE))
            for number, (_, group) in enumerate(groups)
        ]
        # The leftmost curve has its numbers on the left, so that they do not lie on the others.
        middles = [np.median([value for _, value in one.values()] or [0.0]) for one in marked]
        for number, one in enumerate(marked):
            left = len(marked) > 1 and number == int(np.argmin(middles))
            _write_quantiles(axes, one, CYCLE[number % len(CYCLE)], left=left)
        if spans_decades(results.columns[metric][completed_mask(results)]):
            axes.set_xscale("log")
        else:
            axes.locator_params(axis="x", nbins=5)
            axes.ticklabel_format(axis="x", useOffset=False)
        axes.margins(x=0.22)  # room for the numbers
        axes.set_ylim(0.0, 1.03)
        axes.set_xlabel(label_of(results, metric))
        axes.set_ylabel("share of flights at or below")
    if not keys:
        return figure
    panels = np.atleast_1d(below.subplots(1, len(keys), sharey=True))
    for axes, drawn in zip(panels, keys):
        _draw_scatter(axes, results, drawn, metrics[0], groups)
    panels[0].set_ylabel(label_of(results, metrics[0]))
    if not completed_mask(results).all():
        panels[0].set_title("× terminated early", pad=10.0 + 6.0 * len(groups))
    return figure


def _grid_keys(results: SweepResults) -> list[str]:
    """Keys of grid axes, those with text values first."""
    keys = [a.targets[0] for a in results.points.sweep.axis if isinstance(a, GridAxis)]
    return sorted(keys, key=lambda key: results.columns[key].dtype == np.float64)


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """The 95 percent confidence interval of a probability (Wilson, 1927)."""
    share, square = successes / trials, NORMAL_95**2 / trials
    middle = (share + square / 2.0) / (1.0 + square)
    half = sqrt(share * (1.0 - share) * square + square**2 / 4.0) / (1.0 + square)
    return max(0.0, middle - half), min(1.0, middle + half)


def _draw_shares(axes: Axes, results: SweepResults, groups: list[tuple[str, Column]]) -> None:
    completed = completed_mask(results)
    for number, (name, group) in enumerate(groups):
        flown, trials = int((group & completed).sum()), int(group.sum())
        low, high = wilson_interval(flown, trials)
        share, color = flown / trials, CYCLE[number % len(CYCLE)]
        hatch = HATCHES[number % len(CYCLE)]
        axes.barh(
            number, share, height=0.26, color=color, alpha=0.85, hatch=hatch, ec="white", lw=0
        )
        axes.plot([low, high], [number, number], color=INK, lw=1.6, solid_capstyle="butt")
        text = f"{name}: {flown} of {trials}".lstrip(": ")
        axes.annotate(text, (0.01, number - 0.25), size="small", color=color).set_in_layout(False)
    axes.set_yticks([])
    axes.grid(visible=False, axis="y")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(len(groups) - 0.65, -0.6)
    axes.set_xlabel("completed share")


def _draw_curve(
    axes: Axes, results: SweepResults, metric: str, group: Column, look: int
) -> dict[str, tuple[float, float]]:
    """Draw a curve; returns the texts of its quantiles with their shares and values."""
    color, marker = CYCLE[look], MARKERS[look]
    values = results.columns[metric][group & completed_mask(results)]
    values = np.sort(values[~np.isnan(values)])
    total = int(group.sum())
    worst = total - len(values) if metric.startswith("min_") else 0
    share = (worst + np.arange(1, len(values) + 1)) / total
    axes.step(values, share, where="post", color=color, ls=DASHES[look])
    marked: dict[float, float] = {}
    for quantile in QUANTILES:
        place = int(np.searchsorted(share, quantile - 1e-12))
        if place < len(values) and not (place == 0 and worst):  # among the completed flights
            marked[float(share[place])] = float(values[place])
    axes.plot([*marked.values()], [*marked], marker, ms=4.5, color=color)
    return dict(zip(distinct_texts([*marked.values()]), marked.items(), strict=True))


def distinct_texts(values: Sequence[float]) -> list[str]:
    """Numbers with three digits or, if that makes unequal ones alike, with more."""
    for digits in range(3, 9):
        texts = [f"{value:.{digits}g}".replace("-", "−") for value in values]
        if len(set(texts)) == len(set(values)):
            break
    return texts


def _write_quantiles(
    axes: Axes, marked: Mapping[str, tuple[float, float]], color: str, *, left: bool
) -> None:
    """Write the marked values beside their marks, on one side of the curve."""
    for text, (share, value) in marked.items():
        # Above a rising curve on its left, below it on its right.
        shift, side = ((-5.0, 2.0), "right") if left else ((5.0, -8.0), "left")
        place: dict[str, Any] = {"xytext": shift, "textcoords": "offset points"}
        written = axes.annotate(text, (value, share), **place)
        written.set(size="small", color=color, ha=side)
        written.set_in_layout(False)


def _most_effective(
    results: SweepResults, metric: str, groups: list[tuple[str, Column]]
) -> list[str]:
    """The sampled keys with the highest rank correlation to the metric, in the file's order."""
    keys = sampled_keys(results)
    values = np.where(completed_mask(results), results.columns[metric], np.inf)
    values = np.where(np.isnan(values), np.inf, values)

    def strength(key: str) -> float:
        draws = results.columns[key]
        # Both too large and too small values may be harmful.
        both = (draws, np.abs(draws - np.median(draws)))
        found = [_rank_correlation(d[group], values[group]) for _, group in groups for d in both]
        return max(map(abs, found))

    chosen = sorted(keys, key=strength, reverse=True)[:MAX_KEYS]
    return [key for key in keys if key in chosen]


def _rank_correlation(first: Column, second: Column) -> float:
    """Spearman's rank correlation; 0 if either is constant."""
    left, right = _ranks(first), _ranks(second)
    if np.ptp(left) == 0.0 or np.ptp(right) == 0.0:
        return 0.0
    return float(np.corrcoef(left, right)[0, 1])


def _ranks(values: Column) -> Column:
    """Ranks; equal values share their mean rank."""
    _, places, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return np.asarray((last - (counts - 1) / 2.0)[places])


def _draw_scatter(
    axes: Axes, results: SweepResults, key: str, metric: str, groups: list[tuple[str, Column]]
) -> None:
    draws, values, completed = (
        results.columns[key],
        results.columns[metric],
        completed_mask(results),
    )
    many = len(results) > 1000
    for number, (_, group) in enumerate(groups):
        look, flown, ended = number % len(CYCLE), group & completed, group & ~completed
        color, marker = CYCLE[look], MARKERS[look]
        size, alpha = (1.6, 0.5) if many else (2.5, 0.7)
        (line,) = axes.plot(draws[flown], values[flown], marker, color=color, ms=size, mew=0)
        line.set(alpha=alpha, rasterized=many)
        height = np.full(int(ended.sum()), 1.03 + 0.04 * number)
        above = axes.get_xaxis_transform()
        (line,) = axes.plot(draws[ended], height, "x", color=color, ms=3.0, transform=above)
        line.set(mew=0.8, clip_on=False, in_layout=False)
    axes.set_xlabel(label_of(results, key))
    axes.locator_params(axis="x", nbins=4)
    axes.ticklabel_format(axis="x", useOffset=False)
    if spans_decades(values[completed]):
        axes.set_yscale("log")
