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
from tiltsim.system.arguments import Report, is_finite, reported
from tiltsim.system.files import prepare_file
from tiltsim.system.text import short_repr
from tiltsim.views.video import prefer_offscreen_gl

if TYPE_CHECKING:
    from tiltsim.views.video.rendering import VideoFormat

FORMATS: Final = (".mp4", ".gif")
GIF_MAX_FPS: Final = 50  # browsers slow down GIFs with shorter delays
RANGES: Final = {"start": (0.0, inf), "end": (0.0, inf), "speed": (0.01, 100.0), "fps": (1, 240)}


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
    from tiltsim.views.video.rendering import frame_times, write_video

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
    from tiltsim.views.replay import CameraPose
    from tiltsim.views.video.rendering import QUALITIES

    def require(name: str, allowed: str, *, fits: bool) -> None:
        if not fits:
            value = options[name]
            shown = f"{value:g}" if isinstance(value, float) else short_repr(value)
            raise InputError(f"{prefix}{name} {shown}: {allowed}")

    quality, size, camera = (options.get(name) for name in ("quality", "size", "camera"))
    known = isinstance(quality, str) and quality in QUALITIES
    require("quality", choose(quality, QUALITIES), fits=known)
    changes = {name: options[name] for name in RANGES if options.get(name) is not None}
    for name, value in changes.items():
        low, high = RANGES[name]
        allowed = f"from {low:g} to {high:g}" if high < inf else f"of at least {low:g}"
        require(name, f"must be a number {allowed}", fits=_fit([value], [RANGES[name]]))
    made = replace(QUALITIES[str(quality)], **changes)
    made = replace(made, fps=round(made.fps))
    flight_end = float(flight["time"][-1])
    if flight_end == 0.0:
        raise InputError("the flight ended at 0 s, so that there is nothing to show")
    reason = f"is not before the end {made.end:g}" if made.end < flight_end else "is not in it"
    reason = f"{reason}; the flight ends at {flight_end:g} s"
    require("start", reason, fits=made.start < min(flight_end, made.end))
    if size is not None:
        allowed = "must be even numbers of pixels from 64 to 4096, such as 1280 and 720"
        fits = _fit(size, [(64, 4096)] * 2)
        fits = fits and all(isinstance(side, int) and side % 2 == 0 for side in size)
        require("size", allowed, fits=fits)
        made = replace(made, width=size[0], height=size[1])
    slow = path.suffix.lower() != ".gif" or made.fps <= GIF_MAX_FPS
    require("fps", f"a GIF has at most {GIF_MAX_FPS} frames per second", fits=slow)
    if camera is not None:
        allowed = "must be vehicle radii from 1.5 to 1000 and two angles in degrees"
        fits = _fit(camera, [(1.5, 1000.0), (-360.0, 360.0), (-90.0, 90.0)])
        require("camera", f"{allowed}, such as 7.5, 130, -24", fits=fits)
        made = replace(made, camera=CameraPose(*camera))
    return made


def _fit(values: Any, ranges: Sequence[tuple[float, float]]) -> bool:
    """Whether values are a list of numbers, each within its range."""
    if not isinstance(values, list | tuple) or len(values) != len(ranges):
        return False
    return all(is_finite(v) and low <= v <= high for v, (low, high) in zip(values, ranges))
