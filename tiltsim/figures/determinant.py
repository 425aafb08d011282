"""Surfaces and zero curves of the determinant at level attitude (ch. 3, Figs. 2-13)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from controllers.singularity import residuals
from tiltsim.figures import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from controllers.vehicle import Vehicle

CASES: Final = {
    "equal": ("α₁ = α₃", tuple((a, a) for a in (-0.15, -0.075, 0.0, 0.075, 0.15))),
    "half": ("α₁ = α₃/2", tuple((a, 2 * a) for a in (-0.2, -0.1, 0.0, 0.1, 0.2))),
    "negative": ("α₁ = −α₃", tuple((a, -a) for a in (-1.4, -0.7, 0.0, 0.7, 1.4))),
    "negative_half": ("α₁ = −α₃/2", tuple((a, -2 * a) for a in (-0.3, -0.15, 0.0, 0.15, 0.3))),
}
"""Restrictions of ch. 3, Sec. 5.1: title and the five pairs ``(alpha_1, alpha_3)`` (rad)."""

TRIANGLE: Final = ((-1.5, 1.5), (1.5, -1.5), (1.0, 1.0))
"""U, V, M of ch. 3, Eq. (22): the region of interest in ``(alpha_2, alpha_4)`` (rad)."""

_TICKS: Final = (-2, -1, 0, 1, 2)


def determinant_grid(
    alpha_1: float, alpha_3: float, vehicle: Vehicle, samples: int = 121, limit: float = 2.0
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """``alpha_2``, ``alpha_4`` (rad) and ``R``, each of shape (samples, samples)."""
    side = np.linspace(-limit, limit, samples)
    alpha_2, alpha_4 = np.meshgrid(side, side)
    angles = np.stack(
        [np.full_like(alpha_2, alpha_1), alpha_2, np.full_like(alpha_2, alpha_3), alpha_4], axis=-1
    )
    return alpha_2, alpha_4, residuals(angles, vehicle).R


def determinant_figure(case: str, vehicle: Vehicle) -> Figure:
    """The five surfaces ``R(alpha_2, alpha_4)`` of a case and their zero curves, side by side."""
    from matplotlib import colormaps
    from matplotlib.lines import Line2D

    title, pairs = CASES[case]
    shades = colormaps[style.SEQUENTIAL](np.linspace(0.0, 0.9, len(pairs)))
    looks = ["-", (0, (6, 2)), "-", (0, (3, 1.5)), (0, (1, 1))]
    with style.paper_style():
        figure = style.new_figure(9.2, 4.2)
        grid = figure.add_gridspec(1, 2, width_ratios=[1.15, 1.0])
        surface: Any = figure.add_subplot(grid[0], projection="3d")
        plane: Any = figure.add_subplot(grid[1])
        handles = []
        for (alpha_1, alpha_3), shade, look in zip(pairs, shades, looks, strict=True):
            alpha_2, alpha_4, R = determinant_grid(alpha_1, alpha_3, vehicle)
            surface.plot_surface(
                *(alpha_2, alpha_4, R), color=shade, alpha=0.4, rstride=6, cstride=6, lw=0.2
            )
            plane.contour(alpha_2, alpha_4, R, [0.0], colors=[shade], linestyles=[look])
            handles.append(
                Line2D([], [], color=shade, ls=look, label=f"α₁ = {alpha_1:g}".replace("-", "−"))
            )
        surface.plot_surface(
            *np.meshgrid([-2.0, 2.0], [-2.0, 2.0]), np.zeros((2, 2)), color=style.GREY, alpha=0.2
        )
        surface.set(xlabel="α₂ (rad)", ylabel="α₄ (rad)", zlabel="R", xticks=_TICKS, yticks=_TICKS)
        surface.view_init(elev=22, azim=-128)
        surface.set_box_aspect((1.0, 1.0, 0.75), zoom=0.88)
        surface.set_title(f"Determinant at level attitude, {title}", y=0.98)
        corners = np.array([*TRIANGLE, TRIANGLE[0]])
        plane.fill(*corners.T, color=style.PALE, zorder=0)
        plane.plot(*corners.T, color=style.GREEN, lw=1.2)
        for name, corner, shift in zip("UVM", TRIANGLE, [(-12, 2), (4, -10), (5, 3)], strict=True):
            plane.annotate(name, corner, shift, textcoords="offset points", color=style.GREEN)
        plane.set(xlabel="α₂ (rad)", ylabel="α₄ (rad)", xlim=(-2, 2), ylim=(-2, 2), aspect="equal")
        plane.set_title("R = 0, and the region of interest")
        plane.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return figure
