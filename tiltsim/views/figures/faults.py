"""Rotor speeds that hover needs under faults (``tiltsim gait --figure faults``)."""

from __future__ import annotations

from math import atan, pi
from typing import TYPE_CHECKING

import numpy as np

from tiltsim.views.figures.style import AMBER, GREY, RED, angle_axis, new_figure, paper_style
from tiltsim_controllers.analysis.fault_tolerance import minimum_hover_speed
from tiltsim_controllers.vehicle.parameters import drag_ratio

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tiltsim_controllers.vehicle.parameters import Vehicle


def fault_figure(vehicle: Vehicle) -> Figure:
    """Maximum rotor speed in hover over a servo's stuck angle and over the remaining thrust."""
    with paper_style():
        figure = new_figure(6.6, 2.7)
        stuck, partial = figure.subplots(1, 2, sharey=True)
        _draw_stuck(stuck, vehicle)
        _draw_partial(partial, vehicle)
    return figure


def _draw_stuck(axes: Axes, vehicle: Vehicle) -> None:
    angles = np.linspace(-pi, pi, 49)
    for upright, line, place, text in (
        (False, "-", (-3.0, 395.0), "at any\nattitude"),
        (True, "--", (-1.75, 465.0), "upright"),
    ):
        speeds = [
            minimum_hover_speed(vehicle, stuck=(1, angle), upright=upright)
            for angle in angles.tolist()
        ]
        (drawn,) = axes.plot(angles, speeds, line)
        axes.text(*place, text, color=drawn.get_color(), fontsize=8)
    intact = vehicle.hover_rotor_speed
    axes.axhline(intact, color=GREY, linewidth=0.8)
    axes.annotate(
        f"intact vehicle, {intact:.0f}",
        (-0.8 * pi, intact),
        xytext=(3, 2),
        textcoords="offset points",
        color=GREY,
        fontsize=7,
    )
    limit = 2.0 * atan(drag_ratio(vehicle))
    axes.axvline(limit, color=AMBER, linestyle="--", linewidth=1.0)
    axes.text(
        limit,
        0.9,
        " no level gait\n beyond",
        transform=axes.get_xaxis_transform(),
        color=AMBER,
        fontsize=8,
        verticalalignment="top",
    )
    angle_axis(axes, "x", pi)
    axes.set_xlabel("angle at which servo 1 is stuck (rad)")
    axes.set_ylabel("maximum rotor speed needed (rad/s)")
    axes.set_title("Stuck servo, other tilts free")


def _draw_partial(axes: Axes, vehicle: Vehicle) -> None:
    factors = np.linspace(0.0, 1.0, 21)
    speeds = [minimum_hover_speed(vehicle, factors=(f, 1.0, 1.0, 1.0)) for f in factors.tolist()]
    axes.plot(100.0 * factors, speeds)
    axes.plot([0.0], speeds[:1], "o", markersize=4, color=RED, clip_on=False)
    text = f"failed rotor, {speeds[0]:.0f}"
    axes.text(4.0, speeds[0], text, color=RED, fontsize=8, va="center")
    axes.set_xlim(0.0, 100.0)
    axes.set_xlabel("remaining thrust of rotor 1 (%)")
    axes.set_title("Partial thrust, tilts free")
