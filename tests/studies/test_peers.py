"""Other simulators beside ours."""

from __future__ import annotations

import pytest

from tiltsim.errors import InputError
from tiltsim.studies import peers


def test_an_absent_peer_is_one_line(monkeypatch):
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    message = "--peer crazyflow: not installed; python -m pip install crazyflow"
    with pytest.raises(InputError, match=message), peers.running("crazyflow"):
        pass


def test_a_failing_peer_is_reported(monkeypatch):
    monkeypatch.setattr(peers, "find_spec", lambda name: name)
    monkeypatch.setitem(peers.PEERS, "json", peers.PeerCase(None, 1, 1))  # not known in its process
    with pytest.raises(InputError, match="--peer json: it failed"), peers.running("json"):
        pass


def test_a_peer_of_an_interrupted_benchmark_is_silent(monkeypatch, capfd, tmp_path):
    waiting = tmp_path / "python"
    waiting.write_text("#!/bin/sh\nexec sleep 60\n")
    waiting.chmod(0o755)

    def interrupted(_peer):
        raise KeyboardInterrupt

    monkeypatch.setattr(peers, "find_spec", lambda name: name)
    monkeypatch.setitem(peers.PEERS, "json", peers.PeerCase(None, 1, 1))
    monkeypatch.setattr(peers.Peer, "_answer", interrupted)
    monkeypatch.setattr(peers.sys, "executable", str(waiting))
    with pytest.raises(KeyboardInterrupt), peers.running("json"):
        pass
    assert capfd.readouterr().err == ""


@pytest.mark.slow
def test_rotorpy_is_timed_in_its_own_process():
    pytest.importorskip("rotorpy")
    with peers.running("rotorpy") as peer:
        peer.time()
        peer.time()
        row = peer.row()
    assert row["simulator"].startswith("rotorpy ")
    assert row["steps_per_second"] == pytest.approx(100 / peer.timings[1][0])
