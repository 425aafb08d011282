"""Writing one flight into a recording: static data first, then its rows, then its end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import rerun as rr

from tiltsim.views.events import Event, EventDetector
from tiltsim.views.replay import visible_model
from tiltsim.views.rerun import palette
from tiltsim.views.rerun.display import Series
from tiltsim.views.rerun.scene import Scene
from tiltsim.views.rerun.time_series import TimeSeries
from tiltsim.views.rerun.timeline import send_rows
from tiltsim.views.vehicle_views import display_of

if TYPE_CHECKING:
    from tiltsim.closed_loop.assembly import Assembly
    from tiltsim.flight.end import End
    from tiltsim.flight.flight import Flight
    from tiltsim.views.rerun.palette import Color

_LEVEL_COLORS: Final = {"INFO": palette.GREY, "WARN": palette.AMBER, "ERROR": palette.RED}


class FlightRecorder:
    """Writes one flight into a recording.

    Call `begin` and `draw_references` once, `append` with pieces of the flight in order, and
    `finish`.

    Args:
        recording: The recording to write to.
        assembly: The assembly of the flight.
        name: The flight's name in a comparison; empty for a single flight.
        color: The flight's colour.
        first: Whether this is the first flight of the recording, which also draws the shared
            entities.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        assembly: Assembly,
        *,
        name: str = "",
        color: Color = palette.SKY,
        first: bool = True,
    ) -> None:
        part = rr.escape_entity_path_part(name) if name else ""
        suffix = f"/{part}" if name else ""
        self.name = name
        self.scenario = scenario = assembly.scenario
        self.assembly = assembly
        self.model = visible_model(assembly)
        self.display = display = display_of(assembly)
        self.scene = Scene(recording, assembly, self.model, f"world{suffix}", color, name)
        self.plane = None
        if display.plane is not None:
            self.plane = display.plane(recording, scenario, f"plane{suffix}", color)
        series = self._comparison(color) if name else display.series(assembly)
        self._series = TimeSeries(recording, series, f"{part}/" if name else "")
        self._recording = recording
        self._first = first
        self._events = EventDetector(assembly, display.conditions)
        self._event_path = f"events{suffix}"

    def _comparison(self, color: Color) -> list[Series]:
        """The lines of this flight in a comparison."""
        return [
            Series(f"{panel.path}/{compared.name}", self.name, color, compared.values)
            for panel in self.display.panels(self.assembly)
            for compared in panel.compared
        ]

    def begin(self) -> None:
        """Log the static data."""
        not_drawn = self.scene.begin()
        if self.plane is not None:
            self.plane.begin()
        self._series.begin()
        self._log_events([self._events.opening()])
        if not_drawn:
            text = f"not drawn, because Rerun has no such shape: {', '.join(not_drawn)}"
            self._log_events([Event(0.0, "WARN", text)])

    def draw_references(self, end: float) -> None:
        """Log the path of the reference and the level lines up to a time (s)."""
        self.scene.draw_reference(end)
        if self._first:
            self._series.draw_levels(self.display.levels(self.assembly), end)

    def append(self, piece: Flight) -> None:
        """Log the next piece of the flight."""
        self.scene.append(piece)
        if self.plane is not None:
            self.plane.append(piece)
        self._series.append(piece)
        self._log_events(self._events.observe(piece))

    def finish(self, end: End) -> None:
        """Log how the flight ended."""
        self._log_events(self._events.closing(end))

    def _log_events(self, events: list[Event]) -> None:
        prefix = f"{self.name}: " if self.name else ""
        rows = rr.TextLog.columns(
            text=[prefix + event.text for event in events],
            level=[event.level for event in events],
            color=[_LEVEL_COLORS[event.level] for event in events],
        )
        send_rows(self._recording, self._event_path, np.array([e.time for e in events]), rows)
