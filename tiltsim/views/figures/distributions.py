"""The figure of randomly sampled flights, and columns of sweep results: groups, labels, units."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binomtest, spearmanr

from tiltsim.scenario.metric_names import metric_of
from tiltsim.scenario.schema import quantity_of_key
from tiltsim.sweeps.dataset import Column, SweepResults
from tiltsim.sweeps.tables import GridAxis, NormalAxis, UniformAxis
from tiltsim.views.figures.style import CYCLE, DASHES, INK, MARKERS, new_figure, verbatim


def sampled_keys(results: SweepResults) -> list[str]:
    """The first key of every axis that is sampled from a distribution."""
    axes = results.points.sweep.axis
    return [a.targets[0] for a in axes if isinstance(a, UniformAxis | NormalAxis)]


def spans_decades(values: Column) -> bool:
    """Whether all values are positive and the largest is over 50 times the smallest."""
    known = values[~np.isnan(values)]
    return bool(known.size) and 0.0 < 50.0 * float(known.min()) < float(known.max())


def completed_mask(results: SweepResults) -> Column:
    """Whether the flight of each row was completed, shape (rows,)."""
    return np.array(results.columns["end"] == "completed")


def groups_of(results: SweepResults, key: str | None, mask: Column) -> Iterator[tuple[str, Column]]:
    """The distinct values of a column as text, each with its rows within a mask.

    Without a column (None) all rows are one group without a name.
    """
    if key is None:
        yield "", mask
        return
    column = results.values(key)
    texts = np.array([text_of(value) for value in column], dtype=object)
    for text in dict.fromkeys(texts[mask].tolist()):
        yield text, mask & (texts == text)


def text_of(value: Any) -> str:
    """A value as text for figures."""
    if isinstance(value, list):
        return "(" + ", ".join(map(text_of, value)) + ")"
    if isinstance(value, float | int):
        return f"{value:g}"
    text = str(value)
    return verbatim(text.replace("_", " ") if text.isidentifier() else text)


def label_of(results: SweepResults, name: str) -> str:
    """The label of a column, from the sweep's ``[plot]`` table or by default, with a known unit."""
    own = results.points.sweep.plot.labels.get(name)
    if own is not None:
        return verbatim(own)
    if name in results.points.metrics:
        return metric_of(name).quantity.text
    known = quantity_of_key(name)
    # Errors of a model without a unit are factors.
    factor = name.startswith("model_error.") and known.unit in {"", "1"}
    return f"{known.text} factor" if factor else known.text


Groups = Sequence[tuple[str, Column]]

QUANTILES: Final = (0.05, 0.5, 0.95)  # that are marked on the curves
LOW: Final = 0.1  # share below which numbers are written above their marks
MAX_KEYS: Final = 4  # largest number of sampled keys with a separate panel
HATCHES: Final = ("", "///", "...", "\\\\\\", "xxx", "---", "+++")  # of bars, by `CYCLE`


def distributions_figure(results: SweepResults, metrics: tuple[str, ...]) -> Figure:
    """Completed share, distributions of metrics, and the first metric over the sampled keys.

    A flight that terminated early counts as the worst value: a curve of errors ends at the
    completed share, one of margins (``min_...``) begins at the share that terminated early.
    """
    axes = results.points.sweep.axis
    keys = [axis.targets[0] for axis in axes if isinstance(axis, GridAxis)]
    keys.sort(key=lambda key: results.columns[key].dtype == np.float64)  # texts first
    lines = results.points.sweep.plot.lines or next(iter(keys), None)
    groups = [*groups_of(results, lines, np.ones(len(results), dtype=bool))]
    keys, completed = _most_effective(results, metrics[0], groups), completed_mask(results)
    figure = new_figure(10.0, 6.2 if keys else 3.2)
    parts = figure.subfigures(2 if keys else 1, 1, squeeze=False)
    above, below = parts[0, 0], parts[-1, 0]
    ratios = [0.62, *(1.0 for _ in metrics)]
    shares, *curves = above.subplots(1, 1 + len(metrics), width_ratios=ratios)
    _draw_shares(shares, completed, groups)
    for panel, metric in zip(curves, metrics):
        marked = [
            _draw_curve(panel, results, metric, group, number % len(CYCLE))
            for number, (_, group) in enumerate(groups)
        ]
        # The leftmost curve has its numbers on the left, so that they do not lie on the others.
        middles = [np.median([value for _, value in one.values()] or [0.0]) for one in marked]
        for number, one in enumerate(marked):
            left = len(marked) > 1 and number == int(np.argmin(middles))
            for text, (share, value) in one.items():
                # Above a rising curve on its left, below it on its right, clear of the axis.
                above = left or share < LOW
                shift, side = ((-5.0, 2.0), "right") if above else ((5.0, -8.0), "left")
                place: dict[str, Any] = {"xytext": shift, "textcoords": "offset points"}
                written = panel.annotate(text, (value, share), **place)
                written.set(size="small", color=CYCLE[number % len(CYCLE)], ha=side)
                written.set_in_layout(False)
        if spans_decades(results.columns[metric][completed]):
            panel.set_xscale("log")
        else:
            panel.locator_params(axis="x", nbins=5)
            panel.ticklabel_format(axis="x", useOffset=False)
        panel.margins(x=0.22)  # room for the numbers
        panel.set(ylim=(0.0, 1.03), xlabel=label_of(results, metric))
        panel.set_ylabel("share of flights at or below")
    if keys:
        panels = np.atleast_1d(below.subplots(1, len(keys), sharey=True))
        for panel, key in zip(panels, keys):
            _draw_scatter(panel, results, key, metrics[0], groups)
        panels[0].set_ylabel(label_of(results, metrics[0]))
        if not completed.all():
            panels[0].set_title("× terminated early", pad=10.0 + 6.0 * len(groups))
    return figure


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """The 95 percent confidence interval of a probability (Wilson, 1927)."""
    interval = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def _draw_shares(axes: Axes, completed: Column, groups: Groups) -> None:
    for number, (name, group) in enumerate(groups):
        flown, trials, look = int((group & completed).sum()), int(group.sum()), number % len(CYCLE)
        bar: dict[str, Any] = {"color": CYCLE[look], "hatch": HATCHES[look], "alpha": 0.85}
        axes.barh(number, flown / trials, height=0.26, **bar, ec="white", lw=0)
        interval = wilson_interval(flown, trials)
        axes.plot(interval, [number, number], color=INK, lw=1.6, solid_capstyle="butt")
        text = f"{name}: {flown} of {trials}".lstrip(": ")
        written = axes.annotate(text, (0.01, number - 0.25), size="small", color=CYCLE[look])
        written.set_in_layout(False)
    axes.set_yticks([])
    axes.grid(visible=False, axis="y")
    axes.set(xlim=(0.0, 1.0), ylim=(len(groups) - 0.65, -0.6), xlabel="completed share")


