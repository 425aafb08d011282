"""What the pages of a flight share: size, headings, plan view, labels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.views.figures import style
from tiltsim.views.titles import describe_controller, describe_gait

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim.flight.flight import Flight

SIZE: Final = (11.4, 7.6)
"""Width and height of the page, inches: A4 in landscape less its margins."""


def add_headings(figure: Figure, flight: Flight) -> None:
    """Write the title, and a line on what was flown and how it ended, above the panels."""
    layout: Any = figure.get_layout_engine()
    layout.set(w_pad=0.06, h_pad=0.06, rect=(0.0, 0.0, 1.0, 0.925))
    title, line = _headings(flight)
    figure.text(0.012, 0.972, style.verbatim(title), fontsize=12, fontweight="bold", va="center")
    figure.text(0.012, 0.941, line, fontsize=9.5, color="#555555", va="center")


def _headings(flight: Flight) -> tuple[str, str]:
    """The title, and a line on what was flown and how it ended."""
    scenario = flight.scenario
    end = flight.end
    if end.kind == "completed":
        outcome = f"completed after {end.time:g} s"
    else:
        outcome = f"{end.kind} at {end.time:.2f} s"
    variant = scenario.address.partition("#")[2]
    parts = (
        *([style.verbatim(variant)] if variant else []),
        *(words.replace("_", " ") for words in describe_gait(scenario)),
        *describe_controller(scenario),
        f"{scenario.simulation.plant} plant",
        outcome,
    )
    return scenario.title or scenario.address or "Flight", "  ·  ".join(parts)


LAST_MOMENTS: Final = 0.02
"""Share of a lost flight whose end does not count for the scale of a panel."""

FAR_BEYOND: Final = 4.0
"""How many times wider its last moments must make a panel to be cut off."""


def plan_view(axes: Any, flight: Flight) -> None:
    """The path seen from above."""
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
    axes.set_xlabel("x (m)")
    axes.set_title("Plan view")
    axes.set_ylabel("y (m)")
    axes.legend(ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.16), handlelength=1.4)


def label(axes: Any, title: str, unit: str, *, name: str = "", columns: int = 3) -> None:
    """Title, unit and, above the plot where it hides nothing, the legend."""
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


def widen(axes: Any, least: float) -> None:
    """Keep the height of a plot at some size, lest noise fill it."""
    low, high = axes.get_ylim()
    if high - low < least:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.5 * least, middle + 0.5 * least)


def exclude_divergence_from_scale(axes: Any, flight: Flight) -> None:
    """Scale a panel of a lost flight by what came before its last moments, if these go far beyond.

    A loss ends in numbers of any size, next to which all of the flight would be a flat line.
    """
    if flight.end.kind == "completed":
        return
    last = max(1, round(LAST_MOMENTS * len(flight)))
    series = [line.get_ydata() for line in axes.get_lines() if len(line.get_xdata()) == len(flight)]
    if not series or len(flight) <= last:
        return
    values = np.array(series)
    before = values[:, :-last]
    low, high = float(before.min()), float(before.max())
    if np.ptp(values) > FAR_BEYOND * max(high - low, 1e-3 * abs(high), 1e-6):
        room = 0.3 * max(high - low, 0.1 * abs(high), 1e-2)
        axes.set_ylim(low - room, high + room)
        axes.text(0.995, 0.02, "ends off scale", transform=axes.transAxes, ha="right", fontsize=7.5)
