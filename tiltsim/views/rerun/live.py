"""A flight in a viewer while it is simulated."""

import sys
from queue import Empty, SimpleQueue
from threading import Event, Thread
from typing import Final, Self
from uuid import uuid4

import numpy as np

from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.text import printable
from tiltsim.views.rerun import require_viewer
from tiltsim.views.rerun.viewer import attach_viewer
from tiltsim_controllers.mathematics.scalar import Floats

SEND_INTERVAL: Final = 0.25  # s of wall time between pieces; each costs about 0.04 s
SHUTDOWN_TIMEOUT: Final = 5.0
"""Time (s) to wait after the flight until the viewer has received the remaining samples."""


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
