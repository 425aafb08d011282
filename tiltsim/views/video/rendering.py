"""Frames of a flight, their MP4 (by PyAV) or animated GIF (by Pillow), and portraits of vehicles.

The camera follows the vehicle with its thrusts and trail.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import Final

import mujoco
import numpy as np
from PIL import Image as Pillow

from tiltsim.flight.flight import Flight
from tiltsim.models.cables import switch
from tiltsim.system.files import replacing
from tiltsim.views import replay
from tiltsim.views.replay import CameraPose, vehicle_radius
from tiltsim.views.video.offscreen import Canvas, Caption, Image, Overlay
from tiltsim_controllers.mathematics.scalar import Floats

TRAIL_TIME: Final = 20.0  # s, length of the trail
TRAIL_INTERVAL: Final = 0.1  # s between its points
TRAIL_COLOR: Final = (0.0, 0.45, 0.85)
REFERENCE_COLOR: Final = (0.15, 0.16, 0.18)
THRUST_COLOR: Final = (0.95, 0.80, 0.10)
REFERENCE_POINTS: Final = 600
ARROW: Final = mujoco.mjtGeom.mjGEOM_ARROW
LINE: Final = mujoco.mjtGeom.mjGEOM_CYLINDER
"""Drawn as a box, which has a hundredth of the triangles and looks the same when it is thin."""


Color = tuple[float, float, float, float]

H264_QUALITY: Final = "21"  # constant rate factor: 18 is visually lossless, 28 coarse
COLORS: Final = 255  # of a GIF's 256; one is left for pixels that do not change
PALETTE_FRAMES: Final = 6  # evenly spaced frames from which the colors of a GIF are chosen
PORTRAIT_SIZE: Final = (720, 480)  # pixels
PORTRAIT_ANGLES: Final = (50.0, -28.0)  # azimuth and elevation of the camera's direction, degrees
PORTRAIT_DISTANCE: Final = 2.5  # of the camera, by the radius of the rotors' places and of a rotor
ROTOR_RADIUS: Final = 0.12  # about the radius of the rotors in the files, m


@dataclass(frozen=True)
class VideoFormat:
    """Size, rate and part of the flight of a video."""

    width: int = 640  # pixels
    height: int = 360
    fps: int = 25  # frames per second
    speed: float = 1.0  # seconds of flight per second of video
    start: float = 0.0  # s of the flight
    end: float = inf  # s, or the end of the flight if that is earlier
    camera: CameraPose | None = None  # None for the default of the vehicle's kind
    samples: int = 4  # per pixel, against jagged edges; 0 for none
    shadows: bool = False  # and reflections


QUALITIES: Final = {
    "draft": VideoFormat(fps=15, samples=0),
    "standard": VideoFormat(),
    "high": VideoFormat(1280, 720, 30, samples=8, shadows=True),
}
"""Without a GPU, a frame takes about 0.04, 0.09 and 0.4 s of processor time."""


def frame_times(flight: Flight, video: VideoFormat) -> Floats:
    """The times (s) of the frames of a flight's video."""
    end = min(float(flight["time"][-1]), video.end)
    return np.arange(video.start, end + 1e-9, video.speed / video.fps)


def frames(
    flight: Flight, video: VideoFormat, times: Floats | None = None
) -> Iterator[tuple[float, Image]]:
    """The frames of a flight's video, or at the given times, with the times (s) of the samples."""
    time = flight["time"]
    renderer = FlightRenderer(flight, video)
    with renderer.canvas:
        for frame_time in frame_times(flight, video) if times is None else times:
            sample = min(int(np.searchsorted(time, frame_time - 1e-9)), len(time) - 1)
            yield float(time[sample]), renderer.frame(sample)