def _draw_curve(
    axes: Axes, results: SweepResults, metric: str, group: Column, look: int
) -> Mapping[str, tuple[float, float]]:
    """Draw a curve; returns the texts of its quantiles with their shares and values."""
    values = results.columns[metric][group & completed_mask(results)]
    values = np.sort(values[~np.isnan(values)])
    total = int(group.sum())
    worst = total - len(values) if metric.startswith("min_") else 0
    share = (worst + np.arange(1, len(values) + 1)) / total
    axes.step(values, share, where="post", color=CYCLE[look], ls=DASHES[look])
    marked: dict[float, float] = {}
    for quantile in QUANTILES:
        place = int(np.searchsorted(share, quantile - 1e-12))
        if place < len(values) and not (place == 0 and worst):  # among the completed flights
            marked[float(share[place])] = float(values[place])
    axes.plot([*marked.values()], [*marked], MARKERS[look], ms=4.5, color=CYCLE[look])
    return dict(zip(distinct_texts([*marked.values()]), marked.items(), strict=True))


def distinct_texts(values: Sequence[float]) -> list[str]:
    """Numbers with three digits or, if that makes unequal ones alike, with more."""
    for digits in range(3, 9):
        texts = [f"{value:.{digits}g}".replace("-", "−") for value in values]
        if len(set(texts)) == len(set(values)):
            break
    return texts


def _most_effective(results: SweepResults, metric: str, groups: Groups) -> list[str]:
    """The sampled keys with the highest rank correlation to the metric, in the file's order."""
    keys = sampled_keys(results)
    values = np.where(completed_mask(results), results.columns[metric], np.inf)
    values = np.where(np.isnan(values), np.inf, values)

    def strength(key: str) -> float:
        draws = results.columns[key]
        # Both too large and too small values may be harmful.
        both = (draws, np.abs(draws - np.median(draws)))
        pairs = [(d[group], values[group]) for _, group in groups for d in both]
        # A constant has no correlation.
        varied = [pair for pair in pairs if all(len(np.unique(part)) > 1 for part in pair)]
        return max((abs(float(spearmanr(*pair).statistic)) for pair in varied), default=0.0)

    chosen = sorted(keys, key=strength, reverse=True)[:MAX_KEYS]
    return [key for key in keys if key in chosen]


def _draw_scatter(axes: Axes, results: SweepResults, key: str, metric: str, groups: Groups) -> None:
    draws, values = results.columns[key], results.columns[metric]
    completed, many = completed_mask(results), len(results) > 1000
    size, alpha = (1.6, 0.5) if many else (2.5, 0.7)
    for number, (_, group) in enumerate(groups):
        look, flown, ended = number % len(CYCLE), group & completed, group & ~completed
        mark: dict[str, Any] = {"color": CYCLE[look], "ms": size, "mew": 0}
        (line,) = axes.plot(draws[flown], values[flown], MARKERS[look], **mark)
        line.set(alpha=alpha, rasterized=many)
        height = np.full(int(ended.sum()), 1.03 + 0.04 * number)
        mark = {"color": CYCLE[look], "ms": 3.0, "transform": axes.get_xaxis_transform()}
        (line,) = axes.plot(draws[ended], height, "x", **mark)
        line.set(mew=0.8, clip_on=False, in_layout=False)
    axes.set_xlabel(label_of(results, key))
    axes.locator_params(axis="x", nbins=4)
    axes.ticklabel_format(axis="x", useOffset=False)
    if spans_decades(values[completed]):
        axes.set_yscale("log")
