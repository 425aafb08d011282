"""Maps of the initial states from which a flight comes back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from tiltsim.laws.assembling import assemble
from tiltsim.linear.attraction import PLACES, Attraction
from tiltsim.system.quantity import in_words
from tiltsim.views.figures import style
from tiltsim_controllers.analysis.unacceptable_attitudes import unacceptable_attitudes
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

UNITS: Final = {"position": "m", "velocity": "m/s", "attitude": "rad", "angular_velocity": "rad/s"}
CURVES: Final = 8  # curves of singular attitudes of a moving gait


@style.paper_style()
def attraction_figure(found: Attraction) -> Figure:
    """Initial states that come back, with the gait's singular attitudes."""
    figure = style.new_figure(5.0, 5.0)
    axes: Any = figure.subplots()
    handles = _draw_map(axes, found)
    places = [PLACES[name] for name in found.axes]
    start = [getattr(found.scenario.initial, key)[index] for key, index in places]
    axes.plot(*start, "+", color=style.INK, ms=8, mew=1.2)
    handles.append(Line2D([], [], color=style.INK, marker="+", ls="", label="the scenario"))
    labels = [f"{in_words(name)} ({UNITS[PLACES[name][0]]})" for name in found.axes]
    axes.set(xlabel=f"initial {labels[0]}", ylabel=f"initial {labels[1]}")
    axes.set_title(f"{100.0 * found.share.mean():.1f} % of the initial states come back")
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


@style.paper_style()
def attraction_panels(maps: Mapping[str, Attraction], columns: int = 4) -> Figure:
    """Maps of roll and pitch side by side, by title: the initial attitudes that come back."""
    rows = -(-len(maps) // columns)
    figure = style.new_figure(2.5 * columns, 2.9 * rows)
    grid: Any = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    handles: dict[str, Artist] = {}
    for axes, (title, found) in zip(grid.flat, maps.items(), strict=False):
        drawn = _draw_map(axes, found)
        # Curves of fixed and of moving gaits look the same: one entry.
        handles |= {str(handle.get_label()).partition(",")[0]: handle for handle in drawn}
        report = found.report()
        shares = [report["acceptable_returned"], report["unacceptable_returned"]]
        texts = ["-" if share is None else f"{100.0 * share:.1f} %" for share in shares]
        axes.set_title(f"{title}\n{' | '.join(texts)}")
    for axes in grid[-1]:
        axes.set_xlabel("initial roll (rad)")
    for axes in grid[:, 0]:
        axes.set_ylabel("initial pitch (rad)")
    for axes in grid.flat[len(maps) :]:
        axes.axis("off")
    figure.legend(handles=list(handles.values()), loc="outside lower center", ncols=3)
    return figure


def _draw_map(axes: Any, found: Attraction) -> list[Artist]:
    """Shade what comes back and draw the singular attitudes; return the legend's entries."""
    shades = LinearSegmentedColormap.from_list("returned", ["#FFFFFF", style.SKY])
    axes.pcolormesh(*found.edges, found.share, cmap=shades, vmin=0.0, vmax=1.0, rasterized=True)
    handles: list[Artist] = [Patch(facecolor=style.SKY, label="comes back")]
    vehicle = found.scenario.vehicle.resolve()
    if found.acceptable is not None and isinstance(vehicle, Vehicle):
        gait = assemble(found.scenario).gait
        times = np.arange(CURVES) / CURVES * (gait.period or 0.0)
        instants = gait.angles(times if gait.period else times[:1])
        curves = [unacceptable_attitudes(angles, vehicle, 721) for angles in instants]
        for curve in curves:
            axes.plot(curve.roll, curve.pitch, color=style.SINGULAR, lw=1.2)
        if any(len(curve.roll) for curve in curves):
            label = "singular, over a period" if gait.period else "singular"
            handles.append(Line2D([], [], color=style.SINGULAR, lw=1.2, label=label))
    first, second = found.edges
    axes.set(xlim=(first[0], first[-1]), ylim=(second[0], second[-1]))
    axes.grid(False)
    if len({PLACES[name][0] for name in found.axes}) == 1:
        axes.set_aspect("equal")
    return handles
