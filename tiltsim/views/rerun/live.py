"""Streaming a flight while it is flown."""

from __future__ import annotations

import sys
from queue import Empty, SimpleQueue
from threading import Event, Thread
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self
from uuid import uuid4

import numpy as np

from tiltsim.flight.end import End
from tiltsim.flight.flight import Flight
from tiltsim.views.rerun.blueprint import flight_blueprint
from tiltsim.views.rerun.recorder import FlightRecorder
from tiltsim.views.rerun.recording import new_recording
from tiltsim.views.rerun.viewer import attach_viewer, require_viewer
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario

SEND_INTERVAL: Final = 0.25  # s of wall time between pieces; each costs about 0.04 s
SHUTDOWN_TIMEOUT: Final = 5.0
"""How long (s) to wait, after the flight, for the viewer to take what is left."""


class LiveStream:
    """Sends samples to a viewer from a thread of its own, as they are recorded.

    The flight only puts its samples into a queue without bounds, so a slow viewer, or one that has
    been closed, never holds it up. Use it as a context manager and as `simulate`'s observer.

    Parameters
    ----------
    scenario
        What is flown.
    url
        The viewer's address; None opens one.

    Raises
    ------
    InputError
        If there is no viewer, or no screen to open one on.
    """

    def __init__(self, scenario: Scenario, url: str | None = None) -> None:
        require_viewer(url)
        self._scenario = scenario
        # Every live flight is a recording of its own, also in a viewer that has seen it before.
        self._recording = new_recording([scenario], salt=uuid4().hex)
        self._recorder = FlightRecorder(self._recording, scenario)
        blueprint = flight_blueprint([self._recorder.shown()], live=True)
        attach_viewer(self._recording, url, blueprint)
        self._samples: SimpleQueue[Floats] = SimpleQueue()
        self._end: End | None = None
        self._over = Event()
        # A daemon: a viewer that takes nothing more cannot keep the program from ending.
        self._thread = Thread(target=self._send_all, name="live stream", daemon=True)

    def __call__(self, sample: Floats) -> None:
        """Take a sample of the flight; returns at once."""
        self._samples.put(sample)

    def __enter__(self) -> Self:
        """Start sending."""
        self._thread.start()
        return self

    def finish(self, end: End) -> None:
        """Tell how the flight ended; sent after its last sample."""
        self._end = end

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Send what is left and stop, within `SHUTDOWN_TIMEOUT` seconds at most."""
        self._over.set()
        self._thread.join(SHUTDOWN_TIMEOUT)
        if self._thread.is_alive():
            _leave_behind()

    def _send_all(self) -> None:
        try:
            self._recorder.begin()
            self._recorder.draw_references(self._scenario.simulation.duration)
            while not self._over.wait(SEND_INTERVAL):
                self._send_waiting()
            self._send_waiting()
            if self._end is not None:
                self._recorder.finish(self._end)
            self._recording.disconnect()
        except Exception as error:  # the flight goes on, whatever befalls its picture
            sys.stderr.write(f"tiltsim: live view ended: {error}\n")

    def _send_waiting(self) -> None:
        """Send all samples that have come since the last time, as one piece of the flight."""
        samples = []
        try:
            while True:
                samples.append(self._samples.get_nowait())
        except Empty:
            pass
        if samples:
            now = float(samples[-1][0])
            piece = Flight(self._scenario, np.array(samples), End("completed", now), "python", 0.0)
            self._recorder.append(piece)


def _leave_behind() -> None:
    """Let the program end although a viewer has not taken all: Rerun would wait without end."""
    import rerun as rr

    rr.unregister_shutdown()
    sys.stderr.write("tiltsim: the viewer does not answer; the live view is incomplete\n")
