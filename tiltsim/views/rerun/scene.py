"""The 3D scene: the moving vehicle with its thrust arrows, the reference, and their trails."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import mujoco
import numpy as np
import rerun as rr

from tiltsim.views import replay
from tiltsim.views.rerun import timeline
from tiltsim.views.rerun.geometry import body_paths, ground_height, log_geometry, xyzw
from tiltsim.views.rerun.timeline import Trail, send_rows
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.closed_loop.assembly import Assembly
    from tiltsim.flight.flight import Flight
    from tiltsim.views.rerun.timeline import Color

TRAIL_INTERVAL: Final = 0.1  # s between the corners of a trail
REFERENCE_POINTS: Final = 400
TRAIL_WIDTH: Final = -1.5  # negative radii are in screen points, independent of the distance
REFERENCE_WIDTH: Final = -1.0
DOT: Final = -4.0  # of vehicle and reference, visible from any distance
FLOOR_CELL: Final = 1.0  # m
FLOOR_CELLS: Final = 12  # to each side of the vehicle


class Scene:
    """The entities below ``world`` for one flight.

    Args:
        recording: The recording to write to.
        assembly: The assembly of the flight.
        model: The vehicle's model, visual geometry included.
        root: The entity of the scene.
        color: The flight's color.
        name: The label of the vehicle in a comparison; empty for a single flight.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        assembly: Assembly,
        model: mujoco.MjModel,
        root: str,
        color: Color,
        name: str = "",
    ) -> None:
        self._recording = recording
        self._assembly = assembly
        self._model = model
        self._color = color
        self.root = root
        self.camera = f"{root}/camera"  # moves with the vehicle but does not rotate
        self._floor = f"{root}/floor"  # moves with the vehicle in whole cells
        self._paths = body_paths(model, root)
        self.vehicle = self._paths[replay.first_free_body(model)]
        self._trail = Trail(TRAIL_INTERVAL)
        self._thrust = replay.thrust_sites(model)
        self._thrust_scale = replay.thrust_scale(model)
        self._floor_cell: Floats | None = None
        self.not_drawn = log_geometry(recording, model, root)  # geoms that Rerun cannot draw
        self._log_styles(name)

    def _log_styles(self, name: str) -> None:
        """Log static parts, and the looks of moving ones; ``name`` is the vehicle's label."""
        model = self._model
        self._log(self.root.partition("/")[0], rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for body in range(1, model.nbody):
            if not model.body_dofnum[body]:
                translation, quaternion = model.body_pos[body], xyzw(model.body_quat[body])
                pose = rr.Transform3D(translation=translation, quaternion=quaternion)
                self._log(self._paths[body], pose)
        trail = rr.LineStrips3D.from_fields(colors=[self._color], radii=[TRAIL_WIDTH])
        self._log(f"{self.root}/trail", trail)
        look: dict[str, Any] = {"colors": [timeline.YELLOW]}
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
        look = {"radii": [DOT], "colors": [self._color], "labels": [name] if name else None}
        self._log(f"{self.camera}/dot", rr.Points3D([(0.0, 0.0, 0.0)], **look, show_labels=True))

    def append(self, piece: Flight) -> None:
        """Log the next piece of the flight."""
        model, columns, time = self._model, piece.columns, piece["time"]
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
        position = world.position[:, replay.first_free_body(model)]
        follow = rr.Transform3D.columns(translation=position.astype(np.float32))
        send_rows(self._recording, self.camera, time, follow)
        ends, segments = self._trail.extend(time, position)
        if len(ends):
            strips = rr.LineStrips3D.columns(strips=segments.astype(np.float32))
            send_rows(self._recording, f"{self.root}/trail", ends, strips)
        # The grid moves by whole cells, so that it appears fixed and infinite.
        cells = FLOOR_CELL * np.round(position * (1.0, 1.0, 0.0) / FLOOR_CELL)
        before = cells[:1] + 1.0 if self._floor_cell is None else self._floor_cell[np.newaxis]
        moved = np.any(cells != np.concatenate([before, cells[:-1]]), axis=1)
        move = rr.Transform3D.columns(translation=cells[moved].astype(np.float32))
        send_rows(self._recording, self._floor, time[moved], move)
        self._floor_cell = cells[-1]
        if self._assembly.follows_position:
            reference = replay.reference_positions(columns)
            point = rr.Points3D.columns(positions=reference.astype(np.float32))
            send_rows(self._recording, f"{self.root}/reference/now", time, point)

    def _log(self, path: str, *archetypes: Any) -> None:
        self._recording.log(path, *archetypes, static=True)

    def _thrust_path(self, site: int) -> str:
        body = self._model.site_bodyid[site]
        alone = [self._model.site_bodyid[other] for other in self._thrust].count(body) == 1
        # Several on one body are named after their columns, such as thrust_1.
        return f"{self._paths[body]}/{'thrust' if alone else self._thrust[site]}"

    def draw_reference(self, end: float) -> None:
        """Log the path of the reference up to a time (s), if the controller follows a position."""
        if not self._assembly.follows_position:
            return
        path = replay.reference_path(self._assembly, end, REFERENCE_POINTS)
        now = rr.Points3D.from_fields(colors=[timeline.WHITE], radii=[DOT])
        self._log(f"{self.root}/reference/now", now)
        if np.ptp(path, axis=0).max() > 0.0:
            line = rr.LineStrips3D([path], colors=[timeline.GREY], radii=[REFERENCE_WIDTH])
            self._log(f"{self.root}/reference/path", line)
