"""Determinants: of the tiltrotor at level attitude (ch. 3), of the quadrotor (ch. 2)."""

from math import pi
from typing import Any, Final

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from tiltsim.views.figures import style
from tiltsim_controllers.analysis.published_gaits import DETERMINANT_CASES, TRIANGLE
from tiltsim_controllers.analysis.quadrotor_singularity import (
    normalized_determinant,
    published_determinant,
    published_singular_curve,
)
from tiltsim_controllers.analysis.singularity import residuals
from tiltsim_controllers.laws.switching import PUBLISHED_ZONE
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import Vehicle

_SIDE: Final = np.linspace(-2.0, 2.0, 121)  # rad
_TICKS: Final = (-2, -1, 0, 1, 2)

_LIMIT: Final = 0.45 * pi  # largest angle (rad); the exact surface is unbounded toward 90 degrees


@style.paper_style()
def determinant_figure(case: str, vehicle: Vehicle) -> Figure:
    """The five surfaces ``R(alpha_2, alpha_4)`` of a case, their zero curves, and sections.

    The surfaces nearly coincide, so that each has separate axes. ``case`` is a key of
    `DETERMINANT_CASES`; the sections are along the directions of ch. 3, Eqs. (23)-(25).
    """

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
