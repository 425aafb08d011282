"""Opening the Rerun viewer, or reaching one that is open."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final
from urllib.parse import urlsplit

from tiltsim.errors import InputError
from tiltsim.views.rerun.requirements import require_rerun

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

    from tiltsim.flight.flight import Flight

DEFAULT_URL: Final = "rerun+http://127.0.0.1:9876/proxy"
"""Where a viewer listens unless told otherwise."""

RECORDING_START: Final = b"RRF"
"""What every recording begins with; the version follows."""

PATIENCE: Final = 2.0  # s to wait for a viewer to answer


def view_flights(
    flights: Sequence[Flight], url: str | None = None, names: Sequence[str] = ()
) -> None:
    """Show flights, in the viewer at a URL or else in one of our own.

    ``names`` are those of several flights, by default `tiltsim.views.titles.flight_names`.
    Raises `InputError` where there is no viewer, or no screen to open one on.
    """
    from tiltsim.views.rerun.blueprint import flight_blueprint
    from tiltsim.views.rerun.recording import make_recorders, new_recording, write_flights

    require_viewer(url)
    scenarios = [flight.scenario for flight in flights]
    recording = new_recording(scenarios, names)
    recorders = make_recorders(recording, scenarios, names)
    attach_viewer(recording, url, flight_blueprint([recorder.shown() for recorder in recorders]))
    for recorder in recorders:
        recorder.begin()
    write_flights(recorders, flights)
    recording.disconnect()


def view_recordings(paths: Sequence[Path]) -> None:
    """Open saved recordings in a viewer.

    Raises `InputError` where one cannot be read or is no recording, or where there is no screen.
    """
    import rerun_cli

    for path in paths:
        _require_recording(path)
    require_viewer(None)
    program = Path(rerun_cli.__file__).with_name("rerun")
    program = program.with_suffix(".exe") if sys.platform == "win32" else program
    subprocess.Popen(
        [str(program), *(str(path) for path in paths)],
        env={**os.environ, "RERUN_APP_ONLY": "true"},
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )


def _require_recording(path: Path) -> None:
    """The viewer would open with nothing but a notice that soon goes away."""
    try:
        with path.open("rb") as file:
            start = file.read(len(RECORDING_START))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    if start != RECORDING_START:
        raise InputError(f"{path}: not a Rerun recording")


def require_viewer(url: str | None) -> None:
    """Make sure that a viewer listens at a URL or, without one, that there is a screen.

    Raises `InputError` otherwise, in one line with the way out.
    """
    require_rerun()
    if url is not None:
        _require_listener(url)
    elif sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
        raise InputError(
            "no screen to open the Rerun viewer on (DISPLAY and WAYLAND_DISPLAY are not set); "
            "save a recording with --rerun FILE.rrd, or --connect to a viewer elsewhere"
        )


def _require_listener(url: str) -> None:
    parts = urlsplit(url)
    try:
        known = parts.scheme in {"rerun+http", "rerun+https", "rerun"} and parts.hostname
        port = parts.port or 9876
    except ValueError:
        known, port = None, 0
    if not known or parts.path != "/proxy":
        raise InputError(f"--connect {url}: not a viewer's address; write {DEFAULT_URL}")
    try:
        socket.create_connection((str(parts.hostname), port), PATIENCE).close()
    except OSError as error:
        raise InputError(
            f"--connect {url}: no viewer listens there; start one with the command rerun"
        ) from error


def attach_viewer(recording: rr.RecordingStream, url: str | None, blueprint: rrb.Blueprint) -> None:
    """Send a recording to the viewer at a URL, or to one of our own that is opened if need be."""
    if url is not None:
        recording.connect_grpc(url, default_blueprint=blueprint)
        return
    try:
        recording.spawn(hide_welcome_screen=True, default_blueprint=blueprint)
    except (OSError, RuntimeError) as error:
        raise InputError(f"the Rerun viewer did not start: {error}") from error
