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

_SIDE: Final = np.linspace(-2.0, 2.0, 121)  # rad
_TICKS: Final = (-2, -1, 0, 1, 2)


@style.paper_style()
def determinant_figure(case: str, vehicle: Vehicle) -> Figure:
    """The five surfaces ``R(alpha_2, alpha_4)`` of a case, their zero curves, and sections.

    The surfaces nearly coincide, so that each has separate axes. ``case`` is a key of
    `DETERMINANT_CASES`; the sections are along the directions of ch. 3, Eqs. (23)-(25).
    """
    from matplotlib import colormaps

    def determinant(pair: tuple[float, float], alpha_2: Floats, alpha_4: Floats) -> Floats:
        first, third = (np.full_like(alpha_2, angle) for angle in pair)
        return residuals(np.stack([first, alpha_2, third, alpha_4], axis=-1), vehicle).R

    restriction, pairs = DETERMINANT_CASES[case]
    shades = colormaps[style.SEQUENTIAL](np.linspace(0.0, 0.9, len(pairs)))
    looks = ["-", (0, (6, 2)), "-", (0, (3, 1.5)), (0, (1, 1))]
    grid = np.meshgrid(_SIDE, _SIDE)
    values = [determinant(pair, *grid) for pair in pairs]
    largest = float(np.abs(values).max())
    figure = style.new_figure(9.2, 5.6)
    parts: Any = figure.subfigures(2, 1, height_ratios=[1.0, 1.45])
    upper, lower = parts
    title = f"Determinant R at level attitude, {restriction}"
    upper.suptitle(title, x=0.012, ha="left", size="medium")
    plane, *sections = lower.subplots(1, 3, width_ratios=[1.25, 1.0, 1.0])
    slopes = ((-1.0, -1.5, 1.5, "−α₂"), (1.0, 0.0, 1.0, "α₂"))  # with start and end, rad
    for place, (pair, R, shade, look) in enumerate(zip(pairs, values, shades, looks, strict=True)):
        label = f"α₁ = {pair[0]:g}".replace("-", "−")
        surface: Any = upper.add_subplot(1, len(pairs), place + 1, projection="3d")
        _surface(surface, [*grid, R], largest)
        surface.set_title(label, y=0.93, loc="center")
        plane.contour(*grid, R, [0.0], colors=[shade], linestyles=[look], linewidths=[1.6])
        for axes, (slope, start, end, _) in zip(sections, slopes, strict=True):
            alpha_2 = np.linspace(start, end, 121)
            section = determinant(pair, alpha_2, slope * alpha_2)
            axes.plot(alpha_2, section, color=shade, ls=look, lw=1.6, label=label)
    corners = np.array([*TRIANGLE, TRIANGLE[0]])
    plane.fill(*corners.T, color=style.PALE, zorder=0)
    plane.plot(*corners.T, color=style.GREEN, lw=1.2)
    for name, corner, shift in zip("UVM", TRIANGLE, [(-12, 2), (4, -10), (5, 3)], strict=True):
        plane.annotate(name, corner, shift, textcoords="offset points", color=style.GREEN)
    plane.set(xlabel="α₂ (rad)", ylabel="α₄ (rad)", xlim=(-2, 2), ylim=(-2, 2), aspect="equal")
    plane.set(xticks=_TICKS, yticks=_TICKS, title="R = 0, and the region of interest U V M")
    for axes, (*_, name) in zip(sections, slopes, strict=True):
        axes.axhline(0.0, color=style.INK, lw=0.8)
        axes.set(xlabel="α₂ (rad)", ylabel="R", title=f"R along α₄ = {name}")
        axes.margins(x=0.0)
    handles, labels = sections[0].get_legend_handles_labels()
    # Opposite values of alpha_1 may give equal curves: short dashes over long ones show both.
    lower.legend(handles, labels, loc="outside lower center", ncols=len(pairs))
    return figure


def _surface(surface: Any, cells: Any, largest: float) -> None:
    look: dict[str, Any] = {"cmap": style.SEQUENTIAL, "vmin": -largest, "vmax": largest}
    surface.plot_surface(*cells, **look, rcount=60, ccount=60, lw=0.0, antialiased=False)
    foot = -1.15 * largest  # below the surface, where the curve is visible
    look = {"zdir": "z", "offset": foot, "colors": [style.INK], "linewidths": [1.0]}
    surface.contour(*cells, [0.0], **look)
    surface.set(xticks=[-2, 0, 2], yticks=[-2, 0, 2], zticks=[-5, 0, 5], zlim=(foot, largest))
    surface.set_xlabel("α₂", labelpad=-8)
    surface.set_ylabel("α₄", labelpad=-8)
    surface.tick_params(pad=-3, labelsize=7)
    surface.view_init(elev=32, azim=-115)
    surface.set_box_aspect((1.0, 1.0, 0.8), zoom=1.0)
