"""A film of a flight: the vehicle with its thrust and trail, followed by the camera."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np

from tiltsim.errors import InputError
from tiltsim.system.files import replacing
from tiltsim.views.replay import (
    first_free_body,
    joint_positions,
    positions,
    reference_path,
    reference_positions,
    thrust_scale,
    thrust_sites,
    vehicle_radius,
    visible_model,
)
from tiltsim.views.video.offscreen import Canvas, Image
from tiltsim.views.video.overlay import aspect_of
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight

TRAIL_TIME: Final = 20.0  # s of the flight that the trail shows
TRAIL_INTERVAL: Final = 0.1  # s between its corners
TRAIL_COLOR: Final = (0.0, 0.45, 0.85)
REFERENCE_COLOR: Final = (0.15, 0.16, 0.18)
THRUST_COLOR: Final = (0.95, 0.80, 0.10)
REFERENCE_POINTS: Final = 200

QUALITY: Final = "21"  # H.264's constant rate factor: 18 is lossless to the eye, 28 coarse


@dataclass(frozen=True)
class Format:
    """Size of the frames (pixels), frames per second, and seconds of flight per second of film."""

    width: int = 960
    height: int = 540
    fps: int = 30
    speed: float = 1.0


def write_video(
    flight: Flight,
    path: Path,
    form: Format = Format(),
    advance_to: Callable[[float], None] | None = None,
) -> None:
    """Write a flight as an MP4 film; the file appears whole or not at all.

    ``advance_to`` is called with the time (s) of every frame. Raises `InputError` where there is
    no OpenGL to draw with or the file cannot be written.
    """
    import av

    try:
        with replacing(path) as temporary, av.open(str(temporary), "w", format="mp4") as film:
            stream = film.add_stream("libx264", rate=form.fps)
            stream.width, stream.height = form.width, form.height
            stream.pix_fmt = "yuv420p"  # what every player shows
            stream.options = {"crf": QUALITY, "preset": "medium"}
            for time, image in frames(flight, form):
                frame = av.VideoFrame.from_ndarray(image, format="rgb24")
                film.mux(stream.encode(frame))
                if advance_to is not None:
                    advance_to(time)
            film.mux(stream.encode(None))
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error


def moments(flight: Flight, form: Format) -> Floats:
    """The times of the flight (s) that the frames of the film are to show."""
    return np.arange(0.0, float(flight["time"][-1]) + 1e-9, form.speed / form.fps)


def frames(flight: Flight, form: Format) -> Iterator[tuple[float, Image]]:
    """The frames of the film and their times (s), one after the other."""
    time = flight["time"]
    scene = _Stage(flight, form)
    with scene.canvas:
        for moment in moments(flight, form):
            sample = min(int(np.searchsorted(time, moment - 1e-9)), len(time) - 1)
            yield float(time[sample]), scene.frame(sample)


class _Stage:
    """Everything that is drawn of one flight."""

    def __init__(self, flight: Flight, form: Format) -> None:
        self._flight = flight
        self._pace = "" if form.speed == 1.0 else f", {form.speed:g}x"
        self._model = model = visible_model(flight.assembly)
        self._data = mujoco.MjData(model)
        self._qpos = joint_positions(model, flight.columns)
        self._body = first_free_body(model)
        self._radius = vehicle_radius(model)
        self._arrow_scale = thrust_scale(model)
        self._reference: Floats | None = None
        if flight.assembly.follows_position:
            path = reference_path(flight.assembly, float(flight["time"][-1]), REFERENCE_POINTS)
            self._reference = path if np.ptp(path, axis=0).max() > 0.0 else path[:1]
        self._targets = reference_positions(flight.columns)
        self._position = positions(flight.columns)
        self._aspect = aspect_of(flight, form.height)
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        self._camera.trackbodyid = self._body
        eye = self._aspect.eye
        self._camera.distance = eye.distance * self._radius
        self._camera.azimuth, self._camera.elevation = eye.azimuth, eye.elevation
        self.canvas = Canvas(model, form.width, form.height)

    def frame(self, sample: int) -> Image:
        """The frame of a sample."""
        model, data = self._model, self._data
        data.qpos = self._qpos[sample]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)
        self.canvas.compose(data, self._camera)
        self._add_thrusts(sample)
        self._add_reference(sample)
        self._add_trail(sample)
        names, values = self._table(sample)
        image = np.ascontiguousarray(self.canvas.draw(names, values, self._aspect.caption))
        self._aspect.paint(image, sample)
        return image

    def _table(self, sample: int) -> tuple[str, str]:
        rows = {
            "time": f"{self._flight['time'][sample]:.1f} s{self._pace}",
            **self._aspect.rows(sample),
        }
        if self._reference is not None:
            error = self._targets[sample] - self._position[sample]
            rows["position error"] = f"{np.linalg.norm(error):.2f} m"
        return "\n".join(rows), "\n".join(rows.values())

    def _add_thrusts(self, sample: int) -> None:
        data = self._data
        for site, column in thrust_sites(self._model).items():
            axis = data.site_xmat[site].reshape(3, 3)[:, 2]
            start = data.site_xpos[site]
            end = start + axis * self._arrow_scale * self._flight[column][sample]
            arrow = mujoco.mjtGeom.mjGEOM_ARROW
            self._connect(arrow, 0.035 * self._radius, start, end, (*THRUST_COLOR, 1.0))

    def _add_reference(self, sample: int) -> None:
        if self._reference is None:
            return
        line, color = mujoco.mjtGeom.mjGEOM_CAPSULE, (*REFERENCE_COLOR, 0.6)
        for start, end in zip(self._reference[:-1], self._reference[1:], strict=True):
            self._connect(line, 0.012 * self._radius, start, end, color)
        place = self._targets[sample]
        scene = self.canvas.scene
        if scene.ngeom < scene.maxgeom:
            size = np.full(3, 0.07 * self._radius)
            rgba = np.array((*REFERENCE_COLOR, 0.9), dtype=np.float32)
            ball = mujoco.mjtGeom.mjGEOM_SPHERE
            mujoco.mjv_initGeom(
                scene.geoms[scene.ngeom], ball, size, place, np.eye(3).ravel(), rgba
            )
            scene.ngeom += 1

    def _add_trail(self, sample: int) -> None:
        time, places = self._flight["time"], self._position
        now = time[sample]
        moments = np.arange(max(0.0, now - TRAIL_TIME), now, TRAIL_INTERVAL)
        # Corners at fixed times, lest the trail crawl from frame to frame.
        corners = np.searchsorted(time, np.ceil(moments / TRAIL_INTERVAL) * TRAIL_INTERVAL)
        points = places[np.append(corners[corners < sample], sample)]
        shades = np.linspace(0.15, 0.95, len(points))
        line = mujoco.mjtGeom.mjGEOM_CAPSULE
        for start, end, shade in zip(points[:-1], points[1:], shades, strict=False):
            self._connect(line, 0.02 * self._radius, start, end, (*TRAIL_COLOR, shade))

    def _connect(
        self,
        shape: mujoco.mjtGeom,
        width: float,
        start: Floats,
        end: Floats,
        rgba: tuple[float, float, float, float],
    ) -> None:
        scene = self.canvas.scene
        if scene.ngeom >= scene.maxgeom:
            return
        geom = scene.geoms[scene.ngeom]
        colors = np.array(rgba, dtype=np.float32)
        mujoco.mjv_initGeom(geom, shape, np.zeros(3), np.zeros(3), np.zeros(9), colors)
        mujoco.mjv_connector(geom, shape, width, start, end)
        if shape == mujoco.mjtGeom.mjGEOM_ARROW:
            geom.size[2] *= 2.0  # MuJoCo draws arrows at half the length it sets
            geom.emission = 0.4
        scene.ngeom += 1
