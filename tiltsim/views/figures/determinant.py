"""Surfaces and zero curves of the determinant at level attitude (ch. 3, Figs. 2-13)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.views.figures import style
from tiltsim_controllers.analysis.published_gaits import DETERMINANT_CASES, TRIANGLE
from tiltsim_controllers.analysis.singularity import residuals

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim_controllers.mathematics.scalar import Floats
    from tiltsim_controllers.vehicle.parameters import Vehicle

_LIMIT: Final = 2.0  # rad
_SAMPLES: Final = 121  # per axis
_TICKS: Final = (-2, -1, 0, 1, 2)


def _grid(alpha_1: float, alpha_3: float, vehicle: Vehicle) -> tuple[Floats, Floats, Floats]:
    """``alpha_2``, ``alpha_4`` (rad) and ``R``, each of shape (samples, samples)."""
    side = np.linspace(-_LIMIT, _LIMIT, _SAMPLES)
    alpha_2, alpha_4 = np.meshgrid(side, side)
    angles = np.stack(
        [np.full_like(alpha_2, alpha_1), alpha_2, np.full_like(alpha_2, alpha_3), alpha_4], axis=-1
    )
    return alpha_2, alpha_4, residuals(angles, vehicle).R


def determinant_figure(case: str, vehicle: Vehicle) -> Figure:
    """The five surfaces ``R(alpha_2, alpha_4)`` of a case, their zero curves, and sections.

    The surfaces nearly coincide, so that each has axes of its own. ``case`` is a key of
    `DETERMINANT_CASES`; the sections are along the directions of ch. 3, Eqs. (23)-(25).
    """
    from matplotlib import colormaps

    restriction, pairs = DETERMINANT_CASES[case]
    shades = colormaps[style.SEQUENTIAL](np.linspace(0.0, 0.9, len(pairs)))
    looks = ["-", (0, (6, 2)), "-", (0, (3, 1.5)), (0, (1, 1))]
    grids = [_grid(*pair, vehicle) for pair in pairs]
    largest = max(float(np.abs(R).max()) for _, _, R in grids)
    with style.paper_style():
        figure = style.new_figure(9.2, 5.6)
        parts: Any = figure.subfigures(2, 1, height_ratios=[1.0, 1.45])
        upper, lower = parts
        upper.suptitle(
            f"Determinant R at level attitude, {restriction}", x=0.012, ha="left", fontsize=10
        )
        for place, (pair, cells) in enumerate(zip(pairs, grids, strict=True), start=1):
            surface: Any = upper.add_subplot(1, len(pairs), place, projection="3d")
            _surface(surface, cells, largest)
            surface.set_title(_label(pair[0]), y=0.93, loc="center")
        plane, falling, rising = lower.subplots(1, 3, width_ratios=[1.25, 1.0, 1.0])
        for pair, cells, shade, look in zip(pairs, grids, shades, looks, strict=True):
            plane.contour(*cells, [0.0], colors=[shade], linestyles=[look], linewidths=[1.6])
            for axes, start, slope in ((falling, -1.5, -1.0), (rising, 0.0, 1.0)):
                alpha_2 = np.linspace(start, 1.5 if slope < 0.0 else 1.0, 121)
                rest = [np.full_like(alpha_2, angle) for angle in pair]
                angles = np.stack([rest[0], alpha_2, rest[1], slope * alpha_2], axis=-1)
                R = residuals(angles, vehicle).R
                axes.plot(alpha_2, R, color=shade, ls=look, lw=1.6, label=_label(pair[0]))
        _region_of_interest(plane)
        for axes, title in ((falling, "R along α₄ = −α₂"), (rising, "R along α₄ = α₂")):
            axes.axhline(0.0, color=style.INK, lw=0.8)
            axes.set(xlabel="α₂ (rad)", ylabel="R", title=title)
            axes.margins(x=0.0)
        handles, labels = falling.get_legend_handles_labels()
        # Opposite values of alpha_1 may give equal curves: short dashes over long ones show both.
        lower.legend(handles, labels, loc="outside lower center", ncols=len(pairs))
        return figure


def _surface(surface: Any, cells: Any, largest: float) -> None:
    alpha_2, alpha_4, R = cells
    surface.plot_surface(
        alpha_2,
        alpha_4,
        R,
        cmap=style.SEQUENTIAL,
        vmin=-largest,
        vmax=largest,
        rcount=60,
        ccount=60,
        lw=0.0,
        antialiased=False,
    )
    # Below the surface, where it is visible.
    foot = -1.15 * largest
    surface.contour(
        alpha_2, alpha_4, R, [0.0], zdir="z", offset=foot, colors=[style.INK], linewidths=[1.0]
    )
    surface.set(xticks=[-2, 0, 2], yticks=[-2, 0, 2], zticks=[-5, 0, 5], zlim=(foot, largest))
    surface.set_xlabel("α₂", labelpad=-8)
    surface.set_ylabel("α₄", labelpad=-8)
    surface.tick_params(pad=-3, labelsize=7)
    surface.view_init(elev=32, azim=-115)
    surface.set_box_aspect((1.0, 1.0, 0.8), zoom=1.0)


def _region_of_interest(plane: Any) -> None:
    corners = np.array([*TRIANGLE, TRIANGLE[0]])
    plane.fill(*corners.T, color=style.PALE, zorder=0)
    plane.plot(*corners.T, color=style.GREEN, lw=1.2)
    for name, corner, shift in zip("UVM", TRIANGLE, [(-12, 2), (4, -10), (5, 3)], strict=True):
        plane.annotate(name, corner, shift, textcoords="offset points", color=style.GREEN)
    plane.set(xlabel="α₂ (rad)", ylabel="α₄ (rad)", xlim=(-2, 2), ylim=(-2, 2), aspect="equal")
    plane.set(xticks=_TICKS, yticks=_TICKS)
    plane.set_title("R = 0, and the region of interest U V M")


def _label(alpha_1: float) -> str:
    return f"α₁ = {alpha_1:g}".replace("-", "−")
