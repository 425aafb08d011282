"""Figures of gaits: roll-pitch diagrams, angles, margins, rotor losses, the Two Color Map."""

from collections.abc import Sequence
from math import atan, pi
from typing import Any, Final

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from tiltsim.errors import InputError
from tiltsim.scenario.messages import choose
from tiltsim.studies.gait_analysis import NEARLY_SINGULAR
from tiltsim.views.attitude_plane import MIN_DIRECTION_TILT
from tiltsim.views.figures import style
from tiltsim.views.figures.layout import Page, add_legend, new_page, place_legends
from tiltsim_controllers.analysis import singularity
from tiltsim_controllers.analysis.fault_tolerance import minimum_hover_speed
from tiltsim_controllers.analysis.two_color_map import curve_l, delta, point_p, red_residual
from tiltsim_controllers.analysis.two_color_planner import Circle, Path, check_path
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

_CURVES: Final = 24  # instants of a period for which the curve of singular attitudes is drawn
_LAST_SHADE: Final = 0.92  # of the color map; the rest is too bright on white

AREA, CURVE = "area", "curve"  # optional contents of a roll-pitch diagram
ATTITUDES: Final = "attitude_plane"
PANELS: Final = ("tilt_angles", "margin", ATTITUDES)  # panels of the figure of a gait


@style.paper_style()
def gait_figure(gait: Gait, vehicle: Vehicle, panels: Sequence[str] = ()) -> Figure:
    """Roll-pitch diagram of a gait and, if it moves, its angles and margin over a period.

    ``panels`` are some of `PANELS`.

    Raises:
        InputError: If a panel is unknown.
    """
    for name in panels:
        if name not in PANELS:
            raise InputError(f"panels: {name!r}: {choose(name, PANELS)}")
    chosen = [*dict.fromkeys(panels)] or ([ATTITUDES] if gait.is_constant else [*PANELS])
    page = new_page([name != ATTITUDES for name in chosen])
    for name, axes in zip(chosen, page.panels, strict=True):
        if name == ATTITUDES:
            shown = _roll_pitch(axes, gait, vehicle)
            _roll_pitch_legend(page.figure, [axes], gait, shown, alone=gait.is_constant)
        elif name == "margin":
            _margin(axes, [(gait, "")], vehicle)
        else:
            times = _times(gait)
            lines = zip("₁₂₃₄", gait.angles(times).T, style.ROTOR_LINES, strict=True)
            for rotor, angle, line in lines:
                axes.plot(times, angle, label=f"α{rotor}", **line)
            axes.set(xlim=(0.0, times[-1]), ylabel="rad", title="Tilt angles")
    place_legends(page)
    for column in page.columns:
        for axes in column:
            axes.tick_params(labelbottom=axes is column[-1])
            axes.set_xlabel("time (s)" if axes is column[-1] else "")
    return page.figure


@style.paper_style()
def comparison_figure(gaits: list[tuple[str, Gait]], vehicle: Vehicle) -> Figure:
    """Roll-pitch diagrams of gaits, given with their titles (ch. 6, Figs. 21-28; ch. 8, 10-14)."""
    figure = style.new_figure(3.5 * len(gaits) + 0.8, 4.2)
    row = figure.subplots(1, len(gaits), squeeze=False, sharey=True)[0]
    shown: set[str] = set()
    for axes, (title, gait) in zip(row, gaits, strict=True):
        shown |= _roll_pitch(axes, gait, vehicle)
        axes.set_title(title.replace("_", " "))
        if axes is not row[0]:
            axes.set_ylabel("")
    _roll_pitch_legend(figure, [*row], gaits[-1][1], shown)
    return figure


@style.paper_style()
def margin_figure(gaits: list[tuple[str, Gait]], vehicle: Vehicle) -> Figure:
    """Singularity margin over a period for several gaits, given with their labels."""
    figure = style.new_figure(5.4, 3.2)
    axes = figure.subplots()
    _margin(axes, [(gait, label) for label, gait in gaits], vehicle)
    place_legends(Page(figure, [axes], [[axes]]))
    return figure


