"""Figures of a vehicle: determinants, singular attitudes, attainable forces and torques."""

from math import pi
from typing import Any, Final

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from tiltsim.views.figures import style
from tiltsim.views.signals import FLOORS
from tiltsim_controllers.analysis import singularity, torque_free
from tiltsim_controllers.analysis.attainable import (
    ALMOST_FLAT,
    HOVER_THRUST,
    AttainableSet,
    TiltedRotors,
    attainable_accelerations,
    attainable_forces,
    attainable_torque_thrust,
    attainable_torques,
    published_speed_limits,
)
from tiltsim_controllers.analysis.hover import hover
from tiltsim_controllers.analysis.published_gaits import DETERMINANT_CASES, TRIANGLE
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.laws.quadrotor import PUBLISHED_ZONE
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
        return singularity.residuals(np.stack([first, alpha_2, third, alpha_4], axis=-1), vehicle).R

    restriction, pairs = DETERMINANT_CASES[case]
    shades = colormaps[style.SEQUENTIAL](np.linspace(0.0, 0.9, len(pairs)))
    looks = ["-", (0, (6, 2)), "-", (0, (3, 1.5)), (0, (1, 1))]
    grid = np.meshgrid(_SIDE, _SIDE)
    values = [determinant(pair, *grid) for pair in pairs]
    largest = float(np.abs(values).max())
    figure = style.new_figure(9.2, 5.6)
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.0, 1.45])
    title = f"Determinant R at level attitude, {restriction}"
    upper.suptitle(title, x=0.012, ha="left", size="medium")
    plane, *sections = lower.subplots(1, 3, width_ratios=[1.25, 1.0, 1.0])
    slopes = ((-1.0, -1.5, 1.5, "−α₂"), (1.0, 0.0, 1.0, "α₂"))  # with start and end, rad
    for place, (pair, R, shade, look) in enumerate(zip(pairs, values, shades, looks, strict=True)):
        label = f"α₁ = {pair[0]:g}".replace("-", "−")
        surface = upper.add_subplot(1, len(pairs), place + 1, projection="3d")
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
    # Opposite values of alpha_1 may give equal curves: short dashes over long ones show both.
    lower.legend(
        handles=sections[0].get_legend_handles_labels()[0],
        loc="outside lower center",
        ncols=len(pairs),
    )
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
    exact = singularity.normalized_determinant(roll, pitch, vehicle.mass * vehicle.gravity, vehicle)
    return roll, pitch, singularity.published_determinant(roll, pitch), exact


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
        surface = figure.add_subplot(grid[row, 0], projection="3d")
        look: dict[str, Any] = {"cmap": style.SEQUENTIAL, "rstride": 4, "cstride": 4, "lw": 0.2}
        surface.plot_surface(roll, pitch, np.minimum(values, levels[-1]), **look)
        surface.view_init(elev=24, azim=-125)
        surface.set_box_aspect((1.0, 1.0, 0.75), zoom=0.85)
        surface.set(xlabel="roll φ (rad)", ylabel="pitch θ (rad)", title=title)
        contour = figure.add_subplot(grid[row, 1])
        look = {"cmap": style.SEQUENTIAL, "extend": "both"}
        shades = contour.contourf(roll, pitch, values, levels, **look)
        figure.colorbar(shades, ax=contour, shrink=0.85)
        contour.set_title(title)
        style.roll_pitch_axes(contour)
    curve = singularity.published_singular_curve()
    alone = figure.add_subplot(grid[0, 2])
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
    figure.legend(handles=axes.get_legend_handles_labels()[0], loc="outside lower center", ncols=4)
    return figure


_POINTS: Final = 241

_SLICES: Final = 7


@style.paper_style()
def multirotor_figure(rotors: TiltedRotors, kind: str) -> Figure:
    """``roll_pitch``, the margin of every attitude, or ``attainable``, forces and torques."""
    if kind == "roll_pitch":
        figure = style.new_figure(4.4, 3.6)
        _margins(figure.subplots(), rotors)
        return figure
    figure = style.new_figure(8.0, 3.4)
    found = hover(rotors)
    up = torque_free.LEVEL if found is None else found.force / rotors.weight
    sets = (
        ("Force without torque, by weight", attainable_forces(rotors), rotors.weight, "$F_{}/mg$"),
        ("Torque while the lift carries the weight", attainable_torques(rotors, np.array(up)), 1.0,
         "{} (N m)"),
    )  # fmt: skip
    for place, (title, attainable, unit, label) in enumerate(sets, start=1):
        space = figure.add_subplot(1, 2, place, projection="3d")
        space.set_title(title)
        _polytope(space, attainable, unit, label)
    return figure


