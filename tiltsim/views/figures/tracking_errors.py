"""Errors of many flights: at setpoints (ch. 4, Fig. 4) and by period (Figs. 8 to 14)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from tiltsim.views.figures import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class SetpointErrors(NamedTuple):
    """Steady errors of a family of flights, one law with several gaits."""

    label: str
    names: Sequence[str]
    points: Sequence[tuple[float, float]]  # (x, y), m
    published: Sequence[tuple[float, float]]  # m


class PeriodErrors(NamedTuple):
    """Largest errors by the gait's period; lost flights have none."""

    label: str
    periods: Sequence[float]  # s
    errors: Sequence[float | None]  # m


def setpoint_figure(families: Sequence[SetpointErrors]) -> Figure:
    """Where flights come to rest, reference minus actual, beside the printed values."""
    with style.paper_style():
        figure = style.new_figure(4.6, 4.3)
        axes: Any = figure.subplots()
        axes.axhline(0.0, color=style.GREY, lw=0.7)
        axes.axvline(0.0, color=style.GREY, lw=0.7)
        printed = [point for family in families for point in family.published]
        axes.plot(
            *zip(*printed, strict=True), "s", ms=10, mfc="none", mec=style.INK, label="published"
        )
        for family, color in zip(families, (style.RED, style.BLUE), strict=False):
            axes.plot(*zip(*family.points, strict=True), "o", ms=4.5, color=color)
            axes.plot([], [], "o", ms=4.5, color=color, label=family.label)
            for name, point in zip(family.names, family.points, strict=True):
                side = 1.0 if color == style.RED else -1.0
                axes.annotate(
                    name, point, (7.0 * side, 5.0 * side), textcoords="offset points", fontsize=7.5,
                    color=color, ha="left" if side > 0 else "right",
                    va="bottom" if side > 0 else "top",
                )  # fmt: skip
        axes.set_xlabel("error along x (m)")
        axes.set_ylabel("error along y (m)")
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.12)
        axes.legend(loc="upper right")
        return figure


def period_figure(panels: Sequence[tuple[str, Sequence[PeriodErrors]]]) -> Figure:
    """Largest error after 20 s by period, panel by panel, on one logarithmic scale.

    A cross at the upper edge stands for a lost flight.
    """
    with style.paper_style():
        figure = style.new_figure(2.5 * len(panels) + 0.9, 3.0)
        row: Any = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        looks = [(style.RED, "o-"), (style.BLUE, "s-"), (style.RED, "o:"), (style.BLUE, "s:")]
        lost = False
        for axes, (title, series) in zip(row, panels, strict=True):
            for family, (color, look) in zip(series, looks, strict=False):
                flown = [(p, e) for p, e in zip(family.periods, family.errors) if e is not None]
                axes.plot(
                    *zip(*flown, strict=True), look, color=color, ms=4.5, label=family.label,
                    mfc="white" if ":" in look else color,
                )  # fmt: skip
                for period, error in zip(family.periods, family.errors):
                    if error is None:
                        lost = True
                        axes.plot(
                            [period], [0.96], "x", color=color, ms=8, mew=2.0,
                            transform=axes.get_xaxis_transform(),
                        )  # fmt: skip
            axes.set_yscale("log")
            axes.set_title(title)
            axes.set_xlabel("period (s)")
            axes.set_xticks(list(series[0].periods))
            axes.margins(x=0.12, y=0.12)
        row[0].set_ylabel("largest error after 20 s (m)")
        handles, labels = row[0].get_legend_handles_labels()
        if lost:
            (cross,) = row[0].plot([], [], "x", color=style.INK, ms=8, mew=2.0)
            handles, labels = [*handles, cross], [*labels, "lost"]
        figure.legend(handles, labels, loc="outside lower center", ncols=len(handles))
        return figure
