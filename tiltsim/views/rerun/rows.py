"""Writing rows: columns of values at given times, one call an entity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tiltsim.views.rerun.names import TIMELINE
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    import rerun as rr


def send_rows(recording: rr.RecordingStream, path: str, times: Floats, *columns: Any) -> None:
    """Write one row a time (s) into an entity; ``columns`` come from archetypes' ``columns``."""
    import rerun as rr

    if len(times) == 0:
        return
    # Whole nanoseconds: Rerun cuts fractions off, which would show 0.57 s as 0.569999999 s.
    nanoseconds = np.round(times * 1e9).astype("timedelta64[ns]")
    index = rr.TimeColumn(TIMELINE, duration=nanoseconds)
    recording.send_columns(path, [index], [part for column in columns for part in column])


class Ticks:
    """Picks the samples at which something that need not be drawn at full rate is drawn.

    The pick depends on the samples' times alone, so a flight that comes in pieces is drawn like
    one that comes whole.
    """

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._tick = -1

    def pick(self, times: Floats) -> npt.NDArray[np.intp]:
        """Indices of the first samples of every interval (s) that begins within these times."""
        ticks = np.floor(times / self._interval + 1e-6).astype(int)
        before = np.concatenate([[self._tick], ticks[:-1]])
        self._tick = int(ticks[-1])
        return np.flatnonzero(ticks > before)
