"""Rotor speeds that hover needs under faults (``tiltsim gait --figure faults``)."""

from __future__ import annotations

from math import atan, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from tiltsim.views.figures import style
from tiltsim_controllers.analysis.fault_tolerance import minimum_hover_speed
from tiltsim_controllers.vehicle.parameters import drag_ratio

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim_controllers.vehicle.parameters import Vehicle


@style.paper_style()
def fault_figure(vehicle: Vehicle) -> Figure:
    """Maximum rotor speed in hover over a servo's stuck angle and over the remaining thrust."""
    figure = style.new_figure(6.6, 2.7)
    row: Any = figure.subplots(1, 2, sharey=True)
    stuck, partial = row
    angles = np.linspace(-pi, pi, 49)
    for upright, line, place, text in (
        (False, "-", (-3.0, 395.0), "at any\nattitude"),
        (True, "--", (-1.75, 465.0), "upright"),
    ):
        speeds = [
            minimum_hover_speed(vehicle, stuck=(1, angle), upright=upright)
            for angle in angles.tolist()
        ]
        (drawn,) = stuck.plot(angles, speeds, line)
        stuck.text(*place, text, color=drawn.get_color(), size="small")
    intact = vehicle.hover_rotor_speed
    stuck.axhline(intact, color=style.GREY, lw=0.8)
    note: dict[str, Any] = {"xytext": (3, 2), "textcoords": "offset points", "size": "x-small"}
    place = (-0.8 * pi, intact)
    stuck.annotate(f"intact vehicle, {intact:.0f}", place, color=style.GREY, **note)
    limit = 2.0 * atan(drag_ratio(vehicle))
    stuck.axvline(limit, color=style.AMBER, ls="--", lw=1.0)
    look: dict[str, Any] = {"color": style.AMBER, "size": "small", "va": "top"}
    look["transform"] = stuck.get_xaxis_transform()
    stuck.text(limit, 0.9, " no level gait\n beyond", **look)
    style.angle_axis(stuck, "x", pi)
    stuck.set(xlabel="angle at which servo 1 is stuck (rad)", title="Stuck servo, other tilts free")
    stuck.set_ylabel("maximum rotor speed needed (rad/s)")
    factors = np.linspace(0.0, 1.0, 21)
    speeds = [minimum_hover_speed(vehicle, factors=(f, 1.0, 1.0, 1.0)) for f in factors.tolist()]
    partial.plot(100.0 * factors, speeds)
    partial.plot([0.0], speeds[:1], "o", ms=4, color=style.RED, clip_on=False)
    text = f"failed rotor, {speeds[0]:.0f}"
    partial.text(4.0, speeds[0], text, color=style.RED, size="small", va="center")
    partial.set(xlim=(0.0, 100.0), xlabel="remaining thrust of rotor 1 (%)")
    partial.set_title("Partial thrust, tilts free")
    return figure