class FlightRenderer:
    """Renders the samples of one flight, or of several of one vehicle."""

    def __init__(self, flight: Flight, video: VideoFormat) -> None:
        self._video = video
        self._speed = "" if video.speed == 1.0 else f", {video.speed:g}x"
        self._model = model = replay.visible_model(flight.assembly)
        self._data = mujoco.MjData(model)
        self._radius = replay.vehicle_radius(model)
        self._arrow_scale = replay.thrust_scale(model)
        self.show(flight)
        self.canvas = Canvas(
            model, video.width, video.height, samples=video.samples, shadows=video.shadows
        )

    def show(self, flight: Flight) -> None:
        """Render this flight of the same vehicle from now on."""
        self._flight = flight
        self._qpos = replay.joint_positions(self._model, flight.columns)
        vehicles = replay.by_prefix(flight.assembly)
        followed = {prefix: own for prefix, own in vehicles.items() if own.follows_position}
        self._references, end = [], float(flight["time"][-1])
        for own in followed.values():
            path = replay.reference_path(own, end, REFERENCE_POINTS)
            self._references.append(path if np.ptp(path, axis=0).max() > 0.0 else path[:1])
        self._targets = [replay.positions(flight.columns, prefix, "_ref") for prefix in followed]
        self._positions = [replay.positions(flight.columns, prefix) for prefix in vehicles]
        self._overlay = Overlay(flight, self._video.height)
        self._cables = flight.scenario.cable
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        self._camera.trackbodyid = replay.first_free_body(self._model)
        pose = self._video.camera or replay.camera_of(flight.scenario)
        near = replay.seen_radius(flight.scenario, self._model)
        self._camera.distance = pose.distance * (self._radius if self._video.camera else near)
        self._model.tendon_width[:] = 0.002 * self._camera.distance  # some two pixels
        self._camera.azimuth, self._camera.elevation = pose.azimuth, pose.elevation

    def frame(self, sample: int) -> Image:
        """The frame of a sample."""
        model, data = self._model, self._data
        data.qpos = self._qpos[sample]
        switch(model, self._cables, float(self._flight["time"][sample]))
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        mujoco.mj_camlight(model, data)
        self.canvas.compose(data, self._camera)
        for site, column in replay.thrust_sites(model).items():
            start, axis = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)[:, 2]
            end = start + axis * self._arrow_scale * self._flight[column][sample]
            self._connect(ARROW, 0.035 * self._radius, start, end, (*THRUST_COLOR, 1.0))
        for path, target in zip(self._references, self._targets, strict=True):
            for start, end in pairwise(path):
                self._connect(LINE, 0.012 * self._radius, start, end, (*REFERENCE_COLOR, 0.6))
            geom = self._new_geom(mujoco.mjtGeom.mjGEOM_SPHERE, (*REFERENCE_COLOR, 0.9))
            if geom is not None:
                geom.size, geom.pos = np.full(3, 0.07 * self._radius), target[sample]
        for position in self._positions:
            self._add_trail(position, sample)
        names, values = self._table(sample)
        image = np.ascontiguousarray(self.canvas.draw(names, values, self._overlay.caption))
        self._overlay.paint(image, sample)
        return image

    def _table(self, sample: int) -> tuple[str, str]:
        rows = {
            "time": f"{self._flight['time'][sample]:.1f} s{self._speed}",
            **self._overlay.rows(sample),
        }
        if self._flight.assembly.follows_position:
            error = self._targets[0][sample] - self._positions[0][sample]
            rows["position error"] = f"{np.linalg.norm(error):.3f} m"
        return "\n".join(rows), "\n".join(rows.values())

    def _add_trail(self, position: Floats, sample: int) -> None:
        time = self._flight["time"]
        now = time[sample]
        steps = np.arange(max(0.0, now - TRAIL_TIME), now, TRAIL_INTERVAL) / TRAIL_INTERVAL
        # Points at fixed times, so that the trail does not shimmer.
        samples = np.searchsorted(time, np.ceil(steps) * TRAIL_INTERVAL)
        points = position[np.append(samples[samples < sample], sample)]
        shades = np.linspace(0.15, 0.95, len(points))
        for (start, end), shade in zip(pairwise(points), shades, strict=False):
            self._connect(LINE, 0.02 * self._radius, start, end, (*TRAIL_COLOR, shade))

    def _connect(
        self, shape: mujoco.mjtGeom, width: float, start: Floats, end: Floats, rgba: Color
    ) -> None:
        geom = self._new_geom(shape, rgba)
        if geom is not None:
            mujoco.mjv_connector(geom, shape, width, start, end)
            geom.type = mujoco.mjtGeom.mjGEOM_BOX if shape == LINE else shape
            if shape == ARROW:
                geom.size[2] *= 2.0  # MuJoCo draws arrows at half the length that it sets
                geom.emission = 0.4

    def _new_geom(self, shape: mujoco.mjtGeom, rgba: Color) -> mujoco.MjvGeom | None:
        """One more geom in the scene; None if it is full."""
        scene = self.canvas.scene
        if scene.ngeom >= scene.maxgeom:
            return None
        scene.ngeom += 1
        geom = scene.geoms[scene.ngeom - 1]
        colors = np.array(rgba, dtype=np.float32)
        mujoco.mjv_initGeom(geom, shape, np.zeros(3), np.zeros(3), np.eye(3).ravel(), colors)
        return geom


