"""Rows on the timeline, thinned out where they are too many, and the colors of all entities."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt
import rerun as rr

from tiltsim_controllers.mathematics.scalar import Floats

TIMELINE: Final = "sim_time"

Color = tuple[int, int, int]

# For dark and light themes, after Okabe and Ito's palette for the color-blind.
AMBER: Final = (230, 159, 0)
SKY: Final = (86, 180, 233)
GREEN: Final = (0, 178, 132)
YELLOW: Final = (240, 228, 66)
BLUE: Final = (58, 136, 226)
RED: Final = (226, 94, 20)
PINK: Final = (215, 134, 182)
GREY: Final = (140, 148, 158)
FAINT: Final = (88, 94, 102)
WHITE: Final = (235, 238, 242)
UNREACHABLE: Final = (92, 50, 42)
FLIGHTS: Final = (SKY, AMBER, PINK, GREEN, YELLOW, RED, BLUE, GREY)  # compared, in this order


def dimmed(color: Color, factor: float = 0.62) -> Color:
    """A darker shade of a color, for the reference of a quantity shown in it."""
    red, green, blue = (round(channel * factor) for channel in color)
    return red, green, blue


def send_rows(recording: rr.RecordingStream, path: str, times: Floats, *columns: Any) -> None:
    """Send one row per time (s) to an entity: ``columns`` of archetypes with one row per time."""
    if len(times) == 0:
        return
    # Rounded to nanoseconds: Rerun truncates, which would show 0.57 s as 0.569999999 s.
    nanoseconds = np.round(times * 1e9).astype("timedelta64[ns]")
    index = rr.TimeColumn(TIMELINE, duration=nanoseconds)
    recording.send_columns(path, [index], [part for column in columns for part in column])


class Ticks:
    """Picks the samples at which an entity below the full rate is logged: one per interval.

    The pick depends on the interval (s) and the times of the samples only, so that a flight given
    in pieces is logged like a complete one.
    """

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._tick = -1

    def pick(self, times: Floats) -> npt.NDArray[np.intp]:
        """Indices of the first sample of every interval that begins within these times (s)."""
        ticks = np.floor(times / self._interval + 1e-6).astype(int)
        before = np.concatenate([[self._tick], ticks[:-1]])
        self._tick = int(ticks[-1])
        return np.flatnonzero(ticks > before)


class Trail:
    """Line segments between points of a flight that lie an interval (s) apart."""

    def __init__(self, interval: float) -> None:
        self._ticks = Ticks(interval)
        self._last: Floats | None = None

    def extend(self, times: Floats, points: Floats) -> tuple[Floats, Floats]:
        """End times (s) and points of the next segments, shapes (N,) and (N, 2, dimensions)."""
        picked = self._ticks.pick(times)
        ends = points[picked]
        first = ends[:1] if self._last is None else self._last[np.newaxis]
        segments = np.stack([np.concatenate([first, ends])[:-1], ends], axis=1)
        if len(ends):
            self._last = ends[-1]
        return times[picked], segments
