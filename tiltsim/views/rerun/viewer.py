"""The Rerun viewer: opened or connected to, for flights, recordings, and a flight in progress."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryFile
from threading import Event, Thread
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any, Final, Self
from urllib.parse import urlsplit
from uuid import uuid4

import numpy as np

from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight, as_flights, vehicles_named
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.public import optional_package
from tiltsim.system.text import printable, short_repr
from tiltsim.views.rerun import require_rerun
from tiltsim.views.video import has_display
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

DEFAULT_URL: Final = "rerun+http://127.0.0.1:9876/proxy"  # default address of a viewer
CONNECT_TIMEOUT: Final = 2.0  # s
RECORDING_START: Final = b"RRF"  # first bytes of every recording; the version follows
START_TIME: Final = 20.0  # time (s) that the viewer may take to start
SETTLING: Final = 1.0  # time (s) within which a viewer without a usable screen ends
SEND_INTERVAL: Final = 0.25  # s of wall time between pieces; each costs about 0.04 s
SHUTDOWN_TIMEOUT: Final = 5.0
"""Time (s) to wait after the flight until the viewer has received the remaining samples."""


def view(flights: Flight | Sequence[Flight], *, url: str | None = None, vehicle: str = "") -> Any:
    """Show a flight, or several in comparison, in Rerun.

    Args:
        flights: One or several.
        url: Address of an open viewer, such as ``"rerun+http://127.0.0.1:9876/proxy"``; default: in
            a notebook the viewer is part of the cell, and served to the browser by this machine
            unless the environment variable RERUN_NOTEBOOK_ASSET says otherwise; elsewhere one is
            opened.
        vehicle: The only one to show of flights with several, a name in `Flight.vehicles`; default:
            all.

    Returns:
        In a notebook, Rerun's widget, with which the cell has to end. Else None.

    Raises:
        InputError: If an argument is wrong, no viewer listens at the address, there is no screen to
            open one on, or the notebook support of Rerun is not installed.
    """
    shown = as_flights(flights)
    ipython = sys.modules.get("IPython")  # the kernel of a notebook displays widgets
    if url is None and ipython is not None and hasattr(ipython.get_ipython(), "kernel"):
        return _inline_viewer(shown, vehicle)
    if url is not None and not isinstance(url, str):
        raise InputError(f"url = {short_repr(url)}: must be text, such as {DEFAULT_URL}")
    view_flights(shown, url, vehicle=vehicle)
    return None


def _inline_viewer(flights: Sequence[Flight], vehicle: str) -> Any:
    """Rerun's widget for notebooks, which has got the flights."""
    # The browser gets the viewer from this machine: by default it would be from Rerun's website.
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "serve-local")
    with redirect_stdout(StringIO()):  # which says how it is served
        optional_package("rerun_notebook", "Rerun in a notebook", "'rerun-sdk[notebook]'")
    from rerun.notebook import Viewer

    from tiltsim.views.rerun.recording import Recording

    flights = vehicles_named(vehicle, flights)
    recording = Recording([flight.assembly for flight in flights], vehicle=vehicle)
    views = recording.blueprint(flights)
    widget = Viewer(recording=recording.stream, blueprint=views, width="auto")
    recording.write(flights)
    recording.stream.flush()
    return widget


def view_flights(
    flights: Sequence[Flight], url: str | None = None, names: Sequence[str] = (), vehicle: str = ""
) -> None:
    """Show a flight, or several for a comparison, in a viewer.

    Args:
        flights: One or several.
        url: The viewer's address; None opens one.
        names: Names of several flights, by default `flight_names`.
        vehicle: The only one that is shown; empty for all.

    Raises:
        InputError: If no viewer listens at the address, or there is no screen to open one on.
    """
    from tiltsim.views.rerun.recording import Recording

    flights = vehicles_named(vehicle, flights)
    require_viewer(url)
    recording = Recording([flight.assembly for flight in flights], names, vehicle)
    attach_viewer(recording.stream, url, recording.blueprint(flights))
    recording.write(flights)
    recording.stream.disconnect()


def view_recordings(paths: Sequence[Path]) -> None:
    """Open saved recordings in a viewer.

    Raises:
        InputError: If a file cannot be read or is not a recording, or there is no screen.
    """
    for path in paths:
        # For other files the viewer would only show a short notice.
        try:
            with path.open("rb") as file:
                start = file.read(len(RECORDING_START))
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
        if start != RECORDING_START:
            raise InputError(f"{path}: not a Rerun recording")
    require_viewer(None)
    _open_viewer(*(str(path.absolute()) for path in paths), until=lambda: True)


