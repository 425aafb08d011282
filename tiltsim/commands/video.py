"""``tiltsim video``: renders a flight as a video."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tiltsim.commands.options import Subparsers, add_quiet
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import print_line


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
    quality = """draft: 640x360, 15 frames per second, jagged edges; standard (default): 640x360,
    25; high: 1280x720, 30, with shadows"""
    add("--quality", choices=("draft", "standard", "high"), default="standard", help=quality)
    add(
        "--size",
        type=_numbers("x", int, "1280x720"),
        metavar="WxH",
        help="pixels, in place of the quality's",
    )
    fps = "frames per second, in place of the quality's"
    add("--fps", type=int, metavar="N", help=fps)
    speed = "times real time (default 1)"
    add("--speed", type=float, default=1.0, metavar="X", help=speed)
    start = "where the video begins in the flight, s (default 0)"
    add("--start", type=float, default=0.0, metavar="S", help=start)
    end = "where it ends, s (default: the end of the flight)"
    add("--end", type=float, metavar="S", help=end)
    camera = """where the camera is: vehicle radii, degrees, degrees (default 7.5,130,-24 for
    rotorcraft)"""
    add(
        "--camera",
        type=_numbers(",", float, "7.5,130,-24"),
        metavar="DISTANCE,AZIMUTH,ELEVATION",
        help=camera,
    )
    add_quiet(parser)
    parser.set_defaults(run=run)


def _numbers(separator: str, kind: type[int] | type[float], example: str) -> Callable[[str], Any]:
    """The type of an option that is several numbers."""

    def read(text: str) -> list[float]:
        try:
            return [kind(part) for part in text.lower().split(separator)]
        except ValueError:
            raise argparse.ArgumentTypeError(
                f"{text}: must be numbers, such as {example}"
            ) from None

    return read


def run(arguments: argparse.Namespace) -> int:
    """Render and encode."""
    from tiltsim.flight.reading import load_flight
    from tiltsim.views.video.making import video_format

    with show_progress(shown=not arguments.quiet) as progress:
        progress.begin("reading the flight")
        flight = load_flight(arguments.flight)
        folder = arguments.flight if arguments.flight.is_dir() else arguments.flight.parent
        out = arguments.out or folder / "flight.mp4"
        video = video_format(flight, out, vars(arguments), prefix="--")
        from tiltsim.views.video.encoding import write_video
        from tiltsim.views.video.rendering import frame_times

        progress.begin("frames", len(frame_times(flight, video)))
        write_video(flight, out, video, progress.move)
    if not arguments.quiet:
        print_line(f"video written to {out}")
    return 0
