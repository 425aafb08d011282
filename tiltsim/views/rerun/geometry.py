"""The visual geometry of any compiled MuJoCo model as static Rerun entities.

A body's entity lies below its parent's entity, so that poses are relative; its geoms are
entities below the body's. Infinite planes are not drawn: the view has a grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt
import rerun as rr

from tiltsim.views.replay import rotate
from tiltsim_controllers.mathematics.scalar import Floats

VISIBLE_GROUPS: Final = (0, 1, 2)
"""Geom groups that are drawn; collision geometry is in group 3 by convention."""

_XYZW: Final = [1, 2, 3, 0]
"""Permutation from MuJoCo's quaternion order, scalar first, to Rerun's, scalar last."""

_UNSET_COLOR: Final = (0.5, 0.5, 0.5, 1.0)
"""MuJoCo's default RGBA; a geom with it has its material's color instead."""


def xyzw(quaternion: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Quaternions, shape (..., 4), from MuJoCo's order to Rerun's, scalar last."""
    return np.asarray(quaternion, dtype=np.float32)[..., _XYZW]


def body_paths(model: mujoco.MjModel, root: str) -> list[str]:
    """The entity path of every body; ``root`` is the path of the world body."""
    paths = [root]
    for body in range(1, model.nbody):
        name = _part(model.body(body).name or f"body_{body}")
        paths.append(f"{paths[model.body_parentid[body]]}/{name}")
    return paths


def log_geometry(recording: rr.RecordingStream, model: mujoco.MjModel, root: str) -> list[str]:
    """Log all visible geoms below ``root``; return the names of those without a Rerun shape."""
    paths = body_paths(model, root)
    not_drawn = []
    for geom in range(model.ngeom):
        if model.geom_group[geom] not in VISIBLE_GROUPS or is_infinite_plane(model, geom):
            continue
        name = model.geom(geom).name or f"geom_{geom}"
        archetypes = geom_archetypes(model, geom)
        if not archetypes:
            not_drawn.append(name)
            continue
        path = f"{paths[model.geom_bodyid[geom]]}/{_part(name)}"
        recording.log(path, *archetypes, static=True)
    return not_drawn


def is_infinite_plane(model: mujoco.MjModel, geom: int) -> bool:
    """Whether a geom is an infinite plane."""
    is_plane = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE
    return bool(is_plane and not model.geom_size[geom, :2].all())


def ground_height(model: mujoco.MjModel) -> float:
    """Height (m) of the model's highest infinite plane; 0 without one."""
    heights = [
        float(model.geom_pos[geom, 2])
        for geom in range(model.ngeom)
        if is_infinite_plane(model, geom) and model.geom_bodyid[geom] == 0
    ]
    return max(heights, default=0.0)


def geom_archetypes(model: mujoco.MjModel, geom: int) -> Sequence[Any]:
    """Rerun's archetypes for a geom in its body's frame; empty for shapes that Rerun lacks."""
    kind, size = mujoco.mjtGeom(model.geom_type[geom]).name, model.geom_size[geom]
    place, turn = model.geom_pos[geom], xyzw(model.geom_quat[geom])
    look = {"colors": [geom_color(model, geom)], "fill_mode": rr.components.FillMode.Solid}
    common: dict[str, Any] = {"quaternions": [turn], **look}

    def on_axis(z: float) -> Floats:
        """A point on the z axis of the geom's frame (m) in its body's frame."""
        return np.asarray(place + rotate(model.geom_quat[geom], np.array([0.0, 0.0, z])))

    match kind.removeprefix("mjGEOM_"):
        case "BOX":
            return (rr.Boxes3D(centers=[place], half_sizes=[size], **common),)
        case "SPHERE" | "ELLIPSOID" as shape:
            half_sizes = [size if shape == "ELLIPSOID" else np.full(3, size[0])]
            return (rr.Ellipsoids3D(centers=[place], half_sizes=half_sizes, **common),)
        case "CYLINDER":
            common |= {"lengths": [2.0 * size[1]], "radii": [size[0]]}
            return (rr.Cylinders3D(centers=[place], **common),)
        case "CAPSULE":  # Rerun's starts at its origin, MuJoCo's is centered there
            common |= {"lengths": [2.0 * size[1]], "radii": [size[0]]}
            return (rr.Capsules3D(translations=[on_axis(-size[1])], **common),)
        case "PLANE":
            half = 1e-3  # m, half the thickness of a box whose upper face is the plane
            half_sizes = [np.array([*size[:2], half])]
            return (rr.Boxes3D(centers=[on_axis(-half)], half_sizes=half_sizes, **common),)
        case "MESH":
            pose = rr.InstancePoses3D(translations=[place], quaternions=[turn])
            return _mesh(model, geom), pose
    return ()


def _mesh(model: mujoco.MjModel, geom: int) -> rr.Mesh3D:
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    vertex, normal = model.mesh_vertadr[mesh], model.mesh_normaladr[mesh]
    # MuJoCo indexes vertices and normals separately, Rerun together: each corner is a vertex.
    corners = model.mesh_vert[vertex + model.mesh_face[first : first + count].ravel()]
    normals = model.mesh_normal[normal + model.mesh_facenormal[first : first + count].ravel()]
    return rr.Mesh3D(
        vertex_positions=corners,
        vertex_normals=normals,
        triangle_indices=np.arange(len(corners), dtype=np.uint32).reshape(-1, 3),
        albedo_factor=geom_color(model, geom),
    )


def geom_color(model: mujoco.MjModel, geom: int) -> npt.NDArray[np.uint8]:
    """RGBA (0 to 255) of a geom, or of its material if the geom itself has no color."""
    rgba, material = model.geom_rgba[geom], model.geom_matid[geom]
    if material >= 0 and np.allclose(rgba, _UNSET_COLOR):
        rgba = model.mat_rgba[material]
    return np.asarray((np.clip(rgba, 0.0, 1.0) * 255.0).round(), dtype=np.uint8)


def _part(name: str) -> str:
    return str(rr.escape_entity_path_part(name))
