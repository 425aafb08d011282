"""Figures of a multirotor: singular attitudes, attainable torques, forces and accelerations."""

from math import pi
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from tiltsim.views.figures import style
from tiltsim.views.signals import FLOORS
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
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.analysis.torque_free import (
    LEVEL,
    SINGULAR_ATTITUDES,
    singularity_margin,
    torque_free_forces,
)
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.vehicle.parameters import Vehicle

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
    up = LEVEL if found is None else found.force / rotors.weight
    sets = (
        ("Force without torque, by weight", attainable_forces(rotors), rotors.weight, "$F_{}/mg$"),
        ("Torque while the lift carries the weight", attainable_torques(rotors, np.array(up)), 1.0,
         "{} (N m)"),
    )  # fmt: skip
    for place, (title, attainable, unit, label) in enumerate(sets, start=1):
        space: Any = figure.add_subplot(1, 2, place, projection="3d")
        space.set_title(title)
        _polytope(space, attainable, unit, label)
    return figure


def _margins(axes: Axes, rotors: TiltedRotors) -> None:
    """The margin over roll and pitch, with the singular attitudes in red."""
    forces = torque_free_forces(rotors.force, rotors.torque)
    angles = np.linspace(-pi / 2, pi / 2, _POINTS)
    roll, pitch = np.meshgrid(angles, angles)
    margin = singularity_margin(forces, world_up(roll, pitch))
    name = SINGULAR_ATTITUDES[int(forces.dimension)]
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
        axes.contour(roll, pitch, world_up(roll, pitch) @ normal, [0.0], colors=style.SINGULAR)
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
        axes: Any = figure.subplots()
        axes.set_axis_off()
        axes.set_title(title)
        reason = "Empty set: no rotor speeds within the limits give zero yaw torque."
        axes.text(0.0, 0.6, reason, transform=axes.transAxes)
        axes.text(0.0, 0.1, conditions, transform=axes.transAxes, size="small")
        return figure
    figure = style.new_figure(8.8, 4.0)
    grid = figure.add_gridspec(1, 2, width_ratios=[1.25, 1.0])
    space: Any = figure.add_subplot(grid[0], projection="3d")
    plane: Any = figure.add_subplot(grid[1])
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
