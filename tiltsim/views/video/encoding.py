"""Writing the frames of a flight: as MP4, encoded by PyAV, or as an animated GIF, by Pillow."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim.system.files import replacing
from tiltsim.views.video.rendering import VideoFormat, frame_times, frames

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight

H264_QUALITY: Final = "21"  # constant rate factor: 18 is visually lossless, 28 coarse

COLORS: Final = 255  # of a GIF's 256; one is left for pixels that do not change
PALETTE_FRAMES: Final = 6  # evenly spaced frames from which the colors of a GIF are chosen


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
    from PIL import Image as Pillow

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
