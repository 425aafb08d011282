"""Videos: frames that show the flight, a file that plays, one line if nothing can render."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import time
from ctypes.util import find_library
from functools import cache

import mujoco
import numpy as np
import pytest
from PIL import Image
from PIL.ImageSequence import Iterator

from tests.flights import flight, saved
from tests.refusals import refusal
from tiltsim.cli import main
from tiltsim.errors import InputError
from tiltsim.views.attitude_plane import MOVING_TRAIL_TIME, torque_free_directions
from tiltsim.views.video import has_display, offscreen, rendering
from tiltsim.views.video.offscreen import Overlay, make_contexts, overlay_inset
from tiltsim.views.video.rendering import (
    FlightRenderer,
    VideoFormat,
    frame_times,
    frames,
    write_video,
)
from tiltsim_controllers.vehicle.parameters import PRESETS

SMALL = VideoFormat(width=320, height=180, fps=10, speed=2.0)


NOTHING = mujoco.MjModel.from_xml_string("<mujoco/>")


def missing_gl():
    try:
        gl, context = make_contexts(NOTHING, 64, 64)
    except InputError as error:
        return str(error)
    context.free()
    gl.free()
    return ""


needs_gl = pytest.mark.skipif(bool(missing_gl()), reason=missing_gl())


# --- the corner --------------------------------------------------------------------------------


def plane(angles, attitude=(0.0, 0.0), margin=1.0, size=101):
    columns = {f"alpha_{i}": np.array([angle]) for i, angle in enumerate(angles, start=1)}
    n = torque_free_directions(columns, PRESETS["ar_drone_2"])[0]
    return offscreen.plane(size, n, 1.0, np.array([attitude]), near=margin < 0.2)


def color_at(image, roll, pitch):
    half = (len(image) - 1) / 2
    row, column = half * (1 - pitch / (np.pi / 2)), half * (1 + roll / (np.pi / 2))
    return tuple(image[round(row), round(column)].tolist())


def test_the_inset_shades_unreachable_attitudes():
    image = plane((-0.65, -0.65, 0.65, 0.65))
    assert color_at(image, 0.3, -1.45) == offscreen.UNREACHABLE
    assert color_at(image, 0.3, 0.6) == offscreen.GROUND
    assert color_at(plane((0.0, 0.0, 0.0, 0.0)), 0.3, -1.45) == offscreen.GROUND


def test_the_inset_has_the_attitude_with_pitch_upwards():
    assert color_at(plane((0.0,) * 4, (0.5, 0.8)), 0.5, 0.8) == offscreen.ATTITUDE
    assert color_at(plane((0.0,) * 4, (0.5, 0.8), margin=0.1), 0.5, 0.8) == offscreen.CURVE
    beyond = plane((0.0,) * 4, (3.0, 0.0))
    assert offscreen.ATTITUDE in {tuple(pixel) for pixel in beyond[50, -5:-1].tolist()}


def test_an_inset_covers_only_its_corner():
    frame = np.zeros((100, 100, 3), dtype=np.uint8)
    overlay_inset(frame, np.full((30, 30, 3), 200, dtype=np.uint8), 5)
    assert frame[70, 70].min() > 150
    assert frame[:65].max() == frame[:, :65].max() == frame[95:].max() == 0


@pytest.mark.parametrize(("name", "whole"), [("fixed", True), ("trot", False)])
def test_the_insets_trail_is_short_if_the_curve_moves(name, whole, monkeypatch):
    this, trails = flight(name), []
    monkeypatch.setattr(offscreen, "plane", lambda *given, near: trails.append(given[3]))
    monkeypatch.setattr(offscreen, "overlay_inset", lambda *_: None)
    last = len(this) - 1
    Overlay(this, 180).paint(np.zeros((180, 320, 3), dtype=np.uint8), last)
    began = 0.0 if whole else this["time"][last] - MOVING_TRAIL_TIME
    (first,) = np.flatnonzero(np.isclose(this["time"], began))
    np.testing.assert_array_equal(trails[0][0], [this["roll"][first], this["pitch"][first]])


# --- frames and videos -------------------------------------------------------------------------


@cache
def rendered_frames():
    return [*frames(flight("trot"), SMALL)]


@needs_gl
def test_frames_come_at_the_videos_rate_and_show_motion():
    shown = rendered_frames()
    times = [time for time, _ in shown]
    np.testing.assert_allclose(times, np.arange(0.0, 1.2 + 1e-9, 0.2), atol=0.011)
    images = [image for _, image in shown]
    assert {image.shape for image in images} == {(180, 320, 3)}
    assert all(image.std() > 10.0 for image in images)
    assert np.abs(images[0].astype(int) - images[-1]).mean() > 1.0


@pytest.mark.parametrize(
    ("speed", "clock"), [(1.0, "1.2 s"), (10.0, "1.2 s, 10x"), (0.5, "1.2 s, 0.5x")]
)
def test_a_video_faster_or_slower_than_the_flight_says_so(speed, clock, monkeypatch):
    monkeypatch.setattr(rendering, "Canvas", lambda *_, **__: None)
    stage = FlightRenderer(flight("fixed"), VideoFormat(width=320, height=180, speed=speed))
    names, values = stage._table(-1)
    assert names.splitlines()[0] == "time"
    assert values.splitlines()[0] == clock


@needs_gl
def test_every_flight_can_be_rendered():
    for name in ("limited", "free"):
        stage = FlightRenderer(flight(name), SMALL)
        with stage.canvas as canvas:
            assert stage.frame(len(flight(name)) - 1).std() > 10.0
            geoms = canvas.scene.geoms[: canvas.scene.ngeom]
        own = {geom.type for geom in geoms if geom.objtype != mujoco.mjtObj.mjOBJ_GEOM}
        # Cylinders have a hundred times the triangles: without a GPU, most of a frame's time.
        assert mujoco.mjtGeom.mjGEOM_BOX in own
        assert not own & {mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER}


@needs_gl
def test_an_arrow_is_drawn_as_long_as_a_line_between_the_same_ends():
    """MuJoCo draws arrows at half the length that it sets; this fails when that changes."""
    words = ("", "", offscreen.Caption("", 0, 0))
    camera = mujoco.MjvCamera()
    camera.distance, camera.elevation = 2.0, 0.0
    start, end = np.array([0.0, 0.0, -0.3]), np.array([0.0, 0.0, 0.3])
    heights = []
    stage = FlightRenderer(flight("fixed"), VideoFormat(width=400, height=400))
    with stage.canvas as canvas:
        canvas.compose(stage._data, camera)
        canvas.scene.ngeom = 0
        blank = canvas.draw(*words).astype(int)
        for shape in (mujoco.mjtGeom.mjGEOM_ARROW, mujoco.mjtGeom.mjGEOM_CAPSULE):
            canvas.scene.ngeom = 0
            stage._connect(shape, 0.008, start, end, (1.0, 0.0, 0.0, 1.0))
            drawn = canvas.draw(*words).astype(int)
            rows = np.flatnonzero(np.abs(drawn - blank).sum(axis=2).any(axis=1))
            heights.append(rows[-1] - rows[0])
    assert heights[0] == pytest.approx(heights[1], rel=0.08)


@needs_gl
def test_the_video_plays(tmp_path, monkeypatch):
    import av

    path = tmp_path / "flight.mp4"
    counts = []
    monkeypatch.setattr(rendering, "frames", lambda *_: rendered_frames())
    write_video(flight("trot"), path, SMALL, counts.append)
    assert [file.name for file in tmp_path.iterdir()] == ["flight.mp4"]
    with av.open(str(path)) as video:
        stream = video.streams.video[0]
        pictures = [frame.to_ndarray(format="rgb24") for frame in video.decode(stream)]
        assert (stream.width, stream.height, stream.average_rate) == (320, 180, 10)
        assert stream.codec_context.name == "h264"
    assert len(pictures) == 7
    assert counts == list(range(1, 8))
    assert pictures[-1].std() > 10.0


def test_a_gif_repeats_at_the_videos_speed_in_the_frames_colors(tmp_path, monkeypatch):
    """One palette for all frames: many pixels of gray shades, few of the vehicle's orange."""
    video = dataclasses.replace(SMALL, fps=7, speed=1.4)
    rendered = []
    for number in range(7):
        image = np.repeat(np.linspace(90, 160, 64).astype(np.uint8), 64 * 3).reshape(64, 64, 3)
        image[8 * number : 8 * number + 4, :4] = (213, 94, 0)
        rendered.append((0.2 * number, image))
    monkeypatch.setattr(rendering, "frames", lambda *_: rendered)
    write_video(flight("fixed"), tmp_path / "flight.gif", video)
    with Image.open(tmp_path / "flight.gif") as gif:
        assert (gif.size, gif.info["loop"], gif.n_frames) == ((64, 64), 0, 7)
        frames = [(f.info["duration"], np.array(f.convert("RGB"))) for f in Iterator(gif)]
    assert sum(delay for delay, _ in frames) == 1000  # ms; 1000 / 7 is no delay of a GIF
    assert {delay for delay, _ in frames} == {140, 150}
    for (_, image), (_, original) in zip(frames, rendered):
        assert np.abs(image.astype(int) - original).max() <= 8


