"""The 3D scene: the moving vehicle with its thrust arrows, the reference, and their trails."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt
import rerun as rr

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.flight.flight import Flight
from tiltsim.views import replay
from tiltsim.views.replay import rotate
from tiltsim.views.rerun import timeline
from tiltsim.views.rerun.timeline import Color, Trail, send_rows
from tiltsim_controllers.mathematics.scalar import Floats

TRAIL_INTERVAL: Final = 0.1  # s between the corners of a trail
REFERENCE_POINTS: Final = 400
TRAIL_WIDTH: Final = -1.5  # negative radii are in screen points, independent of the distance
REFERENCE_WIDTH: Final = -1.0
DOT: Final = -4.0  # of vehicle and reference, visible from any distance
FLOOR_CELL: Final = 1.0  # m
FLOOR_CELLS: Final = 12  # to each side of the vehicle

VISIBLE_GROUPS: Final = (0, 1, 2)
"""Geom groups that are drawn; collision geometry is in group 3 by convention."""
_XYZW: Final = [1, 2, 3, 0]
"""Permutation from MuJoCo's quaternion order, scalar first, to Rerun's, scalar last."""
_UNSET_COLOR: Final = (0.5, 0.5, 0.5, 1.0)
"""MuJoCo's default RGBA; a geom with it has its material's color instead."""


class Scene:
    """The entities below ``world`` for one flight.

    Args:
        recording: The recording to write to.
        assembly: The assembly of the flight.
        root: The entity of the scene.
        colors: The color of each vehicle.
        name: The label of the first vehicle, where there are several; empty for one alone.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        assembly: Assembly,
        root: str,
        colors: Sequence[Color],
        name: str = "",
    ) -> None:
        self._recording = recording
        self._vehicles = replay.by_prefix(assembly)
        self.model = model = replay.visible_model(assembly)
        self._colors = colors
        self.root = root
        self.camera = f"{root}/camera"  # moves with the vehicle but does not rotate
        self._floor = f"{root}/floor"  # moves with the vehicle in whole cells
        self._paths = body_paths(model, root)
        self.vehicle = self._paths[replay.first_free_body(model)]
        self._trails = {prefix: Trail(TRAIL_INTERVAL) for prefix in self._vehicles}
        self._thrust = replay.thrust_sites(model)
        self._thrust_scale = replay.thrust_scale(model)
        self._floor_cell: Floats | None = None
        self.not_drawn = log_geometry(recording, model, root)  # geoms that Rerun cannot draw
        self._log_styles(name)

    @property
    def paths(self) -> list[str]:
        """Entities of the moving vehicles with their trails and references."""
        prefixes = [*self._vehicles]
        bodies = [self.vehicle, *(f"{self.root}/{prefix}vehicle" for prefix in prefixes[1:])]
        references = (f"{self.root}/{prefix}reference" for prefix in prefixes)
        return [*self.trails, *(f"{path}/**" for path in (*references, *bodies, self.camera))]

    @property
    def trails(self) -> list[str]:
        """The entities of the trails of all vehicles, the first one's first."""
        return [f"{self.root}/{prefix}trail" for prefix in self._trails]

    def _log_styles(self, name: str) -> None:
        """Log static parts, and the looks of moving ones; ``name`` is the vehicle's label."""
        model = self.model
        self._log(self.root.partition("/")[0], rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for body in range(1, model.nbody):
            if not model.body_dofnum[body]:
                translation, quaternion = model.body_pos[body], xyzw(model.body_quat[body])
                pose = rr.Transform3D(translation=translation, quaternion=quaternion)
                self._log(self._paths[body], pose)
        cable = rr.LineStrips3D.from_fields(colors=[timeline.GREY], radii=[TRAIL_WIDTH])
        for tendon in range(model.ntendon):
            self._log(f"{self.root}/{model.tendon(tendon).name}", cable)
        look: dict[str, Any]
        for prefix, color in zip(self._trails, self._colors, strict=True):
            own = prefix.removesuffix("_") or name
            trail = rr.LineStrips3D.from_fields(colors=[color], radii=[TRAIL_WIDTH])
            self._log(f"{self.root}/{prefix}trail", trail)
            place = f"{self.root}/{prefix}vehicle" if prefix else self.camera
            look = {"radii": [DOT], "colors": [color], "labels": [own] if name else None}
            dot = rr.Points3D([(0.0, 0.0, 0.0)], **look, show_labels=True)
            self._log(f"{place}/dot", dot)
        look = {"colors": [timeline.YELLOW]}
        look["radii"] = [0.02 * replay.vehicle_radius(model)]
        for site in self._thrust:
            arrow = rr.Arrows3D.from_fields(origins=[model.site_pos[site]], **look)
            self._log(self._thrust_path(site), arrow)
        # A grid around the origin, at the height of the model's ground.
        half, height = FLOOR_CELL * FLOOR_CELLS, ground_height(model)
        offsets = np.linspace(-half, half, 2 * FLOOR_CELLS + 1)
        lines = [[(c, -half, height), (c, half, height)] for c in offsets]
        lines += [[(-half, c, height), (half, c, height)] for c in offsets]
        self._log(self._floor, rr.LineStrips3D(lines, colors=[timeline.FAINT], radii=[-0.5]))

    def append(self, piece: Flight) -> None:
        """Log the next piece of the flight."""
        model, columns, time = self.model, piece.columns, piece["time"]
        world = replay.world_poses(model, replay.joint_positions(model, columns))
        local = replay.poses_in_parents(model, world)
        for body in range(1, model.nbody):
            if model.body_dofnum[body]:
                pose = rr.Transform3D.columns(
                    translation=local.position[:, body].astype(np.float32),
                    quaternion=xyzw(local.quaternion[:, body]),
                )
                send_rows(self._recording, self._paths[body], time, pose)
        for site, column in self._thrust.items():
            axis = replay.rotate(model.site_quat[site], np.array([0.0, 0.0, 1.0]))
            vectors = np.outer(columns[column] * self._thrust_scale, axis).astype(np.float32)
            arrow = rr.Arrows3D.columns(vectors=vectors)
            send_rows(self._recording, self._thrust_path(site), time, arrow)
        for name, ends in replay.cables(piece.scenario, model, world, time).items():
            strips = rr.LineStrips3D.columns(strips=ends.astype(np.float32))
            send_rows(self._recording, f"{self.root}/{name}", time, strips)
        position = world.position[:, replay.first_free_body(model)]
        follow = rr.Transform3D.columns(translation=position.astype(np.float32))
        send_rows(self._recording, self.camera, time, follow)
        for path, (prefix, trail) in zip(self.trails, self._trails.items(), strict=True):
            ends, segments = trail.extend(time, replay.positions(columns, prefix))
            if len(ends):
                strips = rr.LineStrips3D.columns(strips=segments.astype(np.float32))
                send_rows(self._recording, path, ends, strips)
        # The grid moves by whole cells, so that it appears fixed and infinite.
        cells = FLOOR_CELL * np.round(position * (1.0, 1.0, 0.0) / FLOOR_CELL)
        before = cells[:1] + 1.0 if self._floor_cell is None else self._floor_cell[np.newaxis]
        moved = np.any(cells != np.concatenate([before, cells[:-1]]), axis=1)
        move = rr.Transform3D.columns(translation=cells[moved].astype(np.float32))
        send_rows(self._recording, self._floor, time[moved], move)
        self._floor_cell = cells[-1]
        for path, prefix, _ in self._followed():
            reference = replay.positions(columns, prefix, "_ref")
            point = rr.Points3D.columns(positions=reference.astype(np.float32))
            send_rows(self._recording, f"{path}/now", time, point)

    def _log(self, path: str, *archetypes: Any) -> None:
        self._recording.log(path, *archetypes, static=True)

    def _thrust_path(self, site: int) -> str:
        body = self.model.site_bodyid[site]
        alone = [self.model.site_bodyid[other] for other in self._thrust].count(body) == 1
        # Several on one body are named after their columns, such as thrust_1.
        return f"{self._paths[body]}/{'thrust' if alone else self._thrust[site]}"

    def _followed(self) -> Iterator[tuple[str, str, Assembly]]:
        """Entity, prefix and assembly of each vehicle that follows a position."""
        for prefix, own in self._vehicles.items():
            if own.follows_position:
                yield f"{self.root}/{prefix}reference", prefix, own

    def draw_references(self, end: float) -> None:
        """Log the paths of the references of positions up to a time (s)."""
        for path, _, own in self._followed():
            points = replay.reference_path(own, end, REFERENCE_POINTS)
            now = rr.Points3D.from_fields(colors=[timeline.WHITE], radii=[DOT])
            self._log(f"{path}/now", now)
            if np.ptp(points, axis=0).max() > 0.0:
                line = rr.LineStrips3D([points], colors=[timeline.GREY], radii=[REFERENCE_WIDTH])
                self._log(f"{path}/path", line)


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