def _margins(axes: Axes, rotors: TiltedRotors) -> None:
    """The margin over roll and pitch, with the singular attitudes in red."""
    forces = torque_free.torque_free_forces(rotors.force, rotors.torque)
    angles = np.linspace(-pi / 2, pi / 2, _POINTS)
    roll, pitch = np.meshgrid(angles, angles)
    margin = torque_free.singularity_margin(forces, singularity.world_up(roll, pitch))
    name = torque_free.SINGULAR_ATTITUDES[int(forces.dimension)]
    axes.set_title(f"Singular attitudes: {name}")
    axes.plot(0.0, 0.0, "+", color=style.INK, ms=8, mew=1.2)
    if float(np.ptp(margin)) < FLOORS["rad"]:  # of one shade
        axes.grid(visible=False)
        angle = float(margin.max())
        text = f"the singularity margin is\n{angle:.3g} rad at every attitude"
        axes.text(0.0, 0.35, text, ha="center", va="center")
        style.roll_pitch_axes(axes)
        return
    levels = np.linspace(0.0, pi / 2, 13)
    shades: Any = axes.contourf(roll, pitch, margin, levels, cmap=style.SEQUENTIAL)
    bar: Any = axes.figure.colorbar(shades, ax=axes, label="singularity margin (rad)")
    bar.set_ticks([0.0, pi / 4, pi / 2], labels=["0", "π/4", "π/2"])
    if name == "great circle":
        normal = np.linalg.svd(forces.projector)[0][:, 0]
        axes.contour(
            roll, pitch, singularity.world_up(roll, pitch) @ normal, [0.0], colors=style.SINGULAR
        )
    elif name == "two directions":
        up = np.linalg.svd(forces.projector)[0][:, 2]
        up = up if up[2] >= 0.0 else -up
        axes.plot(np.arctan2(up[1], up[2]), -np.arcsin(up[0]), "o", color=style.SINGULAR)
    style.roll_pitch_axes(axes)


def _polytope(space: Any, found: AttainableSet, unit: float, label: str) -> None:
    """A set whose coordinates are over ``unit``."""
    if found.is_empty:
        space.set_axis_off()
        space.text2D(0.5, 0.5, "none", transform=space.transAxes, ha="center")
        return
    solid = found.dimension == 3
    draw_set(space, found, style.SKY if solid else style.BLUE, 0.25 if solid else 0.45, unit)
    low, high = (bound / unit for bound in (found.lower, found.upper))
    across = max(1.1 * float(np.abs([low[:2], high[:2]]).max()), 0.05 * float(high[2] - low[2]))
    space.set(xlim=(-across, across), ylim=(-across, across))
    space.set_zlim(float(low[2]) - 0.05 * across, float(high[2]) + 0.05 * across)
    space.set(**{f"{axis}label": label.format(axis) for axis in "xyz"})
    space.locator_params(nbins=5)
    space.view_init(elev=18, azim=-60)
    space.set_box_aspect(None, zoom=0.95)


def draw_set(
    space: Any,
    found: AttainableSet,
    color: str,
    alpha: float,
    unit: float = 1.0,
    *,
    edge: bool = True,
) -> None:
    """Draw the faces of a set that is not empty, or the polygon or line that it is.

    Args:
        space: Axes in three dimensions.
        found: The set.
        color, alpha: Color and opacity of the faces.
        unit: Unit of the coordinates, in SI units.
        edge: Whether edges are drawn.
    """
    vertices = found.vertices / unit
    if found.dimension < 2:
        space.plot(*vertices.T, color=style.BLUE, lw=2.2)
        return
    polygons = _faces(vertices) if found.dimension == 3 else [vertices]
    faces = Poly3DCollection(polygons, facecolor=color, alpha=alpha)
    faces.set_edgecolor(style.BLUE if edge else "none")
    faces.set_linewidth(0.6)
    space.add_collection3d(faces)