def test_a_video_may_show_a_part_of_the_flight():
    this = flight("trot")  # 1.2 s
    video = dataclasses.replace(SMALL, start=0.3, end=0.75, speed=1.0)
    np.testing.assert_allclose(frame_times(this, video), [0.3, 0.4, 0.5, 0.6, 0.7])
    np.testing.assert_allclose(frame_times(this, dataclasses.replace(video, end=9.0))[-1], 1.2)


@pytest.mark.slow
@needs_gl
def test_the_command_works_without_a_display(tmp_path):
    folder = saved("fixed", tmp_path)
    options = ["--size", "160x120", "--fps", "5", "--speed", "4"]
    environment = {"PATH": "", "PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-m", "tiltsim", "video", str(folder), *options],
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0
    progress = "tiltsim: frames: "  # on a busy machine
    assert all(line.startswith(progress) for line in done.stderr.splitlines())
    assert done.stdout == f"video written to {folder / 'flight.mp4'}\n"
    assert b"ftyp" in (folder / "flight.mp4").read_bytes()[:12]


# --- errors ------------------------------------------------------------------------------------


@pytest.mark.slow
@needs_gl
def test_a_terminated_command_leaves_no_file(tmp_path):
    folder = saved("fixed", tmp_path)
    before = sorted(folder.iterdir())
    options = ["--speed", "0.01", "--size", "160x120", "--quality", "draft"]
    command = [sys.executable, "-m", "tiltsim", "video", str(folder), *options]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        while sorted(folder.iterdir()) == before and process.poll() is None:
            time.sleep(0.02)
        process.terminate()
        _, error = process.communicate(timeout=300.0)
    assert (process.returncode, error.splitlines()[-1]) == (143, "tiltsim: interrupted")
    assert sorted(folder.iterdir()) == before


