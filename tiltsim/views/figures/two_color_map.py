"""The Two Color Map in the alpha_1-alpha_2 plane (ch. 6 to 8, 12)."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.views.figures import style
from tiltsim_controllers.analysis.two_color_map import curve_l, delta, point_p, red_residual
from tiltsim_controllers.analysis.two_color_planner import Circle, check_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tiltsim_controllers.analysis.two_color_planner import Path
    from tiltsim_controllers.vehicle.parameters import Vehicle


BELOW: Final = "#F8F8F8"
"""Where R < 0 on red."""


def map_figure(vehicle: Vehicle, paths: list[tuple[str, Path]] | None = None) -> Figure:
    """Regions S_U and S_D of red, the curve L, the point P, and paths given with their labels."""
    with style.paper_style():
        figure = style.new_figure(5.4, 6.5)
        axes: Any = figure.subplots()
        axes.grid(False)
        limit = pi / 2
        side = np.linspace(-limit, limit, 401)
        alpha_1, alpha_2 = np.meshgrid(side, side)
        residual = red_residual(alpha_1, alpha_2, vehicle)
        axes.contourf(
            alpha_1, alpha_2, residual, [-np.inf, 0.0, np.inf], colors=[BELOW, style.PALE]
        )
        inside = np.linspace(-limit, limit, 801)[1:-1]
        axes.plot(inside, curve_l(inside, vehicle), color=style.INK, lw=1.6)
        square_x, square_y = [-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1]
        axes.plot(square_x, square_y, color=style.GREY, lw=0.8, ls=(0, (5, 3)))
        # The other zeros of R, close to pi/2.
        angle = delta(vehicle)
        axes.axvline(angle - limit, color=style.INK, lw=0.6, ls=":")
        axes.axhline(limit - angle, color=style.INK, lw=0.6, ls=":")
        first, second = point_p(vehicle)
        axes.plot(first, second, "o", color=style.AMBER, mec=style.INK, mew=0.8, ms=7, zorder=7)
        axes.text(-1.3, 1.2, "$S_U$:  R > 0", fontsize=10)
        axes.text(0.75, -1.3, "$S_D$:  R < 0", fontsize=10)
        shown: set[str] = set()
        for label, path in paths or []:
            shown |= _draw_path(axes, label, path, vehicle)
        _legend(figure, f"P = (δ, −δ), δ = {first:.4f} rad", shown)
        style.angle_axis(axes, "x", limit)
        style.angle_axis(axes, "y", limit)
        axes.set_aspect("equal")
        axes.set_xlabel("α₁ (rad)")
        axes.set_ylabel("α₂ (rad)")
        axes.set_title("Two Color Map: sign of R on red; blue is singular at every attitude")
        return figure


def _draw_path(axes: Axes, label: str, path: Path, vehicle: Vehicle) -> set[str]:
    """Draw a path; returns its colours, and "crossing" if it crosses the curve L."""
    colors = {"red": style.RED, "blue": style.BLUE}
    looks = {"red": "-", "blue": (0, (4, 2))}
    for color, points in _outlines(path):
        axes.plot(*points.T, color=colors[color], ls=looks[color], lw=1.8)
        # An arrow at the first third shows the direction.
        start = max(1, len(points) // 3)
        axes.annotate(
            "",
            xy=tuple(0.5 * (points[start] + points[start - 1])),
            xytext=tuple(points[start - 1]),
            arrowprops={"arrowstyle": "-|>", "color": colors[color], "lw": 1.4},
        )
    check = check_path(path, vehicle)
    outline = np.concatenate([points[:-1] for _, points in _outlines(path)])
    corner = outline[np.argmax(outline @ [1.0, 1.0])]
    mark = "" if check.accepted else ", refused"
    axes.annotate(label + mark, corner, (4, 3), textcoords="offset points", ha="left", fontsize=8.5)
    for crossing in check.crossings:
        axes.plot(*crossing, "x", color=style.INK, ms=8, mew=1.8, zorder=6)
    shown = {color for color, _ in _outlines(path)}
    return shown | ({"crossing"} if check.crossings else set())


def _legend(figure: Figure, label_of_p: str, shown: set[str]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    dashed = (0, (5, 3))
    handles = [
        Patch(facecolor=style.PALE, edgecolor=style.GREY, lw=0.4, label="$S_U$: R > 0 on red"),
        Patch(facecolor=BELOW, edgecolor=style.GREY, lw=0.4, label="$S_D$: R < 0 on red"),
        Line2D([], [], color=style.INK, lw=1.6, label="L, R = 0: tan α₂ = tan α₁ − 2 tan δ"),
        Line2D([], [], color=style.INK, lw=0.6, ls=":", label="R = 0 as well"),
        Line2D([], [], color=style.AMBER, marker="o", mec=style.INK, ls="", label=label_of_p),
        Line2D([], [], color=style.GREY, lw=0.8, ls=dashed, label="|α₁|, |α₂| ≤ 1 (ch. 8)"),
    ]
    cross = "red crosses L: singular"
    marks = {
        "red": Line2D([], [], color=style.RED, lw=1.8, label="red path"),
        "blue": Line2D(
            [], [], color=style.BLUE, lw=1.8, ls=(0, (4, 2)), label="blue path: singular"
        ),
        "crossing": Line2D([], [], color=style.INK, marker="x", mew=1.8, ls="", label=cross),
    }
    handles += [mark for name, mark in marks.items() if name in shown]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)


def _outlines(path: Path) -> list[tuple[str, Any]]:
    if isinstance(path, Circle):
        turn = np.linspace(0.0, 2.0 * pi, 121)
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        return [(path.color, np.array(path.centre) + path.radius * circle)]
    return [(leg.color, np.array(leg.vertices)) for leg in path.legs]
