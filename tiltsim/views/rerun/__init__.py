"""Flights in Rerun: recordings, live streams, and the blueprint that lays out the viewer.

A `FlightRecorder` writes a flight's rows, either all at once (`save_recording`) or in pieces during
the flight (`LiveStream`). Times are on the timeline `TIMELINE`. Rerun is imported on first use, not
with this package.

Entities of a recording, each below the flight's own name where there are several:

- ``world``: the vehicle's bodies as a tree, thrust arrows, trails of vehicle and reference
- ``plane``: roll-pitch plane with the singular curve and the attitude, pitch upwards
- ``attitude``, ``tilt_angles``, ``rotor_speeds``, ``singularity``, ``position_error``: time series
- ``events``: the log
"""

import os

from tiltsim.errors import InputError


def require_rerun() -> None:
    """Raise `InputError` if the environment disables Rerun, which would then record nothing."""
    value = os.environ.get("RERUN", "")
    if value.strip().lower() in {"0", "false", "off"}:
        raise InputError(f"RERUN={value} in the environment disables Rerun; unset it")
