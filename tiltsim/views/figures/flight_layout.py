"""Common parts of the figures of a flight: size, headings, plan view, labels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.views.figures import style
from tiltsim.views.titles import describe_controller, describe_gait

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tiltsim.flight.flight import Flight

SIZE: Final = (11.4, 7.6)
"""Width and height of the page, inches: A4 landscape without margins."""

END_FRACTION: Final = 0.02
"""Share of the samples, at the end of a diverged flight, that the scale of a panel ignores."""

MAX_WIDENING: Final = 4.0
"""Factor by which these samples may widen the scale of a panel before they are ignored."""


def add_headings(figure: Figure, flight: Flight) -> None:
    """Write the title and a line with variant, gait, controller, plant and end above the panels."""
    layout: Any = figure.get_layout_engine()
    layout.set(w_pad=0.06, h_pad=0.06, rect=(0.0, 0.0, 1.0, 0.925))
    scenario, end = flight.scenario, flight.end
    title = style.verbatim(scenario.title or scenario.address or "Flight")
    figure.text(0.012, 0.972, title, fontsize=12, fontweight="bold", va="center")
    parts = [style.verbatim(scenario.address.partition("#")[2])]
    parts += [*describe_gait(flight.assembly), *describe_controller(scenario)]
    parts.append(f"{scenario.simulation.plant} plant")
    if end.kind == "completed":
        parts.append(f"completed after {end.time:g} s")
    else:
        parts.append(f"{end.kind} at {end.time:.2f} s")
    line = "  ·  ".join(filter(None, parts))
    figure.text(0.012, 0.941, line, fontsize=9.5, color="#555555", va="center")


def plan_view(axes: Axes, flight: Flight) -> None:
    """The path from above."""
    x, y = flight["x"], flight["y"]
    if flight.assembly.follows_position:
        reference = flight["x_ref"], flight["y_ref"]
        if np.ptp(reference[0]) + np.ptp(reference[1]) > 0.0:
            axes.plot(*reference, color=style.INK, ls=":", lw=1.1, label="reference")
        else:
            at = (reference[0][0], reference[1][0])
            axes.plot(*at, "+", color=style.INK, ms=7, mew=1.4, label="reference")
    axes.plot(x, y, color=style.BLUE, label="path")
    axes.plot(x[0], y[0], "o", color=style.INK, mfc="white", ms=5, label="start")
    axes.plot(x[-1], y[-1], "s", color=style.RED, ms=5, label="end")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.set(xlabel="x (m)", ylabel="y (m)", title="Plan view")
    legend_below(axes)


def legend_below(axes: Axes) -> None:
    """A legend in one row below the x label."""
    axes.legend(ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.16), handlelength=1.4)


def label(axes: Axes, title: str, unit: str, *, name: str = "", columns: int = 3) -> None:
    """Label a panel.

    Args:
        axes: The panel, with its lines.
        title: Its title.
        unit, name: Unit and, optionally, name of the y axis.
        columns: Columns of the legend, which is placed above the plot.
    """
    axes.set_title(title)
    axes.set_ylabel(f"{name} ({unit})" if name else unit)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            ncols=columns,
            loc="lower right",
            bbox_to_anchor=(1.0, 0.985),
            borderaxespad=0.0,
            handlelength=1.4,
            columnspacing=0.9,
            handletextpad=0.4,
        )


def widen(axes: Axes, minimum: float) -> None:
    """Widen the y axis to a minimum range, so that noise does not fill the panel."""
    low, high = axes.get_ylim()
    if high - low < minimum:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.5 * minimum, middle + 0.5 * minimum)


def exclude_divergence_from_scale(axes: Any, flight: Flight) -> None:
    """Ignore the last samples of a diverged flight in the scale of a panel.

    They can be of any magnitude, which would make the rest of the flight a flat line.
    """
    if flight.end.kind == "completed":
        return
    last = max(1, round(END_FRACTION * len(flight)))
    series = [line.get_ydata() for line in axes.get_lines() if len(line.get_xdata()) == len(flight)]
    if not series or len(flight) <= last:
        return
    values = np.array(series)
    before = values[:, :-last]
    low, high = float(before.min()), float(before.max())
    if np.ptp(values) > MAX_WIDENING * max(high - low, 1e-3 * abs(high), 1e-6):
        pad = 0.3 * max(high - low, 0.1 * abs(high), 1e-2)
        axes.set_ylim(low - pad, high + pad)
        axes.text(0.995, 0.02, "ends off scale", transform=axes.transAxes, ha="right", fontsize=7.5)