def _faces(vertices: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """The polygons, corners in order, that bound the convex body of vertices of shape (n, 3)."""
    size = np.abs(vertices).max(axis=0)
    hull = ConvexHull(vertices / size, qhull_options=ALMOST_FLAT)
    planes, face_of = np.unique(hull.equations.round(6), axis=0, return_inverse=True)
    faces = []
    for face, plane in enumerate(planes):
        corners = np.unique(hull.simplices[face_of == face])
        points = hull.points[corners] - hull.points[corners].mean(axis=0)
        across, along = np.linalg.svd(plane[None, :3])[2][1:]
        faces.append(vertices[corners[np.argsort(np.arctan2(points @ along, points @ across))]])
    return faces


@style.paper_style()
def attainable_figure(
    gait: Gait, vehicle: Vehicle, speed_limits: tuple[float, float] | None = None
) -> Figure:
    """Roll torque, pitch torque and thrust at zero yaw torque; accelerations at hover thrust.

    For a constant gait. ``speed_limits`` are the minimum and maximum rotor speed, rad/s; by default
    the limits of ch. 9.
    """
    limits = speed_limits or published_speed_limits(vehicle)
    angles = gait.angles(0.0)
    whole = attainable_torque_thrust(angles, vehicle, limits)
    title = f"Torque and thrust at zero yaw torque, {gait.name}"
    conditions = f"Rotor speeds from {limits[0]:.2f} to {limits[1]:.2f} rad/s. Body axes."
    if whole.is_empty:  # a note in place of the set
        figure = style.new_figure(5.0, 1.2)
        axes = figure.subplots()
        axes.set_axis_off()
        axes.set_title(title)
        reason = "Empty set: no rotor speeds within the limits give zero yaw torque."
        axes.text(0.0, 0.6, reason, transform=axes.transAxes)
        axes.text(0.0, 0.1, conditions, transform=axes.transAxes, size="small")
        return figure
    figure = style.new_figure(8.8, 4.0)
    grid = figure.add_gridspec(1, 2, width_ratios=[1.25, 1.0])
    space = figure.add_subplot(grid[0], projection="3d")
    plane = figure.add_subplot(grid[1])
    space.set_title(title)
    if whole.dimension == 3:
        draw_set(space, whole, style.SKY, alpha=0.15)
    for thrust in np.linspace(whole.lower[2], whole.upper[2], _SLICES + 2)[1:-1].tolist():
        found = attainable_torque_thrust(angles, vehicle, limits, vertical_thrust=thrust)
        if not found.is_empty:
            draw_set(space, found, style.BLUE, alpha=0.45)
    space.set(xlabel=r"$\tau_L$ (N m)", ylabel=r"$\tau_M$ (N m)", zlabel="$F_Z$ (N)")
    space.view_init(elev=18, azim=-60)
    space.locator_params(nbins=5)
    space.set_box_aspect(None, zoom=0.92)
    sides = attainable_accelerations(angles, vehicle, limits)
    if sides.is_empty:
        plane.set_axis_off()
        plane.text(0.5, 0.5, "none", transform=plane.transAxes, ha="center")
    else:
        style.zero_lines(plane)
        if sides.dimension == 2:
            plane.fill(*sides.vertices.T, facecolor=style.PALE, edgecolor=style.BLUE, lw=1.4)
        else:
            plane.plot(*sides.vertices.T, color=style.BLUE, lw=2.2, marker="o", ms=4)
    plane.set_aspect("equal", adjustable="datalim")
    plane.locator_params(nbins=6)
    plane.set(xlabel="$F_X / m$ (m/s²)", ylabel="$F_Y / m$ (m/s²)")
    plane.set_title(f"Acceleration at $F_Z$ = {HOVER_THRUST:g} N")
    plane.margins(0.12)
    handles = [
        Patch(color=style.SKY, alpha=0.3, lw=0.0, label="attainable set"),
        Patch(facecolor=style.BLUE, edgecolor=style.INK, alpha=0.45, label="at one thrust $F_Z$"),
        Patch(facecolor=style.PALE, edgecolor=style.BLUE, label="accelerations"),
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=3)
    figure.supxlabel(conditions, size="small", x=0.01, ha="left")
    return figure
