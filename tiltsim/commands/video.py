"""``tiltsim video``: renders a flight as a video."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Final

from tiltsim.commands.options import Subparsers, add_quiet
from tiltsim.commands.progress import counting_bar
from tiltsim.commands.text import print_line

MANY_FRAMES: Final = 100
"""Frames from which on the expected duration is printed."""


def add_parser(subparsers: Subparsers) -> None:
    """Declare the command."""
    description = """Render a flight with MuJoCo, the camera following the vehicle; works without a
    screen. The inset shows the roll-pitch plane."""
    parser = subparsers.add_parser(
        "video", help="render a video of a flight", description=description
    )
    add = parser.add_argument
    add("flight", type=Path, metavar="FLIGHT", help="a folder of results, or a flight.parquet")
    add("--out", type=Path, metavar="FILE.mp4", help="default: flight.mp4 beside the flight")
    add("--size", type=_size, default=(960, 540), metavar="WxH", help="pixels (default 960x540)")
    add("--fps", type=_frame_rate, default=30, metavar="N", help="frames per second (default 30)")
    add("--speed", type=_speed, default=1.0, metavar="X", help="times real time (default 1)")
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


def _speed(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.01 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"{text}: must be a number from 0.01 to 100")
    return value


def run(arguments: argparse.Namespace) -> int:
    """Render and encode."""
    from tiltsim.flight.reading import load_flight
    from tiltsim.system.files import prepare_file

    flight = load_flight(arguments.flight)
    folder = arguments.flight if arguments.flight.is_dir() else arguments.flight.parent
    out = arguments.out or folder / "flight.mp4"
    prepare_file("--out", out, (".mp4",))

    from tiltsim.views.video import prefer_offscreen_gl

    prefer_offscreen_gl()  # before anything imports MuJoCo
    from tiltsim.views.video.rendering import VideoFormat, frame_times, write_video

    width, height = arguments.size
    video = VideoFormat(width, height, arguments.fps, arguments.speed)
    count = len(frame_times(flight, video))
    if count > MANY_FRAMES and not arguments.quiet:
        print(
            f"{count} frames of {width}x{height}; without a GPU a frame takes up to half a second "
            "(reduce with --speed, --fps or --size)",
            file=sys.stderr,
        )
    with counting_bar(count, "frames", shown=not arguments.quiet) as move:
        move(0)
        drawn = iter(range(1, count + 1))
        write_video(flight, out, video, lambda _time: move(next(drawn)))
    if not arguments.quiet:
        print_line(f"video written to {out}")
    return 0
