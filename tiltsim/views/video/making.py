"""A video of a flight in one call: options checked, then rendered and written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from os import PathLike, fsdecode
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.scenario.messages import choose
from tiltsim.system.files import prepare_file
from tiltsim.system.numbers import is_finite
from tiltsim.system.progress import Report, reported
from tiltsim.system.text import short_repr
from tiltsim.views.video import prefer_offscreen_gl

if TYPE_CHECKING:
    from tiltsim.views.video.rendering import VideoFormat

FORMATS: Final = (".mp4", ".gif")
GIF_MAX_FPS: Final = 50
"""Browsers slow down GIFs with shorter delays."""


def video(
    flight: Flight,
    path: str | PathLike[str],
    *,
    start: float = 0.0,
    end: float | None = None,
    speed: float = 1.0,
    quality: str = "standard",
    size: tuple[int, int] | None = None,
    fps: int | None = None,
    camera: tuple[float, float, float] | None = None,
    progress: Report | bool | None = None,
) -> Path:
    """Render a flight with MuJoCo, the camera following the vehicle; no screen is needed.

    Args:
        flight: The flight.
        path: The file, FILE.mp4 or FILE.gif.
        start, end: The part of the flight, s; default: all of it.
        speed: Times real time, 0.01 to 100.
        quality: ``"draft"`` (640 x 360 pixels, 15 frames per second, jagged edges),
            ``"standard"`` (640 x 360, 25) or ``"high"`` (1280 x 720, 30, with shadows).
        size: Width and height in place of the quality's, pixels, even numbers from 64 to 4096.
        fps: Frames per second in place of the quality's, 1 to 240.
        camera: Its distance from the vehicle, in radii of it from 1.5 to 1000, azimuth and
            elevation, degrees.
        progress: True for a bar; or a function, called with the number of finished frames.

    Returns:
        The file.

    Raises:
        InputError: If an argument is wrong, no OpenGL implementation works, or the file cannot be
            written.
    """
    options: dict[str, Any] = {"start": start, "end": end, "speed": speed, "quality": quality}
    options |= {"size": size, "fps": fps, "camera": camera}
    if not isinstance(flight, Flight):
        raise InputError(f"flight = {short_repr(flight)}: must be a tiltsim.Flight")
    if not isinstance(path, str | PathLike):
        raise InputError(f"path = {short_repr(path)}: must be the name of a file")
    file = Path(fsdecode(path))
    chosen = video_format(flight, file, options)
    from tiltsim.views.video.encoding import write_video
    from tiltsim.views.video.rendering import frame_times

    with reported(progress, "frames", len(frame_times(flight, chosen))) as report:
        write_video(flight, file, chosen, report)
    return file


def video_format(
    flight: Flight, path: Path, options: dict[str, Any], prefix: str = ""
) -> VideoFormat:
    """The video that the arguments of `video` ask for.

    Args:
        flight, path: See there.
        options: Its other arguments by name.
        prefix: Before their names in messages.

    Raises:
        InputError: If an argument is wrong or the file cannot be written.
    """
    prepare_file(f"{prefix}out" if prefix else "video", path, FORMATS)
    prefer_offscreen_gl()  # before anything imports MuJoCo
    return _format(_Options(options, prefix), float(flight["time"][-1]), path.suffix.lower())


class _Options:
    """The options of a video, checked one by one."""

    def __init__(self, values: dict[str, Any], prefix: str) -> None:
        self._values, self._prefix = values, prefix

    def given(self, name: str) -> Any:
        """The value; None if it is not given."""
        return self._values.get(name)

    def mistake(self, name: str, allowed: str) -> InputError:
        """The error for a value that is not allowed."""
        value = self._values[name]
        shown = f"{value:g}" if isinstance(value, float) else short_repr(value)
        return InputError(f"{self._prefix}{name} {shown}: {allowed}")

    def number(self, name: str, least: float, most: float = inf) -> float:
        """A number in a range."""
        value = self._values[name]
        allowed = f"from {least:g} to {most:g}" if most < inf else f"of at least {least:g}"
        if not (is_finite(value) and least <= value <= most):
            raise self.mistake(name, f"must be a number {allowed}")
        return float(value)

    def several(self, name: str, ranges: Sequence[tuple[float, float]], allowed: str) -> Any:
        """Some numbers, each in its range."""
        values = self._values[name]
        fits = isinstance(values, list | tuple) and len(values) == len(ranges)
        if not fits or not all(
            is_finite(value) and low <= value <= high
            for value, (low, high) in zip(values, ranges, strict=True)
        ):
            raise self.mistake(name, allowed)
        return values


def _format(options: _Options, flight_end: float, suffix: str) -> VideoFormat:
    """The video that the options ask for. Raises `InputError` if that is impossible."""
    from tiltsim.views.video.overlay import CameraPose
    from tiltsim.views.video.rendering import QUALITIES

    quality = options.given("quality")
    if not isinstance(quality, str) or quality not in QUALITIES:
        raise options.mistake("quality", choose(quality, QUALITIES))
    base = QUALITIES[quality]
    start, end = options.number("start", 0.0), inf
    if options.given("end") is not None:
        end = options.number("end", 0.0)
    if flight_end == 0.0:
        raise InputError("the flight ended at 0 s, so that there is nothing to show")
    if start >= min(flight_end, end):
        reason = f"is not before the end {end:g}" if end < flight_end else "is not in it"
        raise options.mistake("start", f"{reason}; the flight ends at {flight_end:g} s")
    width, height = base.width, base.height
    if options.given("size") is not None:
        allowed = "must be even numbers of pixels from 64 to 4096, such as 1280 and 720"
        width, height = options.several("size", [(64, 4096)] * 2, allowed)
        if not all(isinstance(side, int) and side % 2 == 0 for side in (width, height)):
            raise options.mistake("size", allowed)
    fps = base.fps
    if options.given("fps") is not None:
        fps = round(options.number("fps", 1, 240))
    if suffix == ".gif" and fps > GIF_MAX_FPS:
        raise options.mistake("fps", f"a GIF has at most {GIF_MAX_FPS} frames per second")
    pose = None
    if options.given("camera") is not None:
        ranges = [(1.5, 1000.0), (-360.0, 360.0), (-90.0, 90.0)]
        allowed = "must be vehicle radii from 1.5 to 1000 and two angles in degrees"
        pose = CameraPose(*options.several("camera", ranges, f"{allowed}, such as 7.5, 130, -24"))
    return replace(
        base,
        width=width,
        height=height,
        fps=fps,
        speed=options.number("speed", 0.01, 100.0),
        start=start,
        end=end,
        camera=pose,
    )
