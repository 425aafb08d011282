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
import socket
from typing import Final
from urllib.parse import urlsplit

from tiltsim.errors import InputError
from tiltsim.views.video import has_display

DEFAULT_URL: Final = "rerun+http://127.0.0.1:9876/proxy"  # default address of a viewer
CONNECT_TIMEOUT: Final = 2.0  # s


def require_rerun() -> None:
    """Raise `InputError` if the environment disables Rerun, which would then record nothing."""
    value = os.environ.get("RERUN", "")
    if value.strip().lower() in {"0", "false", "off"}:
        raise InputError(f"RERUN={value} in the environment disables Rerun; unset it")


def require_viewer(url: str | None) -> None:
    """Raise `InputError` unless a viewer listens at a URL or, without one, there is a screen."""
    require_rerun()
    if url is not None:
        parts = urlsplit(url)
        try:
            known = parts.scheme in {"rerun+http", "rerun+https", "rerun"}
            valid = known and parts.path == "/proxy" and bool(parts.hostname) and parts.port != 0
        except ValueError:
            valid = False
        if not valid:
            raise InputError(f"address {url}: not a viewer's; expected, e.g., {DEFAULT_URL}")
        if not viewer_listens(url):
            text = f"address {url}: no viewer listens there; start one with the command rerun"
            raise InputError(text)
    elif not has_display():
        raise InputError(
            "no screen to open the Rerun viewer on (DISPLAY and WAYLAND_DISPLAY are not set); "
            "save a recording with --rerun FILE.rrd, or --connect to a viewer on another machine"
        )


def viewer_listens(url: str) -> bool:
    """Whether something accepts connections at a viewer's address."""
    parts = urlsplit(url)
    try:
        socket.create_connection((str(parts.hostname), parts.port or 9876), CONNECT_TIMEOUT).close()
    except (OSError, UnicodeError):  # the latter for a host with a label that is too long
        return False
    return True
