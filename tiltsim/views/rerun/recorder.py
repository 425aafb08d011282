"""One flight into a recording: all that does not move first, then row after row, then the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tiltsim.views.attitude_plane import curve_is_constant
from tiltsim.views.events import Event, EventDetector
from tiltsim.views.replay import thrust_scale, vehicle_radius, visible_model
from tiltsim.views.rerun import palette
from tiltsim.views.rerun.aspects import aspect_of, comparison_series
from tiltsim.views.rerun.rows import send_rows
from tiltsim.views.rerun.scene import Scene, reference_path
from tiltsim.views.rerun.series import TimeSeries

if TYPE_CHECKING:
    import rerun as rr

    from tiltsim.flight.end import End
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario
    from tiltsim.views.rerun.blueprint import Shown
    from tiltsim.views.rerun.palette import Color

OVERVIEW_HEIGHT = 1.35
"""How far above a reference the camera must be to see all of it, in lengths of it."""

_LEVEL_COLORS = {"INFO": palette.GREY, "WARN": palette.AMBER, "ERROR": palette.RED}


class FlightRecorder:
    """Writes one flight into a recording.

    Call `begin` and `draw_references` once, `append` with pieces of the flight in order, and
    `finish`.

    Parameters
    ----------
    recording
        Where to write.
    scenario
        What is flown.
    name
        The flight's name among several that are compared; empty for a flight on its own.
    color
        The flight's colour.
    first
        Whether this is the first flight of the recording, which draws what all share.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        scenario: Scenario,
        *,
        name: str = "",
        color: Color = palette.SKY,
        first: bool = True,
    ) -> None:
        import rerun as rr

        part = rr.escape_entity_path_part(name) if name else ""
        self._recording = recording
        self._scenario = scenario
        self._name = name
        self._first = first
        self._events = EventDetector(scenario)
        self._event_path = f"events/{part}" if name else "events"
        self._model = visible_model(scenario)
        suffix = f"/{part}" if name else ""
        self._scene = Scene(recording, scenario, self._model, f"world{suffix}", color, name)
        self._aspect = aspect = aspect_of(scenario)
        self._plane = None
        if aspect.plane is not None:
            self._plane = aspect.plane(recording, scenario, f"plane{suffix}", color, bool(name))
        series = comparison_series(name, color, scenario) if name else aspect.measured(scenario)
        self._series = TimeSeries(recording, series, aspect.values, f"{part}/" if name else "")
        self._plane_root, self._scene_root = f"plane{suffix}", f"world{suffix}"

    def shown(self) -> Shown:
        """What the blueprint must know of this flight."""
        from tiltsim.views.rerun.blueprint import Shown
        from tiltsim.views.rerun.geometry import ground_height

        return Shown(
            name=self._name,
            world=self._scene_root,
            vehicle=self._scene.vehicle,
            camera=self._scene.camera,
            floor=self._scene.floor,
            plane=self._plane_root if self._plane is not None else "",
            curve_is_constant=curve_is_constant(self._scenario),
            panels=self._aspect.panels(self._scenario),
            eye=self._aspect.eye,
            up=self._aspect.up,
            overview=self._overview() if self._aspect.overview else None,
            radius=vehicle_radius(self._model),
            thrust_scale=thrust_scale(self._model),
            ground=ground_height(self._model),
        )

    def _overview(self) -> tuple[float, float, float]:
        path = reference_path(self._scenario, self._scenario.simulation.duration)
        low, high = path.min(axis=0), path.max(axis=0)
        x, y, _ = (0.5 * (low + high)).tolist()
        return x, y, float(OVERVIEW_HEIGHT * max(np.ptp(path, axis=0).max(), 1.0))

    def begin(self) -> None:
        """Log all that does not move."""
        left_out = self._scene.begin()
        if self._plane is not None:
            self._plane.begin(paints=self._first)
        self._series.begin()
        self._log_events([self._events.opening()])
        if left_out:
            text = f"not drawn, for Rerun has no such shape: {', '.join(left_out)}"
            self._log_events([Event(0.0, "WARN", text)])

    def draw_references(self, until: float) -> None:
        """Log the reference's path and the limits for a flight that ends by ``until`` (s)."""
        self._scene.draw_reference(until)
        if self._first:
            self._series.draw_limits(self._aspect.limits(self._scenario), until)

    def append(self, piece: Flight) -> None:
        """Log the rows of a piece of the flight that follows on from the last."""
        self._scene.append(piece)
        if self._plane is not None:
            self._plane.append(piece)
        self._series.append(piece)
        self._log_events(self._events.observe(piece))

    def finish(self, end: End) -> None:
        """Log how the flight ended."""
        self._log_events(self._events.closing(end))

    def _log_events(self, events: list[Event]) -> None:
        import rerun as rr

        prefix = f"{self._name}: " if self._name else ""
        rows = rr.TextLog.columns(
            text=[prefix + event.text for event in events],
            level=[event.level for event in events],
            color=[_LEVEL_COLORS[event.level] for event in events],
        )
        send_rows(self._recording, self._event_path, np.array([e.time for e in events]), rows)
