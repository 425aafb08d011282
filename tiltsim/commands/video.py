"""``tiltsim video``: renders a flight as a video."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from tiltsim.commands.declaring import Option
from tiltsim.commands.options import Silent, file_in
from tiltsim.commands.progress import show_progress
from tiltsim.commands.text import print_line


def _numbers(separator: str, kind: type[int] | type[float], example: str) -> Callable[[str], Any]:
    """The reader of an option that is several numbers."""

    def read(text: str) -> list[float]:
        try:
            return [kind(part) for part in text.lower().split(separator)]
        except ValueError:
            raise ValueError(f"must be numbers, such as {example}") from None

    return read


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Size, pace and point of view, the arguments of `tiltsim.Flight.video`.

    Args:
        quality: draft: 640x360, 15 frames per second, jagged edges; standard (default): 640x360,
            25; high: 1280x720, 30, with shadows
        size (WxH): pixels, in place of the quality's
        fps (N): frames per second, in place of the quality's
        speed (X): times real time (default 1)
        start (S): where the video begins in the flight, s (default 0)
        end (S): where it ends, s (default: the end of the flight)
        camera (DISTANCE,AZIMUTH,ELEVATION): where the camera is: vehicle radii, degrees, degrees
            (default 7.5,130,-24 for rotorcraft)
    """

    quality: Literal["draft", "standard", "high"] = "standard"
    size: Annotated[Any, Option(read=_numbers("x", int, "1280x720"))] = None
    fps: int | None = None
    speed: float = 1.0
    start: float = 0.0
    end: float | None = None
    camera: Annotated[Any, Option(read=_numbers(",", float, "7.5,130,-24"))] = None


def run(
    flight: Path, *, out: Path | None = None, quiet: Silent = False, recording: Recording
) -> int:
    """Render a flight with MuJoCo, the camera following the vehicle; works without a screen.

    The inset shows the roll-pitch plane.

    Args:
        flight (FLIGHT): a folder of results, or a flight.parquet
        out (FILE): FILE.mp4 or FILE.gif, or a folder (default: flight.mp4 beside the flight)
    """
    from tiltsim.flight.reading import load_flight
    from tiltsim.views.video.making import video_format

    with show_progress(shown=not quiet) as progress:
        progress.begin("reading the flight")
        flown, file = load_flight(flight), file_in(out, flight, "flight.mp4")
        video = video_format(flown, file, vars(recording), prefix="--")
        from tiltsim.views.video.rendering import frame_times, write_video

        progress.begin("frames", len(frame_times(flown, video)))
        write_video(flown, file, video, progress.move)
    if not quiet:
        print_line(f"video written to {file}")
    return 0
