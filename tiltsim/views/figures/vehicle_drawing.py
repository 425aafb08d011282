"""Line drawings of a rotorcraft, from its compiled model: shapes, positions and signs are MuJoCo's.

A drawing is a parallel projection: a point ``(x, y, z)`` of the world (m) appears at ``(right,
up)``. All that is near covers what is far.
"""

from functools import cache
from math import cos, pi, sin
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch
from matplotlib.path import Path
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from tiltsim.models.rotorcraft import RotorcraftSpec, compile_model
from tiltsim.views.figures import style
from tiltsim_controllers.mathematics.attitude import quaternion_of_euler
from tiltsim_controllers.mathematics.scalar import Floats, Quad
from tiltsim_controllers.vehicle.body import ROTORS
from tiltsim_controllers.vehicle.parameters import PRESETS

_VISUAL: Final = 2  # group of the geoms that are drawn
_ON_TOP: Final = 5.0  # draw order of lines and texts that nothing covers
LEVEL: Final = (0.0, 0.0, 0.0)


class View(NamedTuple):
    """The direction from which a drawing is seen, rad."""

    azimuth: float  # of the viewer, about the world's z axis from x
    elevation: float  # of the viewer, above the ground

    @property
    def axes(self) -> Floats:
        """Unit vectors to the right, up, and toward the viewer, shape (3, 3), world axes."""
        a, e = self.azimuth, self.elevation
        right = [-sin(a), cos(a), 0.0]
        up = [-sin(e) * cos(a), -sin(e) * sin(a), cos(e)]
        return np.array([right, up, np.cross(right, up)])

    def project(self, points: ArrayLike) -> Floats:
        """Points of the drawing, shape (..., 2), for points of the world, shape (..., 3), m."""
        return np.asarray(np.asarray(points, float) @ self.axes[:2].T)


ABOVE: Final = View(-pi / 2, pi / 2)  # from above: x to the right, y up


class Rotor(NamedTuple):
    """A rotor as MuJoCo has it; vectors in world axes."""

    hub: Floats  # m
    hinge: Floats  # axis about which a positive tilt turns
    thrust: Floats  # direction of the thrust
    spin: float  # 1 is counter-clockwise about the thrust, -1 clockwise
    radius: float  # m
    color: Any  # RGB


class Pose:
    """The tiltrotor of ch. 3 at the origin with an attitude and tilt angles."""

    def __init__(self, tilts: Quad, attitude: tuple[float, float, float] = LEVEL) -> None:
        """Place the model; tilt angles and roll, pitch, yaw in rad."""
        self.model = _model()
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = (0.0, 0.0, 0.0, *quaternion_of_euler(attitude), *tilts)
        mujoco.mj_kinematics(self.model, self.data)

    @property
    def rotors(self) -> list[Rotor]:
        """Rotors 1 to 4."""
        return [self._rotor(number) for number in ROTORS]

    def _rotor(self, number: int) -> Rotor:
        model, data = self.model, self.data
        disc = model.geom(f"pod_{number}_disc")
        gear = model.actuator(f"thrust_{number}").gear
        return Rotor(
            hub=data.geom(disc.id).xpos.copy(),
            hinge=data.xaxis[model.joint(f"tilt_{number}").id].copy(),
            thrust=data.site(f"rotor_{number}").xmat.reshape(3, 3)[:, 2] * np.sign(gear[2]),
            # The drag torque on the body opposes the spin.
            spin=-float(np.sign(gear[5] * gear[2])),
            radius=float(disc.size[0]),
            color=disc.rgba[:3],
        )

    def to_world(self, vector: ArrayLike) -> Floats:
        """A vector in world axes, from body axes."""
        rotation = self.data.body("vehicle").xmat.reshape(3, 3)
        return np.asarray(rotation @ np.asarray(vector, float))

    def draw(self, axes: Axes, view: View, *, at: ArrayLike = (0.0, 0.0)) -> None:
        """Draw all visual geoms, moved by ``at`` (m) in the drawing."""
        for geom in range(self.model.ngeom):
            if self.model.geom_group[geom] != _VISUAL:
                continue
            rotation = self.data.geom_xmat[geom].reshape(3, 3)
            points = _surface(self.model.geom(geom)) @ rotation.T + self.data.geom_xpos[geom]
            flat = view.project(points)
            outline = flat[ConvexHull(flat, qhull_options="QJ").vertices] + np.asarray(at, float)
            color = self.model.geom_rgba[geom]
            depth = float(view.axes[2] @ self.data.geom_xpos[geom])
            axes.fill(
                *outline.T, facecolor=color, edgecolor=(*(0.6 * color[:3]), 0.9), lw=0.5,
                zorder=2.0 + depth,
            )  # fmt: skip