def _roll_pitch(axes: Axes, gait: Gait, vehicle: Vehicle) -> set[str]:
    """Curves of singular attitudes, and the attitudes beyond them, shaded.

    Returns which of `AREA` and `CURVE` the diagram contains.
    """
    period = gait.period or 1.0
    times = np.zeros(1) if gait.is_constant else np.arange(_CURVES) / _CURVES * period
    angles = gait.angles(times)
    edges = np.linspace(-pi / 2, pi / 2, 302)
    roll, pitch = np.meshgrid(*[0.5 * (edges[1:] + edges[:-1])] * 2)
    level = singularity.determinant(angles[0], 0.0, 0.0, vehicle)
    beyond = [
        singularity.determinant(instant, roll, pitch, vehicle) * level <= 0.0 for instant in angles
    ]
    share = np.mean(beyond, axis=0)
    curves = [singularity.unacceptable_attitudes(instant, vehicle, 721) for instant in angles]
    singular = sum(curve.kind == "everywhere" for curve in curves)
    values = singularity.singular_values(angles, vehicle)
    conditioning = float((values[:, 2] / values[:, 0]).min())
    nearly = not singular and conditioning < NEARLY_SINGULAR
    if singular or nearly:
        share = np.full_like(share, singular / len(curves) or 1.0)
    style.shade_share(axes, edges, share)
    colors = colormaps[style.SEQUENTIAL](np.arange(len(curves)) / len(curves) * _LAST_SHADE)
    n = np.nan_to_num(singularity.torque_free_direction(angles, vehicle))
    drawn = np.hypot(n[:, 0], n[:, 1]) > MIN_DIRECTION_TILT
    for curve, color, is_drawn in zip(curves, colors, drawn, strict=True):
        if is_drawn:
            line = style.SINGULAR if len(curves) == 1 else color
            axes.plot(curve.roll, curve.pitch, color=line, lw=1.3)
    note, height = "", 0.35
    if nearly:
        ratio = f"{conditioning:.0e}".replace("e-0", "e−")
        note, height = f"nearly singular at every attitude:\nσ₃/σ₁ of τ is {ratio}", 0.75
    elif singular == len(curves):
        note = "singular at every attitude"
    elif singular:
        note = f"singular at every attitude,\nat {singular} of {len(curves)} instants"
        height = 0.75
    elif not drawn.any():
        note = "no singular attitudes"
    if note:
        box = {"facecolor": "white", "edgecolor": style.GREY, "linewidth": 0.6}
        axes.text(0.0, height, note, ha="center", va="center", bbox=box, zorder=8)
    axes.plot(0.0, 0.0, "+", color=style.INK, ms=8, mew=1.2)
    style.roll_pitch_axes(axes)
    axes.set_title(f"Singular attitudes, {gait.name.replace('_', ' ')}")
    shaded = share.any() and not nearly and singular < len(curves)
    return ({CURVE} if drawn.any() else set()) | ({AREA} if shaded else set())


def _roll_pitch_legend(
    figure: Figure, diagrams: list[Axes], gait: Gait, shown: set[str], *, alone: bool = False
) -> None:
    """The legend and, of a moving gait, the time bar; ``alone`` for a single constant gait."""
    if CURVE in shown and gait.period is not None:
        mapping = ScalarMappable(Normalize(0.0, gait.period / _LAST_SHADE), style.SEQUENTIAL)
        look: dict[str, Any] = {"shrink": 0.8, "pad": 0.02, "label": "time (s)"}
        bar: Any = diagrams[0].figure.colorbar(mapping, ax=diagrams, **look)
        bar.ax.set_ylim(0.0, gait.period)
        bar.outline.set_linewidth(0.5)
    line = style.SINGULAR if alone else style.GREY
    unreachable = "unreachable" if alone else "unreachable (darker: for longer)"
    marks = {
        AREA: Patch(facecolor=style.UNREACHABLE, label=unreachable),
        CURVE: Line2D([], [], color=line, lw=1.3, label="singular"),
    }
    handles = [mark for name, mark in marks.items() if name in shown]
    handles.append(Line2D([], [], color=style.INK, marker="+", ls="", ms=8, mew=1.2, label="level"))
    add_legend(figure, handles)


