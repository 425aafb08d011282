"""The Two Color Map in the alpha_1-alpha_2 plane (ch. 6 to 8, 12)."""

from math import pi
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from tiltsim.views.figures import style
from tiltsim.views.figures.layout import add_legend
from tiltsim_controllers.analysis.two_color_map import curve_l, delta, point_p, red_residual
from tiltsim_controllers.analysis.two_color_planner import Circle, Path, check_path
from tiltsim_controllers.vehicle.parameters import Vehicle

NEARLY: Final = 0.5
"""Absolute R, 4 for a level untilted vehicle, below which red counts as nearly singular."""

_COLORS: Final = {"red": "#C4001A", "blue": style.BLUE}
"""The colors in the name of the map: this red is not the color of singular attitudes."""

_SIDES: Final = (
    ((1.0, 1.0), "left", "bottom"),
    ((-1.0, -1.0), "right", "top"),
    ((-1.0, 1.0), "right", "bottom"),
    ((1.0, -1.0), "left", "top"),
)
"""Directions in which labels of paths lie, with their alignment."""

_DASHES: Final[dict[str, Any]] = {"red": "-", "blue": (0, (4, 2))}


@style.paper_style()
def map_figure(vehicle: Vehicle, paths: list[tuple[str, Path]] | None = None) -> Figure:
    """Regions S_U and S_D of red, the curve L, the point P, and paths given with their labels."""
    figure = style.new_figure(5.4, 6.3)
    axes: Any = figure.subplots()
    axes.grid(False)
    limit = pi / 2
    side = np.linspace(-limit, limit, 401)
    alpha_1, alpha_2 = np.meshgrid(side, side)
    residual = np.abs(red_residual(alpha_1, alpha_2, vehicle))
    axes.contourf(alpha_1, alpha_2, residual, [0.0, NEARLY], colors=[style.UNREACHABLE])
    inside = np.linspace(-limit, limit, 801)[1:-1]
    axes.plot(inside, curve_l(inside, vehicle), color=style.SINGULAR, lw=1.8)
    square_x, square_y = [-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1]
    axes.plot(square_x, square_y, color=style.GREY, lw=0.8, ls=(0, (5, 3)))
    # The other zeros of R, close to pi/2.
    angle = delta(vehicle)
    for line, value in ((axes.axvline, angle - limit), (axes.axhline, limit - angle)):
        line(value, color=style.SINGULAR, lw=1.8)
    first, second = point_p(vehicle)
    axes.plot(first, second, "o", color="white", mec=style.INK, mew=1.2, ms=7, zorder=7)
    axes.text(-0.75, 1.2, "$S_U$:  R > 0", size="large")
    axes.text(0.55, -1.3, "$S_D$:  R < 0", size="large")
    shown: set[str] = set()
    for number, (label, path) in enumerate(paths or []):
        shown |= _draw_path(axes, label, path, vehicle, number)
    _legend(figure, f"P = (δ, −δ), δ = {first:.4f} rad", shown)
    style.angle_axis(axes, "x", limit)
    style.angle_axis(axes, "y", limit)
    title = "Two Color Map of red gaits"
    axes.set(xlabel="α₁ (rad)", ylabel="α₂ (rad)", aspect="equal", title=title)
    return figure


def _draw_path(axes: Axes, label: str, path: Path, vehicle: Vehicle, number: int) -> set[str]:
    """Draw a path; returns its colors, and "crossing" if it crosses the curve L.

    The ``number`` of the path decides the side of its label.
    """
    for color, points in _outlines(path):
        axes.plot(*points.T, color=_COLORS[color], ls=_DASHES[color], lw=1.8)
        # An arrow at the first third shows the direction.
        start = max(1, len(points) // 3)
        head = {"arrowstyle": "-|>", "color": _COLORS[color], "lw": 1.4}
        middle = 0.5 * (points[start] + points[start - 1])
        axes.annotate("", xy=middle, xytext=points[start - 1], arrowprops=head)
    check = check_path(path, vehicle)
    outline = np.concatenate([points[:-1] for _, points in _outlines(path)])
    (x, y), ha, va = _SIDES[number % len(_SIDES)]
    corner = outline[np.argmax(outline @ [x, y])]
    mark = "" if check.accepted else ", rejected"
    text = axes.annotate(label + mark, corner, (5 * x, 5 * y), textcoords="offset points")
    text.set(ha=ha, va=va, size="small", zorder=8)
    for crossing in check.crossings:
        axes.plot(*crossing, "x", color=style.INK, ms=8, mew=1.8, zorder=6)
    shown = {color for color, _ in _outlines(path)}
    return shown | ({"crossing"} if check.crossings else set())


def _legend(figure: Figure, label_of_p: str, shown: set[str]) -> None:
    dashed = (0, (5, 3))
    handles = [
        Line2D([], [], color=style.SINGULAR, lw=1.8, label="singular: R = 0, the curve L"),
        Patch(facecolor=style.UNREACHABLE, label=f"nearly singular: |R| < {NEARLY:g}"),
        Line2D([], [], color="white", marker="o", mec=style.INK, ls="", label=label_of_p),
        Line2D([], [], color=style.GREY, lw=0.8, ls=dashed, label="|α₁|, |α₂| ≤ 1 (ch. 8)"),
    ]
    texts = {"red": "red path", "blue": "blue path: singular at every attitude"}
    marks = {
        name: Line2D([], [], color=_COLORS[name], lw=1.8, ls=_DASHES[name], label=text)
        for name, text in texts.items()
    }
    cross = "red crosses L: singular"
    marks["crossing"] = Line2D([], [], color=style.INK, marker="x", mew=1.8, ls="", label=cross)
    handles += [mark for name, mark in marks.items() if name in shown]
    add_legend(figure, handles, columns=2)


def _outlines(path: Path) -> list[tuple[str, Any]]:
    if isinstance(path, Circle):
        turn = np.linspace(0.0, 2.0 * pi, 121)
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        return [(path.color, np.array(path.centre) + path.radius * circle)]
    return [(leg.color, np.array(leg.vertices)) for leg in path.legs]
