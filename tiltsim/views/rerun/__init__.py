"""Flights in Rerun: recordings saved in bulk, live streams, and the blueprint that shows them.

One `FlightRecorder` writes a flight's rows, whether they come all at once (`save_recording`) or
piece by piece while the flight goes on (`LiveStream`). Times are on the timeline `TIMELINE`.
Importing this package imports no Rerun; its functions do.

Entities of a recording, each below the flight's own name where there are several:

- ``world``: the vehicle's bodies as a tree, thrust arrows, trails of vehicle and reference
- ``plane``: roll-pitch plane with the unacceptable-attitude curve and the attitude, pitch upwards
- ``attitude``, ``tilt_angles``, ``rotor_speeds``, ``singularity``, ``position_error``: time series
- ``events``: the log
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tiltsim.views.rerun.names import APPLICATION, TIMELINE

if TYPE_CHECKING:
    from tiltsim.views.rerun.live import LiveStream
    from tiltsim.views.rerun.process import RecordingProcess
    from tiltsim.views.rerun.recording import save_recording
    from tiltsim.views.rerun.viewer import view_flights, view_recordings


_HOMES = {
    "LiveStream": "live",
    "RecordingProcess": "process",
    "save_recording": "recording",
    "view_flights": "viewer",
    "view_recordings": "viewer",
}

__all__ = [
    "APPLICATION",
    "TIMELINE",
    "LiveStream",
    "RecordingProcess",
    "save_recording",
    "view_flights",
    "view_recordings",
]


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    from importlib import import_module

    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
