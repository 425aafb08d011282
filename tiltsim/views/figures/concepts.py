"""The drawings of docs/concepts.md: vehicle, gaits, decouplers, singular attitudes, colors."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import atan2, pi
from typing import Any, Final

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from tiltsim.flight.flight import Flight
from tiltsim.views import attitude_plane
from tiltsim.views.figures import style
from tiltsim.views.figures import vehicle_drawing as drawing
from tiltsim_controllers.analysis.singularity import singularity_margin, torque_free_direction
from tiltsim_controllers.analysis.two_color_map import curve_l, delta, point_p, red_residual
from tiltsim_controllers.gaits.cat import FORWARD, SWINGS
from tiltsim_controllers.gaits.colors import colored_angles
from tiltsim_controllers.gaits.plans import cat, continuous_trot
from tiltsim_controllers.laws import feedback
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.body import ROTORS
from tiltsim_controllers.vehicle.parameters import PRESETS, Vehicle, drag_ratio

_WIDTH: Final = 6.4  # inches: about the width of a page of text
POSITIVE_TILT: Final = 0.5  # tilt angle (rad) of all rotors in the drawing of the vehicle
BESIDE: Final = drawing.View(azimuth=-0.65, elevation=0.6)  # from the right, in front and above
TROT_ANGLES: Final = (-0.65, -0.65, 0.65, 0.65)  # tilt angles (rad) of the trot at rho = 0.65
LEANING: Final = (-0.45, -0.41)  # roll and pitch (rad) of the vehicle whose margin is drawn
_LEGS: Final = ("right fore", "left fore", "left hind", "right hind")
"""Legs of a cat that rotors 1 to 4 stand for."""

_SHOWN_GAITS: Final = (
    ("Trot", continuous_trot(0.65, 1.0)),
    (
        "Walk, scaled to 1/3",
        cat("walk", SWINGS["walk"].amplitude, 1.0, SWINGS["walk"].lean).scaled(3.0),
    ),
)
"""Gaits of the drawing, with a period of 1 s."""

_RED_GAITS: Final = "#B0122B"
"""Redder than the color of singular attitudes."""

_LEANS: Final = "BrBG"  # color map of forward and backward leans


@contextmanager
def _drawing_style() -> Iterator[None]:
    """The common style with larger text, for pictures that are also seen on phones."""
    sizes = ("font.size", "axes.labelsize", "legend.fontsize", "xtick.labelsize", "ytick.labelsize")
    with style.paper_style(), rc_context(dict.fromkeys(sizes, 10) | {"axes.titlesize": 11}):
        yield


def _new_figure(height: float) -> Any:
    """An empty figure with a white border, for dark pages."""
    figure = style.new_figure(_WIDTH, height)
    figure.get_layout_engine().set(w_pad=0.1, h_pad=0.1)
    return figure


@_drawing_style()
def vehicle_figure() -> Figure:
    """Body axes, rotor numbers, spins and positive tilts, as the compiled model has them."""
    pose = drawing.Pose((POSITIVE_TILT,) * 4)
    figure = _new_figure(3.7)
    beside, above = figure.subplots(1, 2, width_ratios=[1.12, 1.0])
    for axes, view in ((beside, BESIDE), (above, drawing.ABOVE)):
        drawing.blank(axes)
        pose.draw(axes, view)
    _body_axes(beside, pose, BESIDE)
    _body_axes(above, pose, drawing.ABOVE)
    for number, rotor in enumerate(pose.rotors, 1):
        _tilt_arrow(beside, rotor, pose, BESIDE)
        _spin_arrow(above, rotor)
        for axes, view in ((beside, BESIDE), (above, drawing.ABOVE)):
            drawing.badge(axes, view.project(rotor.hub), number)
    _vehicle_legend(figure, pose)
    return figure


def _body_axes(axes: Axes, pose: drawing.Pose, view: drawing.View) -> None:
    origin = view.project(np.zeros(3))
    for name, axis in zip("xyz", np.eye(3), strict=True):
        end = view.project(pose.to_world(0.36 * axis))
        if np.hypot(*(end - origin)) < 0.05:
            continue
        drawing.arrow(axes, [origin, end], style.INK, width=1.4)
        drawing.text(axes, origin + 1.09 * (end - origin), name, fontsize=11, fontstyle="italic")


def _tilt_arrow(axes: Axes, rotor: drawing.Rotor, pose: drawing.Pose, view: drawing.View) -> None:
    """The thrust untilted and tilted, and the angle from the one to the other."""
    up = pose.to_world([0.0, 0.0, 1.0])
    base, length = rotor.hub - 0.026 * rotor.thrust, 0.24
    ends = view.project([base, base + length * up])
    axes.plot(*ends.T, color=style.BLUE, lw=1.0, ls=(0, (3, 2)), zorder=5.0)
    drawing.arrow(axes, view.project([base, base + length * rotor.thrust]), style.BLUE)
    arc = drawing.turn(up, rotor.hinge, np.linspace(0.0, POSITIVE_TILT, 20))
    drawing.arrow(axes, view.project(base + 0.66 * length * arc), style.BLUE, width=1.2)
    (middle,) = drawing.turn(up, rotor.hinge, [0.5 * POSITIVE_TILT])
    drawing.text(axes, view.project(base + 0.9 * length * middle), "α", color=style.BLUE)


def _spin_arrow(axes: Axes, rotor: drawing.Rotor) -> None:
    start = np.cross(rotor.thrust, rotor.hinge)
    angles = rotor.spin * np.linspace(-2.2, 2.2, 60)
    rim = rotor.hub + 0.62 * rotor.radius * drawing.turn(start, rotor.thrust, angles)
    drawing.arrow(axes, drawing.ABOVE.project(rim), 0.55 * rotor.color)


def _vehicle_legend(figure: Figure, pose: drawing.Pose) -> None:
    names = {-1.0: "clockwise from above, ϖ < 0", 1.0: "counter-clockwise, ϖ > 0"}
    handles: list[Any] = [
        Patch(facecolor=(*rotor.color, 0.32), edgecolor=0.6 * rotor.color, label=names[rotor.spin])
        for rotor in pose.rotors[:2]
    ]
    tilted, untilted = f"thrust tilted by α = +{POSITIVE_TILT:g} rad", "thrust at α = 0"
    handles += [
        Line2D([], [], color=style.BLUE, lw=1.8, label=tilted),
        Line2D([], [], color=style.BLUE, lw=1.0, ls=(0, (3, 2)), label=untilted),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)


@_drawing_style()
def gait_figure() -> Figure:
    """Two gaits over two periods: the four tilt angles, and who leans forward when."""
    times = np.linspace(0.0, 2.0, 801)
    figure = _new_figure(4.3)
    grid = figure.subplots(2, 2, sharex=True, sharey="row", height_ratios=[1.25, 1.0])
    for column, (name, gait) in zip(grid.T, _SHOWN_GAITS, strict=True):
        angles = gait.angles(times)
        upper, lower = column
        for rotor, angle, line in zip(ROTORS, angles.T, style.ROTOR_LINES, strict=True):
            upper.plot(times, angle, label=f"α{'₁₂₃₄'[rotor - 1]}", **line)
        upper.set_title(name)
        lean = (angles * FORWARD).T
        largest = float(np.abs(lean).max())
        colors = lower.pcolormesh(
            times, ROTORS, lean, cmap=_LEANS, vmin=-largest, vmax=largest, rasterized=True
        )
        lower.grid(False)
        for border in (1.5, 2.5, 3.5):
            lower.axhline(border, color="white", lw=3.0)
        lower.set(xlabel="time / period", xticks=[0.0, 0.5, 1.0, 1.5, 2.0], ylim=(4.5, 0.5))
    bar = figure.colorbar(colors, ax=list(grid[1]), pad=0.02, ticks=[-largest, 0.0, largest])
    bar.ax.set_yticklabels(["backward", "upright", "forward"])
    bar.outline.set_visible(False)
    names = [f"{rotor}  {leg}" for rotor, leg in zip(ROTORS, _LEGS, strict=True)]
    grid[1, 0].set_yticks(ROTORS, names)
    grid[0, 0].set_ylabel("tilt angle (rad)")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure


@_drawing_style()
def decoupler_figure(flights: Mapping[str, Flight]) -> Figure:
    """The response of each decoupler, given by its name, at the set point (0, 0)."""
    first = next(iter(flights.values()))
    vehicle: Any = first.scenario.true_vehicle  # a tiltrotor
    tilts = first.assembly.gait.angles(0.0)
    n = torque_free_direction(tilts, vehicle)
    figure = _new_figure(5.6)
    above, below = figure.subfigures(2, 1, height_ratios=[1.0, 1.2])
    sketches = above.subplots(1, len(flights), sharex=True, sharey=True)
    plan, error = below.subplots(1, 2)
    for sketch, (name, flight), line in zip(
        sketches, flights.items(), style.AXIS_LINES, strict=True
    ):
        _lean(sketch, name, drawing.Pose(tuple(tilts), _lean_at_rest(name, n, vehicle)), n)
        away = np.hypot(flight["x_ref"] - flight["x"], flight["y_ref"] - flight["y"])
        plan.plot(flight["x"], flight["y"], label=name, **line)
        plan.plot(flight["x"][-1], flight["y"][-1], "o", ms=6, color=line["color"])
        error.semilogy(flight["time"], away, **line)
    plan.plot(0.0, 0.0, "+", color=style.INK, ms=13, mew=1.6)
    plan.annotate("set point", (0.0, 0.0), (-12, -5), textcoords="offset points", ha="right")
    plan.set(xlabel="x (m)", ylabel="y (m)", title="Path, from above")
    plan.set_aspect("equal", adjustable="datalim")
    plan.margins(0.15)
    error.set(xlabel="time (s)", title="Distance from the set point (m)")
    error.set(yticks=[1e-6, 1e-4, 1e-2, 1.0], ylim=(1e-8, 20.0), xlim=(0.0, first["time"][-1]))
    error.yaxis.minorticks_off()
    handles, _ = plan.get_legend_handles_labels()
    figure.legend(handles=handles, loc="outside lower center", ncols=len(flights))
    return figure


def _lean_at_rest(name: str, n: Floats, vehicle: Vehicle) -> tuple[float, float, float]:
    """Roll, pitch and yaw (rad) that a decoupler commands for no acceleration."""
    force = (float(n[0]), float(n[1]), float(n[2]))
    gravity = vehicle.gravity
    leans = {
        "conventional": lambda: feedback.conventional_decoupler(0.0, 0.0, 0.0, gravity),
        "modified": lambda: feedback.modified_decoupler(0.0, 0.0, 0.0, gravity, force),
        "exact": lambda: feedback.exact_decoupler(0.0, 0.0, 0.0, 0.0, gravity, force),
    }
    return (*leans[name](), 0.0)


def _lean(axes: Axes, name: str, pose: drawing.Pose, n: Floats) -> None:
    """A vehicle at rest, seen from the side, with the force at zero torque."""
    view, length = drawing.View(azimuth=pi / 4, elevation=0.12), 0.4
    drawing.blank(axes)
    pose.draw(axes, view)
    force, up = pose.to_world(n), np.array([0.0, 0.0, 1.0])
    axes.plot(
        *view.project([0.0 * up, 1.12 * length * up]).T,
        color=style.GREY,
        ls=(0, (3, 2)),
        lw=1.0,
        zorder=5.0,
    )
    drawing.arrow(axes, view.project([0.0 * force, length * force]), style.BLUE, width=2.4)
    axes.set_title(name, loc="center")
    drawing.text(axes, (0.0, -0.2), f"force {np.degrees(np.arccos(force[2])):.1f}° off vertical")


@_drawing_style()
def attitude_figure() -> Figure:
    """The singularity margin of a leaning vehicle, from the side and in the roll-pitch plane."""
    vehicle = PRESETS["ar_drone_2"]
    n = torque_free_direction(TROT_ANGLES, vehicle)[np.newaxis]
    figure = _new_figure(3.6)
    beside, plane = figure.subplots(1, 2, width_ratios=[1.0, 1.1])
    _side_view(beside, n[0])
    _roll_pitch_plane(plane, n, vehicle)
    return figure


def _side_view(axes: Axes, n: Floats) -> None:
    """A leaning vehicle in the vertical plane of its force at zero torque."""
    pose = drawing.Pose(TROT_ANGLES, (*LEANING, 0.0))
    force = pose.to_world(n)
    view, length = drawing.View(azimuth=atan2(force[1], force[0]) - pi / 2, elevation=0.0), 0.34
    drawing.blank(axes)
    up = view.project([0.0, 0.0, 1.0])
    along = view.project(force)
    border = np.array([-along[1], along[0]])
    beyond = atan2(border[1], border[0]) + np.linspace(0.0, pi, 60)
    axes.fill(
        *(1.1 * length * np.stack([np.cos(beyond), np.sin(beyond)])),
        color=style.UNREACHABLE, lw=0.0, zorder=0.0,
    )  # fmt: skip
    axes.plot(*(1.1 * length * np.stack([-border, border])).T, color=style.SINGULAR, zorder=1.0)
    pose.draw(axes, view)
    drawing.arrow(axes, [0.0 * along, length * along], style.BLUE, width=2.4)
    drawing.text(axes, 1.12 * length * along, "n", color=style.BLUE, fontsize=13, style="italic")
    drawing.arrow(axes, [0.0 * up, length * up], style.INK)
    drawing.text(axes, 1.1 * length * up, "world up")
    turned = np.linspace(atan2(up[1], up[0]), atan2(border[1], border[0]), 30)
    arc = 0.75 * length * np.stack([np.cos(turned), np.sin(turned)], axis=1)
    axes.plot(*arc.T, color=style.PURPLE, lw=2.4, zorder=5.0)
    drawing.text(axes, arc[-1] - (0.02, 0.0), "margin", ha="right")
    drawing.text(axes, -0.8 * length * along, "unreachable", color=style.SINGULAR)


def _roll_pitch_plane(axes: Axes, n: Floats, vehicle: Vehicle) -> None:
    roll = np.linspace(-attitude_plane.HALF_WIDTH, attitude_plane.HALF_WIDTH, 361)
    low, high = attitude_plane.unreachable_pitch(n, 1.0, roll)[0].T
    axes.fill_between(roll, low, high, color=style.UNREACHABLE, lw=0.0, zorder=0.5)
    axes.plot(*attitude_plane.singular_curves(n)[0].T, color=style.SINGULAR, lw=1.8)
    style.roll_pitch_axes(axes)
    drawing.text(axes, (-0.9, -1.33), "unreachable\nmargin < 0", color=style.SINGULAR)
    hover = feedback.exact_decoupler(0.0, 0.0, 0.0, 0.0, vehicle.gravity, tuple(n[0]))
    nearest = attitude_plane.nearest_singular(n, np.array([LEANING]))[0]
    axes.plot(*np.array([LEANING, nearest]).T, color=style.PURPLE, lw=2.4)
    for attitude, name in ((LEANING, "leaning"), ((0.0, 0.0), "level"), (hover, "hover")):
        margin = float(singularity_margin(TROT_ANGLES, vehicle, *attitude))
        axes.plot(*attitude, "o", color=style.INK, ms=6)
        label = f"{name}: {margin:.2f} rad"
        axes.annotate(label, attitude, (2, -5), textcoords="offset points", va="top")


@_drawing_style()
def color_figure() -> Figure:
    """Angles of red and blue gaits, and the curve of singular red ones (ch. 6 to 8)."""
    vehicle = PRESETS["ar_drone_2"]
    angle = delta(vehicle)
    side = np.linspace(-pi / 2, pi / 2, 401)
    figure = _new_figure(3.4)
    lines, plane = figure.subplots(1, 2)
    red, blue = [
        np.transpose([colored_angles(a, 0.0, name, drag_ratio(vehicle)) for a in side])
        for name in ("red", "blue")
    ]
    lines.plot(side, red[0], color=_RED_GAITS, lw=2.4)
    lines.plot(side, blue[0], color=style.BLUE, lw=2.4, ls=(0, (4, 1.5)))
    lines.plot(angle, angle, "o", color=style.AMBER, mec=style.INK, ms=7, zorder=5)
    lines.annotate("α₁ = α₃ = δ", (angle, angle), (10, -4), textcoords="offset points")
    drawing.text(lines, (0.75, 1.2), "red", color=_RED_GAITS, fontweight="bold")
    drawing.text(lines, (-0.95, 0.35), "blue:\nsingular", color=style.BLUE, fontweight="bold")
    lines.set(xlabel="α₁ (rad)", ylabel="α₃ (rad)", title="Two families of gaits")

    first, second = np.meshgrid(side, side)
    beyond = red_residual(first, second, vehicle) < 0.0
    plane.contourf(side, side, beyond, levels=[0.5, 1.5], colors=[style.UNREACHABLE])
    plane.plot(side[1:-1], curve_l(side[1:-1], vehicle), color=style.SINGULAR, lw=1.8)
    plane.plot(*point_p(vehicle), "o", color=style.AMBER, mec=style.INK, ms=7, zorder=5)
    plane.annotate("P", point_p(vehicle), (7, -3), textcoords="offset points")
    plane.plot(0.0, 0.0, "+", color=style.INK, ms=9, mew=1.4)
    plane.annotate("untilted", (0.0, 0.0), (-5, 5), textcoords="offset points", ha="right")
    drawing.text(plane, (0.75, -0.9), "unreachable\nR < 0", color=style.SINGULAR)
    drawing.text(plane, (-0.8, 0.95), "R > 0")
    plane.set(xlabel="α₁ = α₃ (rad)", ylabel="α₂ = α₄ (rad)", title="Red gaits")
    for axes in (lines, plane):
        for axis in "xy":
            style.angle_axis(axes, axis, pi / 2)
        axes.set_aspect("equal")
    return figure