def test_a_missing_opengl_is_one_line_with_the_remedy(monkeypatch):
    if sys.platform != "linux":
        pytest.skip("elsewhere the system brings OpenGL")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(offscreen, "MODULES", dict.fromkeys(offscreen.MODULES, "mujoco.no_such"))
    line = refusal(make_contexts, NOTHING, 64, 64)
    assert "apt-get install libegl1" in line
    assert "MUJOCO_GL=egl" in line


def test_an_implementation_that_only_warns_is_also_one_line(monkeypatch):
    if sys.platform != "linux" or has_display():
        pytest.skip("for Linux without a screen")
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    with pytest.raises(
        InputError, match=r"no OpenGL implementation works \(glfw: .*; install a driver"
    ):
        make_contexts(NOTHING, 64, 64)


@pytest.mark.parametrize("way", ["nonsense", "osmesa"])
def test_an_invalid_mujoco_gl_is_an_error_of_one_line(way, tmp_path):
    if way == "osmesa" and (sys.platform != "linux" or find_library("OSMesa")):
        pytest.skip("OSMesa is installed")
    command = [sys.executable, "-m", "tiltsim", "run", "ch01_gust/hover#quadrotor", "--quiet"]
    # Rendering in this process has set the second one.
    unset = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"}
    environment = unset | {"MUJOCO_GL": way}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)
    (line,) = done.stderr.splitlines()
    assert (done.returncode, done.stdout) == (2, "")
    assert line.startswith(f"tiltsim: MUJOCO_GL = {way!r}: MuJoCo cannot be loaded with it (")


@pytest.mark.parametrize(
    ("out", "options", "words"),
    [
        ("x.avi", [], "unknown format '.avi'"),
        ("no/x.mp4", [], "does not exist"),
        ("x.mp4", ["--start", "2"], "--start 2: is not in it; the flight ends at 1.2 s"),
        ("x.mp4", ["--start", "0.5", "--end", "0.5"], "--start 0.5: is not before the end 0.5"),
        ("x.gif", ["--fps", "60"], "--fps 60: a GIF has at most 50 frames per second"),
    ],
)
def test_a_video_that_cannot_be_is_one_line_and_exit_code_2(out, options, words, tmp_path, capsys):
    folder = saved("fixed", tmp_path)
    assert main(["video", str(folder), "--out", str(tmp_path / out), *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


@pytest.mark.parametrize("option", [["--size", "a"], ["--camera", "b"], ["--fps", "0.5"]])
def test_options_that_are_no_numbers_are_refused(option, capsys):
    try:
        code = main(["video", "x", *option])
    except SystemExit as refused:  # by the reader of the command line
        code = refused.code
    assert code == 2
    assert option[0] in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("size", (161, 120)),
        ("size", 640),
        ("fps", 0),
        ("speed", 0),
        ("speed", True),
        ("start", -1),
        ("end", float("nan")),
        ("end", "1 s"),
        ("quality", "good"),
        ("camera", (1, 2)),
        ("camera", (7.5, 130, 91)),
    ],
)
def test_arguments_out_of_range_are_refused(name, value, tmp_path):
    with pytest.raises(InputError, match=f"^{name} .*: (must be|choose)"):
        flight("fixed").video(tmp_path / "x.mp4", **{name: value})


def test_a_flight_makes_its_video(tmp_path, monkeypatch):
    made = []
    monkeypatch.setattr(rendering, "write_video", lambda *given: given[3](9) or made.append(given))
    path = tmp_path / "flight.gif"
    counts = []
    options = {"start": 0.2, "end": 1, "fps": 10, "size": (64, 96)}
    assert flight("fixed").video(str(path), **options, progress=counts.append) == path
    ((_, file, video, _),) = made
    assert file == path
    assert (video.start, video.end, video.fps, video.width, video.height) == (0.2, 1, 10, 64, 96)
    assert counts == [9]
