"""Maps of the initial states from which a flight comes back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.laws.assembling import assemble
from tiltsim.linear.attraction import PLACES, Attraction
from tiltsim.system.quantity import in_words
from tiltsim.views.figures import style
from tiltsim_controllers.analysis.unacceptable_attitudes import unacceptable_attitudes
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNITS: Final = {"position": "m", "velocity": "m/s", "attitude": "rad", "angular_velocity": "rad/s"}
CURVES: Final = 8
"""Curves of singular attitudes of a moving gait."""


def attraction_figure(found: Attraction) -> Figure:
    """Where a flight comes back from, with the gait's singular attitudes."""
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    shades = LinearSegmentedColormap.from_list("returned", ["#FFFFFF", style.SKY])
    with style.paper_style():
        figure = style.new_figure(5.0, 5.0)
        axes: Any = figure.subplots()
        axes.pcolormesh(*found.edges, found.share, cmap=shades, vmin=0.0, vmax=1.0, rasterized=True)
        handles: list[Any] = [Patch(facecolor=style.SKY, label="comes back")]
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
        places = [PLACES[name] for name in found.axes]
        start = [getattr(found.scenario.initial, key)[index] for key, index in places]
        axes.plot(*start, "+", color=style.INK, ms=8, mew=1.2)
        handles.append(Line2D([], [], color=style.INK, marker="+", ls="", label="the scenario"))
        labels = [f"{in_words(name)} ({UNITS[PLACES[name][0]]})" for name in found.axes]
        first, second = found.edges
        axes.set(xlim=(first[0], first[-1]), ylim=(second[0], second[-1]))
        axes.set(xlabel=f"initial {labels[0]}", ylabel=f"initial {labels[1]}")
        axes.set_title(f"{100.0 * found.share.mean():.1f} % come back")
        axes.grid(False)
        if len({PLACES[name][0] for name in found.axes}) == 1:
            axes.set_aspect("equal")
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
        return figure
