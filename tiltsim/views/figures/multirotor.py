"""Singular attitudes and attainable forces and torques of any multirotor."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.views.figures import style
from tiltsim_controllers.analysis.attainable import (
    ALMOST_FLAT,
    attainable_forces,
    attainable_torques,
)
from tiltsim_controllers.analysis.hover import hover
from tiltsim_controllers.analysis.singularity import world_up
from tiltsim_controllers.analysis.torque_free import (
    LEVEL,
    SINGULAR_ATTITUDES,
    singularity_margin,
    torque_free_forces,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tiltsim_controllers.analysis.attainable import AttainableSet, TiltedRotors

_POINTS: Final = 241


def multirotor_figure(rotors: TiltedRotors, kind: str) -> Figure:
    """``roll_pitch``, the margin of every attitude, or ``attainable``, forces and torques."""
    with style.paper_style():
        if kind == "roll_pitch":
            figure = style.new_figure(4.4, 3.6)
            _margins(figure.subplots(), rotors)
            return figure
        figure = style.new_figure(8.0, 3.4)
        spaces: Any = [figure.add_subplot(1, 2, i, projection="3d") for i in (1, 2)]
        spaces[0].set_title("Force without torque, by weight")
        _polytope(spaces[0], attainable_forces(rotors), rotors.weight, "$F_{}/mg$")
        found = hover(rotors)
        up = LEVEL if found is None else found.force / rotors.weight
        spaces[1].set_title("Torque while the lift carries the weight")
        _polytope(spaces[1], attainable_torques(rotors, np.array(up)), 1.0, "{} (N m)")
        return figure


def _margins(axes: Axes, rotors: TiltedRotors) -> None:
    """The margin over roll and pitch, with the singular attitudes in red."""
    forces = torque_free_forces(rotors.force, rotors.torque)
    angles = np.linspace(-pi / 2, pi / 2, _POINTS)
    roll, pitch = np.meshgrid(angles, angles)
    margin = singularity_margin(forces, world_up(roll, pitch))
    levels = np.linspace(0.0, pi / 2, 13)
    shades: Any = axes.contourf(roll, pitch, margin, levels, cmap=style.SEQUENTIAL)
    bar: Any = axes.figure.colorbar(shades, ax=axes, label="singularity margin (rad)")
    bar.set_ticks([0.0, pi / 4, pi / 2], labels=["0", "π/4", "π/2"])
    name = SINGULAR_ATTITUDES[int(forces.dimension)]
    if name == "great circle":
        normal = np.linalg.svd(forces.projector)[0][:, 0]
        axes.contour(roll, pitch, world_up(roll, pitch) @ normal, [0.0], colors=style.SINGULAR)
    elif name == "two directions":
        up = np.linalg.svd(forces.projector)[0][:, 2]
        up = up if up[2] >= 0.0 else -up
        axes.plot(np.arctan2(up[1], up[2]), -np.arcsin(up[0]), "o", color=style.SINGULAR)
    axes.plot(0.0, 0.0, "+", color=style.INK, ms=8, mew=1.2)
    style.roll_pitch_axes(axes)
    axes.set_title(f"Singular attitudes: {name}")


def _polytope(space: Any, found: AttainableSet, unit: float, label: str) -> None:
    """The faces of a set, or the polygon or line that it is; its coordinates are over ``unit``."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    vertices = found.vertices / unit
    if found.is_empty:
        space.set_axis_off()
        space.text2D(0.5, 0.5, "none", transform=space.transAxes, ha="center")
        return
    if found.dimension == 3:
        faces = Poly3DCollection(_faces(vertices), facecolor=style.SKY, alpha=0.25)
        faces.set_edgecolor(style.BLUE)
        faces.set_linewidth(0.6)
        space.add_collection3d(faces)
    elif found.dimension == 2:
        space.add_collection3d(Poly3DCollection([vertices], facecolor=style.BLUE, alpha=0.45))
    else:
        space.plot(*vertices.T, color=style.BLUE, lw=2.2)
    low, high = (bound / unit for bound in (found.lower, found.upper))
    across = max(1.1 * float(np.abs([low[:2], high[:2]]).max()), 0.05 * float(high[2] - low[2]))
    space.set(xlim=(-across, across), ylim=(-across, across))
    space.set_zlim(float(low[2]) - 0.05 * across, float(high[2]) + 0.05 * across)
    space.set(**{f"{axis}label": label.format(axis) for axis in "xyz"})
    space.locator_params(nbins=5)
    space.view_init(elev=18, azim=-60)
    space.set_box_aspect(None, zoom=0.95)


def _faces(vertices: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """The polygons that bound a convex body, each with its corners in order.

    Args:
        vertices: of the body, shape (n, 3).
    """
    from scipy.spatial import ConvexHull

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
