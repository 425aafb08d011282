"""Live streams to viewers that respond, do not respond, or break."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from tests.flights import flight
from tiltsim.simulation.simulate import simulate
from tiltsim.views.rerun.viewer import LiveStream


class BlockedRecorder:
    """A recorder that blocks until it is released, or raises an error."""

    def __init__(self, error=None):
        self.released = threading.Event()
        self.error = error
        self.continued = False

    def draw_references(self, _until):
        pass

    def append(self, _pieces):
        if self.error:
            raise self.error
        self.released.wait(300.0)
        self.continued = True

    def finish(self, _ends):
        pass


@pytest.fixture
def listener():
    """The address of a server that never responds."""
    import socket

    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"rerun+http://127.0.0.1:{server.getsockname()[1]}/proxy"


def stream_to(recorder, url, monkeypatch, farewell=30.0):
    from tiltsim.views.rerun import viewer

    monkeypatch.setattr(viewer, "attach_viewer", lambda *_: None)
    monkeypatch.setattr(viewer, "SHUTDOWN_TIMEOUT", farewell)
    stream = LiveStream(flight("fixed").scenario, url)
    monkeypatch.setattr(stream, "_recording", recorder)
    return stream


def test_an_unresponsive_viewer_does_not_delay_the_flight(listener, monkeypatch, capsys):
    blocked = BlockedRecorder()
    with stream_to(blocked, listener, monkeypatch, farewell=0.3) as stream:
        this = simulate(flight("fixed").scenario, stream)
        stream.finish(this.end)
    assert not blocked.continued, "the flight has waited for the recorder"
    assert "the viewer does not respond" in capsys.readouterr().err
    assert this.end.kind == "completed"
    np.testing.assert_array_equal(this.samples, flight("fixed").samples)
    blocked.released.set()


def test_a_broken_stream_prints_one_line(listener, monkeypatch, capsys):
    with stream_to(BlockedRecorder(OSError("gone")), listener, monkeypatch) as stream:
        this = simulate(flight("fixed").scenario, stream)
        stream.finish(this.end)
    assert this.end.kind == "completed"
    assert capsys.readouterr().err == "tiltsim: live view ended: gone\n"


def test_all_samples_reach_the_recorder_in_order(listener, monkeypatch):
    pieces = []

    class Taker(BlockedRecorder):
        def append(self, latest):
            pieces.extend(piece.samples for piece in latest)

    with stream_to(Taker(), listener, monkeypatch) as stream:
        this = simulate(flight("fixed").scenario, stream)
    np.testing.assert_array_equal(np.concatenate(pieces), this.samples)
