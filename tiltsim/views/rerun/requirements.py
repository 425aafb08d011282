"""What showing flights requires: Rerun enabled, and a viewer or a screen."""

from __future__ import annotations

import os
import socket
import sys
from typing import Final
from urllib.parse import urlsplit

from tiltsim.errors import InputError

DEFAULT_URL: Final = "rerun+http://127.0.0.1:9876/proxy"
"""Default address of a viewer."""

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
        _require_listener(url)
    elif sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
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


def _require_listener(url: str) -> None:
    parts = urlsplit(url)
    try:
        known = parts.scheme in {"rerun+http", "rerun+https", "rerun"} and parts.path == "/proxy"
        valid = known and bool(parts.hostname) and parts.port != 0
    except ValueError:
        valid = False
    if not valid:
        raise InputError(f"address {url}: not a viewer's; expected, e.g., {DEFAULT_URL}")
    if not viewer_listens(url):
        raise InputError(
            f"address {url}: no viewer listens there; start one with the command rerun"
        )