def write_video(
    flight: Flight,
    path: Path,
    video: VideoFormat,
    progress: Callable[[int], None] = lambda frames: None,
) -> None:
    """Write a video of a flight, atomically, in the format of its suffix, ``.mp4`` or ``.gif``.

    Args:
        flight: The flight.
        path: The file.
        video: Size, rate and part of the flight.
        progress: Called with the number of finished frames.

    Raises:
        InputError: If no OpenGL implementation works or the file cannot be written.
    """
    write = WRITERS[path.suffix.lower()]
    with replacing(path) as temporary:
        write(flight, temporary, video, progress)


def _write_mp4(
    flight: Flight, path: Path, video: VideoFormat, progress: Callable[[int], None]
) -> None:
    import av

    with av.open(str(path), "w", format="mp4") as file:
        stream = file.add_stream("libx264", rate=video.fps)
        stream.width, stream.height = video.width, video.height
        stream.pix_fmt = "yuv420p"  # the format that every player supports
        stream.options = {"crf": H264_QUALITY, "preset": "medium"}
        for count, (_, image) in enumerate(frames(flight, video), start=1):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            file.mux(stream.encode(frame))
            progress(count)
        file.mux(stream.encode(None))


def _write_gif(
    flight: Flight, path: Path, video: VideoFormat, progress: Callable[[int], None]
) -> None:
    times = frame_times(flight, video)
    chosen = times[np.linspace(0, len(times) - 1, PALETTE_FRAMES).astype(int)]
    together = Pillow.fromarray(
        np.concatenate([image for _, image in frames(flight, video, chosen)])
    )
    # Median cut spends colors on the ground, maximum coverage on rare ones; an octree keeps both.
    palette = together.quantize(COLORS, Pillow.Quantize.FASTOCTREE)
    # Without dithering, areas of one color stay equal in all frames, and the file stays small.
    pictures = []
    for count, (_, image) in enumerate(frames(flight, video), start=1):
        picture = Pillow.fromarray(image)
        pictures.append(picture.quantize(palette=palette, dither=Pillow.Dither.NONE))
        progress(count)
    # Delays are in hundredths of a second; rounded one by one they would change the speed.
    ends = np.rint(np.arange(len(pictures) + 1) * 100.0 / video.fps)
    delays = [10 * int(end - start) for start, end in pairwise(ends)]
    first, *others = pictures
    first.save(
        path, "GIF", save_all=True, append_images=others, duration=delays, loop=0, optimize=False
    )


WRITERS: Final = {".mp4": _write_mp4, ".gif": _write_gif}  # by the suffix of the file


def save_portrait(model_file: Path, angles: Sequence[float], file: Path) -> None:
    """Render an MJCF file as a PNG, from behind and above, at tilt angles (rad)."""
    model = mujoco.MjModel.from_xml_path(str(model_file))
    data = mujoco.MjData(model)
    data.qpos[7:] = angles
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.distance = PORTRAIT_DISTANCE * (vehicle_radius(model) + ROTOR_RADIUS)
    camera.azimuth, camera.elevation = PORTRAIT_ANGLES
    with Canvas(model, *PORTRAIT_SIZE, samples=8, shadows=True) as canvas:
        canvas.compose(data, camera)
        image = canvas.draw("", "", Caption("", 0, 0))
    Pillow.fromarray(np.ascontiguousarray(image)).save(file, optimize=True)