def _times(gait: Gait) -> Floats:
    """Times (s) of a period, or a second of a constant gait."""
    return np.array([0.0, 1.0]) if gait.is_constant else gait.sample_times(401)


def _margin(axes: Axes, gaits: list[tuple[Gait, str]], vehicle: Vehicle) -> None:
    longest = lowest = 0.0
    for (gait, label), look in zip(gaits, ["-", "--", "-.", ":"] * len(gaits), strict=False):
        times = _times(gait)
        margin = singularity.margin_over_gait(gait.angles(times), vehicle)
        longest, lowest = max(longest, gait.period or 1.0), min(lowest, float(margin.min()))
        axes.plot(times, margin, look, label=label.replace("_", " "))
    axes.axhline(0.0, color=style.INK, lw=0.8)
    style.angle_axis(axes, "y", pi / 2)
    low = -pi / 2 * 1.05 if lowest < -0.05 else -0.12
    axes.set(xlim=(0.0, longest), ylim=(low, pi / 2 * 1.05), xlabel="time (s)", ylabel="rad")
    axes.set_title("Singularity margin")


@style.paper_style()
def fault_figure(vehicle: Vehicle) -> Figure:
    """Maximum rotor speed in hover over a servo's stuck angle and over the remaining thrust."""
    figure = style.new_figure(6.6, 2.7)
    stuck, partial = figure.subplots(1, 2, sharey=True)
    angles = np.linspace(-pi, pi, 49)
    for upright, line, place, text in (
        (False, "-", (-3.0, 395.0), "at any\nattitude"),
        (True, "--", (-1.75, 465.0), "upright"),
    ):
        speeds = [
            minimum_hover_speed(vehicle, stuck=(1, angle), upright=upright)
            for angle in angles.tolist()
        ]
        (drawn,) = stuck.plot(angles, speeds, line)
        stuck.text(*place, text, color=drawn.get_color(), size="small")
    intact = vehicle.hover_rotor_speed
    stuck.axhline(intact, color=style.GREY, lw=0.8)
    note: dict[str, Any] = {"xytext": (3, 2), "textcoords": "offset points", "size": "x-small"}
    place = (-0.8 * pi, intact)
    stuck.annotate(f"intact vehicle, {intact:.0f}", place, color=style.GREY, **note)
    limit = 2.0 * atan(drag_ratio(vehicle))
    stuck.axvline(limit, color=style.AMBER, ls="--", lw=1.0)
    look: dict[str, Any] = {"color": style.AMBER, "size": "small", "va": "top"}
    look["transform"] = stuck.get_xaxis_transform()
    stuck.text(limit, 0.9, " no level gait\n beyond", **look)
    style.angle_axis(stuck, "x", pi)
    stuck.set(xlabel="angle at which servo 1 is stuck (rad)", title="Stuck servo, other tilts free")
    stuck.set_ylabel("maximum rotor speed needed (rad/s)")
    factors = np.linspace(0.0, 1.0, 21)
    speeds = [minimum_hover_speed(vehicle, factors=(f, 1.0, 1.0, 1.0)) for f in factors.tolist()]
    partial.plot(100.0 * factors, speeds)
    partial.plot([0.0], speeds[:1], "o", ms=4, color=style.RED, clip_on=False)
    text = f"failed rotor, {speeds[0]:.0f}"
    partial.text(4.0, speeds[0], text, color=style.RED, size="small", va="center")
    partial.set(xlim=(0.0, 100.0), xlabel="remaining thrust of rotor 1 (%)")
    partial.set_title("Partial thrust, tilts free")
    return figure


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
    axes = figure.subplots()
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
