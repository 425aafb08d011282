"""``tiltsim video``: renders a flight as a video."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tiltsim.commands.options import Subparsers, add_quiet
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import print_line
from tiltsim.errors import InputError

if TYPE_CHECKING:
    from tiltsim.views.video.rendering import VideoFormat

FORMATS: Final = (".mp4", ".gif")
GIF_MAX_FPS: Final = 50
"""Browsers slow down GIFs with shorter delays."""


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Render a flight with MuJoCo, the camera following the vehicle; works without a
    screen. The inset shows the roll-pitch plane."""
    parser = subparsers.add_parser(
        "video", help="render a video of a flight", description=description
    )
    add = parser.add_argument
    add("flight", type=Path, metavar="FLIGHT", help="a folder of results, or a flight.parquet")
    out = "FILE.mp4 or FILE.gif (default: flight.mp4 beside the flight)"
    add("--out", type=Path, metavar="FILE", help=out)
    quality = """draft: 480x270, 15 frames per second; standard (default): 640x360, 25; high:
    1280x720, 30, with shadows"""
    add("--quality", choices=("draft", "standard", "high"), default="standard", help=quality)
    add("--size", type=_size, metavar="WxH", help="pixels, in place of the quality's")
    fps = "frames per second, in place of the quality's"
    add("--fps", type=_frame_rate, metavar="N", help=fps)
    speed = "times real time (default 1)"
    add("--speed", type=_number(0.01, 100.0), default=1.0, metavar="X", help=speed)
    start = "where the video begins in the flight, s (default 0)"
    add("--start", type=_number(0.0, inf), default=0.0, metavar="S", help=start)
    end = "where it ends, s (default: the end of the flight)"
    add("--end", type=_number(0.0, inf), default=inf, metavar="S", help=end)
    camera = """where the camera is: vehicle radii, degrees, degrees (default 7.5,130,-24 for
    rotorcraft)"""
    add("--camera", type=_camera, metavar="DISTANCE,AZIMUTH,ELEVATION", help=camera)
    add_quiet(parser)
    parser.set_defaults(run=run)


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    sides = [int(side) for side in (width, height) if side.isdecimal()]
    if len(sides) != 2 or not all(64 <= side <= 4096 and side % 2 == 0 for side in sides):
        raise argparse.ArgumentTypeError(
            f"{text}: must be even numbers from 64 to 4096, such as 1280x720"
        )
    return sides[0], sides[1]


def _frame_rate(text: str) -> int:
    if not (text.isdecimal() and 1 <= int(text) <= 240):
        raise argparse.ArgumentTypeError(f"{text}: must be an integer from 1 to 240")
    return int(text)


def _number(least: float, most: float) -> Callable[[str], float]:
    """The type of an option that is a number in a range."""
    allowed = f"from {least:g} to {most:g}" if most < inf else f"of at least {least:g}"

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = least - 1.0
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be a number {allowed}")
        return value

    return read


def _camera(text: str) -> tuple[float, float, float]:
    try:
        distance, azimuth, elevation = map(float, text.split(","))
    except ValueError:
        distance = azimuth = elevation = 0.0
    if not (1.5 <= distance <= 1000.0 and abs(azimuth) <= 360.0 and abs(elevation) <= 90.0):
        raise argparse.ArgumentTypeError(
            f"{text}: must be vehicle radii from 1.5 to 1000 and two angles in degrees, such as "
            "7.5,130,-24"
        )
    return distance, azimuth, elevation


def run(arguments: argparse.Namespace) -> int:
    """Render and encode."""
    from tiltsim.flight.reading import load_flight
    from tiltsim.system.files import prepare_file

    with show_progress(shown=not arguments.quiet) as progress:
        progress.begin("reading the flight")
        flight = load_flight(arguments.flight)
        folder = arguments.flight if arguments.flight.is_dir() else arguments.flight.parent
        out = arguments.out or folder / "flight.mp4"
        prepare_file("--out", out, FORMATS)

        from tiltsim.views.video import prefer_offscreen_gl

        prefer_offscreen_gl()  # before anything imports MuJoCo
        from tiltsim.views.video.encoding import write_video
        from tiltsim.views.video.rendering import frame_times

        video = _format(arguments, float(flight["time"][-1]), out.suffix.lower())
        progress.begin("frames", len(frame_times(flight, video)))
        write_video(flight, out, video, progress.move)
    if not arguments.quiet:
        print_line(f"video written to {out}")
    return 0


def _format(arguments: argparse.Namespace, flight_end: float, suffix: str) -> VideoFormat:
    """The video that the options ask for. Raises `InputError` if they contradict the flight."""
    from tiltsim.views.video.overlay import CameraPose
    from tiltsim.views.video.rendering import QUALITIES

    start, end = arguments.start, arguments.end
    if start >= min(flight_end, end):
        reason = f"is not before --end {end:g}" if end < flight_end else "is not in it"
        raise InputError(f"--start {start:g}: {reason}; the flight ends at {flight_end:g} s")
    base = QUALITIES[arguments.quality]
    width, height = arguments.size or (base.width, base.height)
    fps = arguments.fps or base.fps
    if suffix == ".gif" and fps > GIF_MAX_FPS:
        raise InputError(f"--fps {fps}: a GIF has at most {GIF_MAX_FPS} frames per second")
    pose = arguments.camera and CameraPose(*arguments.camera)
    return replace(
        base,
        width=width,
        height=height,
        fps=fps,
        speed=arguments.speed,
        start=start,
        end=end,
        camera=pose,
    )
