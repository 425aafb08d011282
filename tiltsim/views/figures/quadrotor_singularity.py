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
    from numpy.typing import NDArray

    from tiltsim_controllers.vehicle.parameters import Vehicle

_REACH: Final = 0.45 * pi
"""How far (rad) the surfaces are drawn: the exact one grows without bound towards 90 degrees."""


def surfaces(
    vehicle: Vehicle, samples: int = 121, limit: float = _REACH
) -> tuple[NDArray[np.float64], ...]:
    """Roll and pitch (rad), published and exact determinant, each of shape (samples, samples).

    The exact one is that in hover, over its value at level attitude.
    """
    side = np.linspace(-limit, limit, samples)
    roll, pitch = np.meshgrid(side, side)
    exact = normalized_determinant(roll, pitch, vehicle.mass * vehicle.gravity, vehicle)
    return roll, pitch, published_determinant(roll, pitch), exact


def singularity_figure(vehicle: Vehicle) -> Figure:
    """Surfaces and contours of both determinants, the published curve and the switching zone."""
    roll, pitch, published, exact = surfaces(vehicle)
    claims = (
        ("Published, S(θ, φ)", published, np.arange(-1.2, 0.21, 0.1)),
        ("Exact, level hover = 1", exact, np.arange(0.0, 3.01, 0.25)),
    )
    with style.paper_style():
        figure = style.new_figure(9.6, 6.2)
        grid = figure.add_gridspec(2, 3, width_ratios=[1.1, 1.0, 1.0])
        for row, (title, values, levels) in enumerate(claims):
            surface: Any = figure.add_subplot(grid[row, 0], projection="3d")
            surface.plot_surface(
                *(roll, pitch, np.minimum(values, levels[-1])),
                **{"cmap": style.SEQUENTIAL, "rstride": 4, "cstride": 4, "lw": 0.2},
            )
            surface.view_init(elev=24, azim=-125)
            surface.set_box_aspect((1.0, 1.0, 0.75), zoom=0.85)
            surface.set(xlabel="roll φ (rad)", ylabel="pitch θ (rad)", title=title)
            contour: Any = figure.add_subplot(grid[row, 1])
            shades = contour.contourf(
                *(roll, pitch, values, levels), cmap=style.SEQUENTIAL, extend="both"
            )
            figure.colorbar(shades, ax=contour, shrink=0.85)
            contour.set_title(title)
            _attitude_axes(contour)
        curve = published_singular_curve()
        claimed: Any = figure.add_subplot(grid[0, 2])
        claimed.plot(*curve, color=style.RED)
        claimed.plot(0.0, 0.0, "o", ms=3.5, color=style.INK)
        claimed.annotate("level", (0.0, 0.0), (5, 3), textcoords="offset points")
        claimed.set_title("Published singular curve, S = 0")
        _attitude_axes(claimed)
        _draw_zone(figure.add_subplot(grid[1, 2]), curve)
        figure.legend(
            *figure.axes[-1].get_legend_handles_labels(), loc="outside lower center", ncols=4
        )
    return figure


def _draw_zone(axes: Any, curve: tuple[NDArray[np.float64], NDArray[np.float64]]) -> None:
    """Eq. (47)'s zone, which hides the curve; the exact determinant vanishes on the frame alone."""
    zone = PUBLISHED_ZONE
    axes.axvspan(-pi / 2, pi / 2, color=style.PALE, label="yaw-position law")
    axes.fill(
        [zone.roll_min, zone.roll_max, zone.roll_max, zone.roll_min],
        [zone.pitch_min, zone.pitch_min, zone.pitch_max, zone.pitch_max],
        **{"color": style.AMBER, "alpha": 0.55, "lw": 0.0, "label": "attitude-altitude law"},
    )
    axes.plot(*curve, color=style.RED, label="published singular curve")
    axes.plot(
        [-pi / 2, pi / 2, pi / 2, -pi / 2, -pi / 2],
        [-pi / 2, -pi / 2, pi / 2, pi / 2, -pi / 2],
        **{"color": style.BLUE, "lw": 2.0, "label": "exact determinant 0 or unbounded"},
    )
    axes.set_title("Published switching zone")
    _attitude_axes(axes)


def _attitude_axes(axes: Any) -> None:
    style.angle_axis(axes, "x", pi / 2)
    style.angle_axis(axes, "y", pi / 2)
    axes.set(xlabel="roll φ (rad)", ylabel="pitch θ (rad)", aspect="equal")
