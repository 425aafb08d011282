"""Rows on the timeline: sending columns of values, and thinning out samples."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt
import rerun as rr

from tiltsim_controllers.mathematics.scalar import Floats

TIMELINE: Final = "sim_time"


def send_rows(recording: rr.RecordingStream, path: str, times: Floats, *columns: Any) -> None:
    """Send one row per time to an entity.

    Parameters
    ----------
    recording
        The recording to write to.
    path
        The entity.
    times
        Times of the rows, s.
    columns
        Values with one row per time, from the ``columns`` methods of archetypes.
    """
    if len(times) == 0:
        return
    # Rounded to nanoseconds: Rerun truncates, which would show 0.57 s as 0.569999999 s.
    nanoseconds = np.round(times * 1e9).astype("timedelta64[ns]")
    index = rr.TimeColumn(TIMELINE, duration=nanoseconds)
    recording.send_columns(path, [index], [part for column in columns for part in column])


def trail_segments(points: Floats, last: Floats | None) -> Floats:
    """Line segments to each of N points from the one before it, shape (N, 2, dimensions).

    The first segment starts at the ``last`` point of the previous piece; without one it is empty.
    """
    first = points[:1] if last is None else last[np.newaxis]
    return np.stack([np.concatenate([first, points[:-1]]), points], axis=1)


class Ticks:
    """Picks the samples at which an entity below the full rate is logged: one per interval.

    The pick depends on the times of the samples only, so that a flight given in pieces is logged
    like a complete one.

    Parameters
    ----------
    interval
        Time between picked samples, s.
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
