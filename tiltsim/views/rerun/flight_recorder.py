"""Writing one flight into a recording: static data first, then its rows, then its end."""

import re
from typing import Final, NamedTuple

import numpy as np
import rerun as rr

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.flight.end import End
from tiltsim.flight.flight import Flight
from tiltsim.views.events import Event, EventDetector
from tiltsim.views.replay import visible_model
from tiltsim.views.rerun import timeline
from tiltsim.views.rerun.plane import AttitudePlane
from tiltsim.views.rerun.scene import Scene
from tiltsim.views.rerun.timeline import Color, dimmed, send_rows
from tiltsim.views.signals import Signal, Signals, has_attitude_plane, signals_of

MEASURED_WIDTH: Final = 1.8
REFERENCE_WIDTH: Final = 1.0
LEVEL_WIDTH: Final = 1.2
AXIS_COLORS: Final = (timeline.RED, timeline.GREEN, timeline.SKY)
MANY_COLORS: Final = (
    timeline.AMBER,
    timeline.SKY,
    timeline.PINK,
    timeline.GREEN,
    timeline.YELLOW,
    timeline.RED,
)
MANY_WIDTHS: Final = (4.0, 3.0, 2.0, 1.2)  # lines of equal angles and speeds would cover each other

_EVENT_COLORS: Final = {"INFO": timeline.GREY, "WARN": timeline.AMBER, "ERROR": timeline.RED}


class Line(NamedTuple):
    """An entity of a plot, with one line or several."""

    path: str
    labels: list[str]
    colors: list[Color]
    signals: list[Signal]
    width: float = MEASURED_WIDTH


def plotted_lines(panel: Signals) -> list[Line]:
    """The lines of a panel of one flight, each with its reference, and the bounds.

    Panels of the second tab have all their lines in one entity, which keeps recordings small.
    """
    found: list[Line] = []
    many = len(panel.lines) > len(AXIS_COLORS) or panel.lines[0].name[-1:].isdigit()
    colors = MANY_COLORS if many or panel.levels or panel.bounds else AXIS_COLORS

    def add(name: str, line: Signal, label: str, color: Color, width: float) -> None:
        path = f"{panel.path}/{name}" if panel.plotted else panel.path
        found.append(Line(path, [label], [color], [line], width))

    for number, line in enumerate(panel.lines):
        color = colors[number % len(colors)]
        width = MANY_WIDTHS[min(number, len(MANY_WIDTHS) - 1)] if many else MEASURED_WIDTH
        vector = len(panel.lines) > 1 and not panel.plotted  # whose title says the rest
        label = re.findall(r"\d+$|.$", line.name)[0] if vector else line.label
        add(line.name, line, label, color, width)
        if line.reference:
            reference = Signal("", "", line.reference)
            add(line.reference, reference, "reference", dimmed(color), REFERENCE_WIDTH)
    for bound in panel.bounds:
        name, color = bound.rpartition("_")[2], dimmed(timeline.AMBER)
        add(name, Signal("", "", bound), "bound", color, REFERENCE_WIDTH)
    if panel.plotted:
        return found
    columns = zip(*((*one.labels, *one.colors, *one.signals) for one in found), strict=True)
    labels, shades, signals = ([*column] for column in columns)
    return [Line(panel.path, labels, shades, signals, REFERENCE_WIDTH)]


class FlightRecorder:
    """Writes one flight into a recording.

    It writes the static data at once. Call `draw_references` once, `append` with pieces of the
    flight in order, and `finish`.

    Args:
        recording: The recording to write to.
        assembly: The assembly of the flight.
        name: The flight's name in a comparison; empty for a single flight.
        color: The flight's color.
        first: Whether this is the first flight of the recording, which also draws the shared
            entities.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        assembly: Assembly,
        *,
        name: str = "",
        color: Color = timeline.SKY,
        first: bool = True,
    ) -> None:
        part = rr.escape_entity_path_part(name) if name else ""
        suffix = f"/{part}" if name else ""
        self.name = name
        self.part = part
        self.scenario = assembly.scenario
        self.assembly = assembly
        self.model = visible_model(assembly)
        self.signals = signals_of(assembly)
        self.scene = Scene(recording, assembly, self.model, f"world{suffix}", color, name)
        self.plane = None
        if has_attitude_plane(assembly):
            self.plane = AttitudePlane(recording, self.scenario, f"plane{suffix}", color)
        if name:
            self._lines = [
                Line(f"{part}/{panel.path}/{line.name}", [name], [color], [line])
                for panel in self.signals.values()
                for line in panel.compared
            ]
        else:
            self._lines = [line for each in self.signals.values() for line in plotted_lines(each)]
        self._recording = recording
        self._first = first
        self._events = EventDetector(assembly)
        self._event_path = f"events{suffix}"
        for path, labels, colors, _, width in self._lines:
            self._log_style(path, labels, colors, width)
        self._log_events(self._events.opening())
        if self.scene.not_drawn:
            text = f"not drawn, because Rerun has no such shape: {', '.join(self.scene.not_drawn)}"
            self._log_events([Event(0.0, "WARN", text)])

    def draw_references(self, end: float) -> None:
        """Log the path of the reference and the levels of the plots up to a time (s)."""
        self.scene.draw_reference(end)
        levels = [(panel.path, level) for panel in self.signals.values() for level in panel.levels]
        for panel, level in levels if self._first else []:
            path = f"{self.part}/{panel}/{level.name}".lstrip("/")
            color = timeline.RED if level.value else timeline.GREY
            self._log_style(path, [level.label], [color], LEVEL_WIDTH)
            row = rr.Scalars.columns(scalars=[level.value, level.value])
            send_rows(self._recording, path, np.array([0.0, end]), row)

    def append(self, piece: Flight) -> None:
        """Log the next piece of the flight."""
        self.scene.append(piece)
        if self.plane is not None:
            self.plane.append(piece)
        for line in self._lines:
            values = np.stack([signal.of(piece) for signal in line.signals], axis=1)
            rows = rr.Scalars.columns(scalars=values.ravel())
            rows = rows.partition([len(line.signals)] * len(piece))
            send_rows(self._recording, line.path, piece["time"], rows)
        self._log_events(self._events.observe(piece))

    def finish(self, end: End) -> None:
        """Log how the flight ended."""
        self._log_events(self._events.closing(end))

    def _log_style(self, path: str, labels: list[str], colors: list[Color], width: float) -> None:
        style = rr.SeriesLines(names=labels, colors=colors, widths=[width] * len(labels))
        self._recording.log(path, style, static=True)

    def _log_events(self, events: list[Event]) -> None:
        prefix = f"{self.name}: " if self.name else ""
        rows = rr.TextLog.columns(
            text=[prefix + event.text for event in events],
            level=[event.level for event in events],
            color=[_EVENT_COLORS[event.level] for event in events],
        )
        send_rows(self._recording, self._event_path, np.array([e.time for e in events]), rows)
