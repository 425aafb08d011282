"""The quadrotor's determinant, published and exact, over roll and pitch (ch. 2, Figs. 1-5)."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.views.figures import style
from tiltsim_controllers.analysis.quadrotor_singularity import (
    normalized_determinant,
    published_determinant,
    published_singular_curve,
)
from tiltsim_controllers.laws.switching import PUBLISHED_ZONE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim_controllers.mathematics.scalar import Floats
    from tiltsim_controllers.vehicle.parameters import Vehicle

_LIMIT: Final = 0.45 * pi  # largest angle (rad); the exact surface is unbounded toward 90 degrees


def surfaces(vehicle: Vehicle, samples: int = 121) -> tuple[Floats, ...]:
    """Roll and pitch (rad), published and exact determinant, each of shape (samples, samples).

    The exact one is that in hover relative to its value at level attitude.
    """
    side = np.linspace(-_LIMIT, _LIMIT, samples)
    roll, pitch = np.meshgrid(side, side)
    exact = normalized_determinant(roll, pitch, vehicle.mass * vehicle.gravity, vehicle)
    return roll, pitch, published_determinant(roll, pitch), exact


@style.paper_style()
def singularity_figure(vehicle: Vehicle) -> Figure:
    """Surfaces and contours of both determinants, the published curve and the switching zone."""
    roll, pitch, published, exact = surfaces(vehicle)
    determinants = (
        ("Published, S(θ, φ)", published, np.arange(-1.2, 0.21, 0.1)),
        ("Exact, level hover = 1", exact, np.arange(0.0, 3.01, 0.25)),
    )
    figure = style.new_figure(9.6, 6.2)
    grid = figure.add_gridspec(2, 3, width_ratios=[1.1, 1.0, 1.0])
    for row, (title, values, levels) in enumerate(determinants):
        surface: Any = figure.add_subplot(grid[row, 0], projection="3d")
        look: dict[str, Any] = {"cmap": style.SEQUENTIAL, "rstride": 4, "cstride": 4, "lw": 0.2}
        surface.plot_surface(roll, pitch, np.minimum(values, levels[-1]), **look)
        surface.view_init(elev=24, azim=-125)
        surface.set_box_aspect((1.0, 1.0, 0.75), zoom=0.85)
        surface.set(xlabel="roll φ (rad)", ylabel="pitch θ (rad)", title=title)
        contour: Any = figure.add_subplot(grid[row, 1])
        look = {"cmap": style.SEQUENTIAL, "extend": "both"}
        shades = contour.contourf(roll, pitch, values, levels, **look)
        figure.colorbar(shades, ax=contour, shrink=0.85)
        contour.set_title(title)
        style.roll_pitch_axes(contour)
    curve = published_singular_curve()
    alone: Any = figure.add_subplot(grid[0, 2])
    alone.plot(*curve, color=style.RED)
    alone.plot(0.0, 0.0, "o", ms=3.5, color=style.INK)
    alone.annotate("level", (0.0, 0.0), (5, 3), textcoords="offset points")
    alone.set_title("Published singular curve, S = 0")
    style.roll_pitch_axes(alone)
    axes, box, limit = figure.add_subplot(grid[1, 2]), PUBLISHED_ZONE, pi / 2
    axes.axvspan(-limit, limit, color=style.PALE, label="yaw-position control")
    (left, right), (low, high) = box.roll, box.pitch
    outline = [left, right, right, left], [low, low, high, high]
    zone: dict[str, Any] = {"color": style.AMBER, "alpha": 0.55, "lw": 0.0}
    axes.fill(*outline, **zone, label="attitude-altitude control")
    axes.plot(*curve, color=style.RED, label="published singular curve")
    border = np.array([-limit, limit, limit, -limit, -limit])
    text = "exact determinant 0 or unbounded"
    axes.plot(border, np.roll(border, 1), color=style.BLUE, lw=2.0, label=text)
    axes.set_title("Published switching zone")
    style.roll_pitch_axes(axes)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure
