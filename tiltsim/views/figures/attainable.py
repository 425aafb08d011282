"""Attainable torques and thrusts, and side accelerations, under speed limits (ch. 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tiltsim.views.figures import style
from tiltsim_controllers.analysis.attainable import (
    HOVER_THRUST,
    attainable_accelerations,
    attainable_torque_thrust,
    published_speed_limits,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim_controllers.analysis.attainable import AttainableSet
    from tiltsim_controllers.gaits.plans import Gait
    from tiltsim_controllers.vehicle.parameters import Vehicle

_SLICES = 7


def attainable_figure(
    gait: Gait, vehicle: Vehicle, speed_limits: tuple[float, float] | None = None
) -> Figure:
    """Roll torque, pitch torque and thrust at zero yaw torque; accelerations at hover thrust.

    For a constant gait. ``speed_limits`` are the minimum and maximum rotor speed, rad/s; by default
    those of ch. 9.
    """
    limits = speed_limits or published_speed_limits(vehicle)
    angles = gait.angles(0.0)
    whole = attainable_torque_thrust(angles, vehicle, limits)
    with style.paper_style():
        if whole.is_empty:
            return _empty_figure(gait, limits)
        figure = style.new_figure(8.8, 4.0)
        grid = figure.add_gridspec(1, 2, width_ratios=[1.25, 1.0])
        space: Any = figure.add_subplot(grid[0], projection="3d")
        plane: Any = figure.add_subplot(grid[1])
        space.set_title(f"Torque and thrust at zero yaw torque, {gait.name}")
        plane.set_title(f"Acceleration at $F_Z$ = {HOVER_THRUST:g} N")
        _outline(space, whole)
        low, high = whole.lower[2], whole.upper[2]
        for thrust in np.linspace(low, high, _SLICES + 2)[1:-1]:
            _slice(
                space,
                attainable_torque_thrust(angles, vehicle, limits, vertical_thrust=float(thrust)),
            )
        space.set(xlabel=r"$\tau_L$ (N m)", ylabel=r"$\tau_M$ (N m)", zlabel="$F_Z$ (N)")
        space.view_init(elev=18, azim=-60)
        space.locator_params(nbins=5)
        space.set_box_aspect(None, zoom=0.92)
        _accelerations(plane, attainable_accelerations(angles, vehicle, limits))
        _legend(figure)
        figure.supxlabel(_conditions(limits), fontsize=8, x=0.01, ha="left")
        return figure


def _legend(figure: Figure) -> None:
    from matplotlib.patches import Patch

    handles = [
        Patch(color=style.SKY, alpha=0.3, lw=0.0, label="attainable set"),
        Patch(facecolor=style.BLUE, edgecolor=style.INK, alpha=0.45, label="at one thrust $F_Z$"),
        Patch(facecolor=style.PALE, edgecolor=style.BLUE, label="accelerations"),
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=3)


def _conditions(limits: tuple[float, float]) -> str:
    return f"Rotor speeds from {limits[0]:.2f} to {limits[1]:.2f} rad/s. Body axes."


def _empty_figure(gait: Gait, limits: tuple[float, float]) -> Figure:
    """A note in place of an empty attainable set."""
    figure = style.new_figure(5.0, 1.2)
    axes: Any = figure.subplots()
    axes.set_axis_off()
    axes.set_title(f"Torque and thrust at zero yaw torque, {gait.name}")
    reason = "Empty set: no rotor speeds within the limits give zero yaw torque."
    axes.text(0.0, 0.6, reason, transform=axes.transAxes)
    axes.text(0.0, 0.1, _conditions(limits), transform=axes.transAxes, fontsize=8)
    return figure


def _outline(space: Any, found: AttainableSet) -> None:
    """The faces of the polytope, transparent."""
    from scipy.spatial import ConvexHull

    if found.dimension < 3:
        return
    scaled = found.vertices / np.maximum(np.abs(found.vertices).max(axis=0), 1e-300)
    for simplex in ConvexHull(scaled).simplices:
        space.plot_trisurf(
            *found.vertices[simplex].T, triangles=[[0, 1, 2]], color=style.SKY, alpha=0.10
        )


def _slice(space: Any, found: AttainableSet) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    if found.is_empty:
        return
    if found.dimension == 2:
        polygon = Poly3DCollection([found.vertices], alpha=0.45)
        polygon.set_facecolor(style.BLUE)
        polygon.set_edgecolor(style.INK)
        polygon.set_linewidth(0.6)
        space.add_collection3d(polygon)
    else:
        space.plot(*found.vertices.T, color=style.BLUE, lw=2.2)


def _accelerations(plane: Any, found: AttainableSet) -> None:
    if not found.is_empty:
        style.zero_lines(plane)
    if found.is_empty:
        plane.set_axis_off()
        plane.text(0.5, 0.5, "none", transform=plane.transAxes, ha="center")
    elif found.dimension == 2:
        plane.fill(*found.vertices.T, facecolor=style.PALE, edgecolor=style.BLUE, lw=1.4)
    else:
        plane.plot(*found.vertices.T, color=style.BLUE, lw=2.2, marker="o", ms=4)
    plane.set_aspect("equal", adjustable="datalim")
    plane.locator_params(nbins=6)
    plane.set(xlabel="$F_X / m$ (m/s²)", ylabel="$F_Y / m$ (m/s²)")
    plane.margins(0.12)
