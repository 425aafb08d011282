"""Attainable torques and thrusts, and side accelerations, under speed limits (ch. 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.views.figures import style
from tiltsim.views.figures.multirotor import draw_set
from tiltsim_controllers.analysis.attainable import (
    HOVER_THRUST,
    attainable_accelerations,
    attainable_torque_thrust,
    published_speed_limits,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim_controllers.gaits.plans import Gait
    from tiltsim_controllers.vehicle.parameters import Vehicle

_SLICES: Final = 7


@style.paper_style()
def attainable_figure(
    gait: Gait, vehicle: Vehicle, speed_limits: tuple[float, float] | None = None
) -> Figure:
    """Roll torque, pitch torque and thrust at zero yaw torque; accelerations at hover thrust.

    For a constant gait. ``speed_limits`` are the minimum and maximum rotor speed, rad/s; by default
    the limits of ch. 9.
    """
    from matplotlib.patches import Patch

    limits = speed_limits or published_speed_limits(vehicle)
    angles = gait.angles(0.0)
    whole = attainable_torque_thrust(angles, vehicle, limits)
    title = f"Torque and thrust at zero yaw torque, {gait.name}"
    conditions = f"Rotor speeds from {limits[0]:.2f} to {limits[1]:.2f} rad/s. Body axes."
    if whole.is_empty:  # a note in place of the set
        figure = style.new_figure(5.0, 1.2)
        axes: Any = figure.subplots()
        axes.set_axis_off()
        axes.set_title(title)
        reason = "Empty set: no rotor speeds within the limits give zero yaw torque."
        axes.text(0.0, 0.6, reason, transform=axes.transAxes)
        axes.text(0.0, 0.1, conditions, transform=axes.transAxes, size="small")
        return figure
    figure = style.new_figure(8.8, 4.0)
    grid = figure.add_gridspec(1, 2, width_ratios=[1.25, 1.0])
    space: Any = figure.add_subplot(grid[0], projection="3d")
    plane: Any = figure.add_subplot(grid[1])
    space.set_title(title)
    if whole.dimension == 3:
        draw_set(space, whole, style.SKY, alpha=0.15)
    for thrust in np.linspace(whole.lower[2], whole.upper[2], _SLICES + 2)[1:-1].tolist():
        found = attainable_torque_thrust(angles, vehicle, limits, vertical_thrust=thrust)
        if not found.is_empty:
            draw_set(space, found, style.BLUE, alpha=0.45)
    space.set(xlabel=r"$\tau_L$ (N m)", ylabel=r"$\tau_M$ (N m)", zlabel="$F_Z$ (N)")
    space.view_init(elev=18, azim=-60)
    space.locator_params(nbins=5)
    space.set_box_aspect(None, zoom=0.92)
    sides = attainable_accelerations(angles, vehicle, limits)
    if sides.is_empty:
        plane.set_axis_off()
        plane.text(0.5, 0.5, "none", transform=plane.transAxes, ha="center")
    else:
        style.zero_lines(plane)
        if sides.dimension == 2:
            plane.fill(*sides.vertices.T, facecolor=style.PALE, edgecolor=style.BLUE, lw=1.4)
        else:
            plane.plot(*sides.vertices.T, color=style.BLUE, lw=2.2, marker="o", ms=4)
    plane.set_aspect("equal", adjustable="datalim")
    plane.locator_params(nbins=6)
    plane.set(xlabel="$F_X / m$ (m/s²)", ylabel="$F_Y / m$ (m/s²)")
    plane.set_title(f"Acceleration at $F_Z$ = {HOVER_THRUST:g} N")
    plane.margins(0.12)
    handles = [
        Patch(color=style.SKY, alpha=0.3, lw=0.0, label="attainable set"),
        Patch(facecolor=style.BLUE, edgecolor=style.INK, alpha=0.45, label="at one thrust $F_Z$"),
        Patch(facecolor=style.PALE, edgecolor=style.BLUE, label="accelerations"),
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=3)
    figure.supxlabel(conditions, size="small", x=0.01, ha="left")
    return figure
