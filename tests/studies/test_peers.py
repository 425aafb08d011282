"""Other simulators beside ours."""

from __future__ import annotations

import pytest

from tiltsim.errors import InputError
from tiltsim.studies import peers
from tiltsim.system.processes import begin


def test_an_absent_peer_is_one_line(monkeypatch):
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    message = "--peer crazyflow: not installed; python -m pip install crazyflow"
    with pytest.raises(InputError, match=message), peers.running("crazyflow"):
        pass


def test_a_failing_peer_is_reported(monkeypatch):
    monkeypatch.setattr(peers, "find_spec", lambda name: name)
    monkeypatch.setitem(peers.PEERS, "json", peers.PeerCase(None, 1, 1))  # not known in its process
    with pytest.raises(InputError, match="--peer json: it failed: KeyError"), peers.running("json"):
        pass


def test_a_peer_of_an_interrupted_benchmark_ends_in_silence(monkeypatch, capfd):
    begun = []

    def recorded(work):
        begun.append(begin(work))
        return begun[0]

    def interrupted(_peer, _request):
        raise KeyboardInterrupt

    monkeypatch.setattr(peers, "find_spec", lambda name: name)
    monkeypatch.setattr(peers, "begin", recorded)
    monkeypatch.setattr(peers.Peer, "_answer", interrupted)
    with pytest.raises(KeyboardInterrupt), peers.running("rotorpy"):
        pass
    [(process, _)] = begun
    assert not process.is_alive()
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