def arrow(axes: Axes, points: ArrayLike, color: Any, *, width: float = 1.8) -> None:
    """An arrow, straight or curved.

    Args:
        axes: The drawing.
        points: Points of the drawing along the arrow, shape (N, 2), its head at the last.
        color: A color of matplotlib.
        width: Points.
    """
    path = np.asarray(points, float)
    look = "-|>,head_width=2.4,head_length=5.4"
    axes.update_datalim(path)
    axes.add_patch(
        FancyArrowPatch(
            path=Path(path), arrowstyle=look, color=color, lw=width, joinstyle="miter",
            clip_on=False, zorder=_ON_TOP,
        )
    )  # fmt: skip


def turn(vector: ArrayLike, axis: ArrayLike, angles: ArrayLike) -> Floats:
    """A vector perpendicular to an axis, turned about it by angles (rad), shape (N, 3)."""
    vector, axis = np.asarray(vector, float), np.asarray(axis, float)
    angles = np.asarray(angles, float)[:, np.newaxis]
    return np.asarray(np.cos(angles) * vector + np.sin(angles) * np.cross(axis, vector))


def blank(axes: Axes) -> None:
    """Axes for a drawing: equal scales, no frame."""
    axes.set_aspect("equal")
    axes.axis("off")


def text(axes: Axes, place: ArrayLike, words: str, **look: Any) -> None:
    """Words at a place of the drawing, in front of all lines."""
    axes.update_datalim(np.array([place], float))
    common: dict[str, Any] = {"ha": "center", "va": "center", "color": style.INK}
    x, y = np.asarray(place, float)
    axes.text(x, y, words, **{**common, "zorder": _ON_TOP + 1.0, **look})


def badge(axes: Axes, place: ArrayLike, number: int) -> None:
    """A rotor's number on a white disc."""
    box = {"boxstyle": "circle,pad=0.18", "facecolor": "white", "edgecolor": style.INK, "lw": 0.8}
    text(axes, place, str(number), fontsize=10, fontweight="bold", bbox=box)


@cache
def _model() -> mujoco.MjModel:
    return compile_model(RotorcraftSpec("tiltrotor", PRESETS["ar_drone_2"]))


def _surface(geom: Any) -> Floats:
    """Points whose convex hull is a geom, in its own axes, shape (N, 3), m."""
    longitude = np.linspace(0.0, 2.0 * pi, 37)[:-1]
    circle = np.stack([np.cos(longitude), np.sin(longitude), 0.0 * longitude], axis=1)
    latitude = np.linspace(-pi / 2, pi / 2, 19)[:, np.newaxis, np.newaxis]
    sphere = (np.cos(latitude) * circle + np.sin(latitude) * [0.0, 0.0, 1.0]).reshape(-1, 3)
    ends = np.array([[[0.0, 0.0, -1.0]], [[0.0, 0.0, 1.0]]])
    shape, (first, second, third) = mujoco.mjtGeom(int(geom.type[0])), geom.size
    if shape == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return np.asarray(sphere * [first, second, third])
    if shape == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return np.asarray((first * sphere + second * ends).reshape(-1, 3))
    if shape == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return np.asarray((first * circle + second * ends).reshape(-1, 3))
    assert shape == mujoco.mjtGeom.mjGEOM_BOX
    corners = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
    return np.asarray(corners * [first, second, third])
