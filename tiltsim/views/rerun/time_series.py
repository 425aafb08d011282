"""The plotted entities of a flight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from tiltsim.views.rerun.timeline import send_rows

if TYPE_CHECKING:
    from tiltsim.flight.flight import Flight
    from tiltsim.views.rerun.display import Level, Series


class TimeSeries:
    """Logs the lines of one flight's plots, with a prefix before their entities."""

    def __init__(
        self, recording: rr.RecordingStream, series: Sequence[Series], prefix: str
    ) -> None:
        self._recording = recording
        self._series = series
        self._prefix = prefix

    def begin(self) -> None:
        """Log names, colours and widths of the lines."""
        for series in self._series:
            self._log_style(series)

    def draw_levels(self, levels: Sequence[Level], end: float) -> None:
        """Draw horizontal lines from the start to a time (s)."""
        for level in levels:
            self._log_style(level)
            row = rr.Scalars.columns(scalars=[level.value, level.value])
            send_rows(self._recording, self._prefix + level.path, np.array([0.0, end]), row)

    def append(self, piece: Flight) -> None:
        """Log the next piece of the flight."""
        for series in self._series:
            source = series.values
            row = rr.Scalars.columns(
                scalars=piece[source] if isinstance(source, str) else source(piece)
            )
            send_rows(self._recording, self._prefix + series.path, piece["time"], row)

    def _log_style(self, line: Series | Level) -> None:
        style = rr.SeriesLines(names=[line.label], colors=[line.color], widths=[line.width])
        self._recording.log(self._prefix + line.path, style, static=True)
