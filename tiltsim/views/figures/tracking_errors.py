"""Errors of many flights: at setpoints (ch. 4, Fig. 4) and by period (Figs. 8 to 14)."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from tiltsim.views.figures import style
from tiltsim.views.figures.layout import add_legend


class SetpointErrors(NamedTuple):
    """Steady errors of one controller with several gaits."""

    label: str
    names: Sequence[str]
    points: Sequence[tuple[float, float]]  # (x, y), m
    published: Sequence[tuple[float, float]]  # m


class PeriodErrors(NamedTuple):
    """Largest errors by the gait's period; None for flights that terminated early."""

    label: str
    periods: Sequence[float]  # s
    errors: Sequence[float | None]  # m


@style.paper_style()
def setpoint_figure(families: Sequence[SetpointErrors]) -> Figure:
    """Steady position errors, reference minus actual, with the published values.

    One panel per family, each with its own scale, so that every point has room for its name.
    """
    figure = style.new_figure(4.2 * len(families), 4.3)
    row: Any = figure.subplots(1, len(families), squeeze=False)[0]
    for axes, family, color in zip(row, families, (style.RED, style.BLUE), strict=False):
        style.zero_lines(axes)
        published, points = zip(*family.published, strict=True), zip(*family.points, strict=True)
        axes.plot(*published, "s", ms=10, mfc="none", mec=style.INK, label="published")
        axes.plot(*points, "o", ms=4.5, color=color, label="measured")
        for name, point in zip(family.names, family.points, strict=True):
            text = axes.annotate(name, point, (7, 5), textcoords="offset points")
            text.set(size="small", color=color)
        axes.set(xlabel="error along x (m)", ylabel="error along y (m)", title=family.label)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.14)
    row[0].legend(loc="upper right")
    return figure


@style.paper_style()
def period_figure(panels: Sequence[tuple[str, Sequence[PeriodErrors]]]) -> Figure:
    """Largest error after 20 s by period, on a logarithmic scale that all panels share.

    ``panels`` are titles with their series. A cross at the upper edge marks a flight that
    terminated early.
    """
    figure = style.new_figure(2.5 * len(panels) + 0.9, 3.0)
    row: Any = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    looks = [(style.RED, "o-"), (style.BLUE, "s-"), (style.RED, "o:"), (style.BLUE, "s:")]
    terminated = False
    for axes, (title, series) in zip(row, panels, strict=True):
        for family, (color, look) in zip(series, looks, strict=False):
            pairs = [*zip(family.periods, family.errors, strict=False)]
            flown = zip(*((period, error) for period, error in pairs if error is not None))
            fill = "white" if ":" in look else color
            axes.plot(*flown, look, color=color, ms=4.5, mfc=fill, label=family.label)
            ended = [period for period, error in pairs if error is None]
            cross = {"color": color, "ms": 8, "mew": 2.0, "transform": axes.get_xaxis_transform()}
            axes.plot(ended, [0.96] * len(ended), "x", **cross)
            terminated |= bool(ended)
        axes.set(title=title, xlabel="period (s)", yscale="log", xticks=series[0].periods)
        axes.margins(x=0.12, y=0.12)
    row[0].set_ylabel("largest error after 20 s (m)")
    if terminated:
        row[0].plot([], [], "x", color=style.INK, ms=8, mew=2.0, label="terminated early")
    add_legend(figure, row[0].get_legend_handles_labels()[0])
    return figure