def _open_viewer(*arguments: str, until: Callable[[], bool]) -> None:
    """Start the viewer, which listens to programs of this machine only, and wait for it.

    Raises:
        InputError: If it does not start or ends at once, with the last line that it wrote.
    """
    import rerun_cli

    program = Path(rerun_cli.__file__).with_name("rerun")
    program = program.with_suffix(".exe") if sys.platform == "win32" else program
    with TemporaryFile() as said:
        try:
            process = subprocess.Popen(
                [str(program), "--bind", "127.0.0.1", *arguments],
                env={**os.environ, "RERUN_APP_ONLY": "true"},
                stdout=subprocess.DEVNULL,
                stderr=said,
                start_new_session=True,
            )
        except OSError as error:
            raise InputError(f"the Rerun viewer did not start: {error.strerror}") from error
        began, ready = monotonic(), float("inf")
        while monotonic() < ready + SETTLING:
            if process.poll():
                said.seek(0)
                reason = said.read().decode(errors="replace").strip().rpartition("\n")[2]
                raise InputError(f"the Rerun viewer ended at once: {reason or process.returncode}")
            if ready == float("inf") and until():
                ready = monotonic()
            elif ready == float("inf") and monotonic() > began + START_TIME:
                raise InputError(f"the Rerun viewer did not start within {START_TIME:g} s")
            sleep(0.05)


def attach_viewer(recording: rr.RecordingStream, url: str | None, blueprint: rrb.Blueprint) -> None:
    """Send a recording to the viewer at a URL, or else to the local one, opened if necessary."""
    if url is None:
        url = DEFAULT_URL
        if not viewer_listens(url):
            options = "--hide-welcome-screen", "--expect-data-soon"
            _open_viewer(*options, until=partial(viewer_listens, url))
    recording.connect_grpc(url, default_blueprint=blueprint)


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


class LiveStream:
    """Sends samples to a viewer from a separate thread as they are recorded.

    The simulation only puts its samples into an unbounded queue, so that a slow or closed viewer
    never delays it. Use it as a context manager and as `simulate`'s observer. ``url`` is the
    viewer's address; None opens a viewer.

    Raises:
        InputError: If no viewer listens at the address, or there is no screen to open one on.
    """

    def __init__(self, scenario: Scenario, url: str | None = None) -> None:
        require_viewer(url)
        # After the check, as Rerun takes a second to load.
        from tiltsim.views.rerun.recording import Recording

        self._assembly = assemble(scenario, recorded=True)
        # A unique name: a viewer would merge two flights of one scenario into one recording.
        recording = Recording([self._assembly], salt=uuid4().hex)
        self._recording, self._stream = recording, recording.stream
        attach_viewer(self._stream, url, recording.blueprint(live=True))
        self._samples: SimpleQueue[Floats] = SimpleQueue()
        self._end: End | None = None
        self._over = Event()
        # A daemon thread, so that a frozen viewer does not keep the program from exiting.
        self._thread = Thread(target=self._send_all, name="live stream", daemon=True)

    def __call__(self, sample: Floats) -> None:
        """Queue a sample of the flight; returns immediately."""
        self._samples.put(sample)

    def __enter__(self) -> Self:
        """Start sending."""
        self._thread.start()
        return self

    def finish(self, end: End) -> None:
        """Set how the flight ended; sent after its last sample."""
        self._end = end

    def __exit__(self, *_error: object) -> None:
        """Send the remaining samples and stop, within `SHUTDOWN_TIMEOUT` seconds at most."""
        self._over.set()
        self._thread.join(SHUTDOWN_TIMEOUT)
        if self._thread.is_alive():
            _abandon_connection()

    def _send_all(self) -> None:
        try:
            self._recording.draw_references(self._assembly.scenario.simulation.duration)
            while not self._over.wait(SEND_INTERVAL):
                self._send_queued()
            self._send_queued()
            if self._end is not None:
                self._recording.finish([self._end])
            self._stream.disconnect()
        except Exception as error:  # the flight continues regardless of viewer errors
            sys.stderr.write(f"tiltsim: live view ended: {printable(error)}\n")

    def _send_queued(self) -> None:
        """Send all queued samples as one piece of the flight."""
        samples = []
        try:
            while True:
                samples.append(self._samples.get_nowait())
        except Empty:
            pass
        if samples:
            now = float(samples[-1][0])
            piece = Flight(self._assembly, np.array(samples), End("completed", now), "python", 0.0)
            self._recording.append([piece])


def _abandon_connection() -> None:
    """Let the program exit before the viewer has received everything: Rerun would wait forever."""
    import rerun as rr

    rr.unregister_shutdown()
    sys.stderr.write("tiltsim: the viewer does not respond; the live view is incomplete\n")
