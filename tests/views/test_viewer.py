"""The viewer shows recordings and live flights without errors."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from types import SimpleNamespace

import pytest

import tiltsim.views.rerun.viewer as viewer_module
from tests.flights import flight
from tests.views.viewer_shot import (
    client_of,
    free_port,
    missing_driver,
    shoot,
    viewer,
    viewer_process,
    wait_for,
)
from tiltsim.errors import InputError
from tiltsim.flight.reading import load_flight
from tiltsim.simulation.simulate import simulate
from tiltsim.views.rerun.recording import save_recording
from tiltsim.views.rerun.viewer import LiveStream
from tiltsim.views.signals import signals_of

needs_driver = pytest.mark.skipif(bool(missing_driver()), reason=missing_driver())


@pytest.mark.viewer
@needs_driver
@pytest.mark.parametrize("names", [["free"], ["tilt_car"], ["fixed", "trot"]])
def test_the_viewer_reports_no_errors(names, tmp_path):
    path = tmp_path / "flight.rrd"
    save_recording([flight(name) for name in names], path)
    shot = shoot(path, 1.0, "800x500")
    assert shot.reports == []
    plots = len(signals_of(flight(names[0]).assembly)) if len(names) == 1 else 5
    others = 2 if names == ["tilt_car"] else 2 + len(names)  # trajectory, events and planes
    assert len(shot.views) == plots + others + len(names)
    assert shot.png.startswith(b"\x89PNG")


@pytest.mark.viewer
@needs_driver
def test_the_viewer_receives_a_live_flight():
    port = free_port()
    url = f"rerun+http://127.0.0.1:{port}/proxy"
    with viewer("800x600", port) as client:
        with LiveStream(flight("fixed").scenario, url) as stream:
            stream.finish(simulate(flight("fixed").scenario, stream).end)
        (recording,) = wait_for(lambda: client.get_state().recordings, "the live recording")
        assert "tiltsim" in str(recording)


@pytest.mark.viewer
@needs_driver
@pytest.mark.parametrize("stop", ["kill", "freeze"])
def test_closing_the_viewer_does_not_affect_the_flight(stop, tmp_path):
    port = free_port()
    url = f"rerun+http://127.0.0.1:{port}/proxy"
    name = "ch04_tracking/setpoint#rho_065_modified"
    options = ["--set", "simulation.duration=20", "--set", "simulation.engine=python", "--quiet"]
    command = [sys.executable, "-m", "tiltsim", "run", name, "--connect", url, *options]
    with viewer_process(port) as process:
        client = client_of(process, port)
        run = subprocess.Popen([*command, "--out", str(tmp_path)])
        try:
            wait_for(lambda: client.get_state().recordings, "the live recording")
            process.send_signal(signal.SIGKILL if stop == "kill" else signal.SIGSTOP)
            assert run.wait(120) in (0, 1)
        finally:
            run.kill()
    this = load_flight(tmp_path)
    assert (this.end.kind, len(this)) == ("completed", 2001)
    assert (tmp_path / "metrics.json").is_file()


def test_the_opened_viewer_listens_to_this_machine_only(monkeypatch):
    port, started, received = free_port(), [], []
    url = f"rerun+http://127.0.0.1:{port}/proxy"
    listener = socket.socket()

    def start(command, **_options):
        started.append(command[1:])
        listener.bind(("127.0.0.1", port))
        listener.listen()
        return SimpleNamespace(poll=lambda: None)

    class Recording:
        def connect_grpc(self, url, default_blueprint):
            received.append((url, default_blueprint))

    monkeypatch.setattr(viewer_module, "DEFAULT_URL", url)
    monkeypatch.setattr(viewer_module.subprocess, "Popen", start)
    with listener:
        for blueprint in ("first", "second"):  # a viewer that is open is not opened again
            viewer_module.attach_viewer(Recording(), None, blueprint)
    assert len(started) == 1
    assert started[0][:2] == ["--bind", "127.0.0.1"]
    assert received == [(url, "first"), (url, "second")]


def test_a_viewer_that_ends_at_once_is_an_error_of_one_line(tmp_path, monkeypatch):
    """A usable screen is missing, which it finds out once it listens."""
    program = tmp_path / "rerun"
    program.write_text("#!/bin/sh\necho begins >&2\necho Error: no screen >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setattr("rerun_cli.__file__", str(tmp_path / "__init__.py"))
    monkeypatch.setattr(viewer_module, "require_viewer", lambda _: None)
    monkeypatch.setattr(viewer_module, "viewer_listens", lambda _: False)
    recording = tmp_path / "flight.rrd"
    recording.write_bytes(b"RRF2")
    line = "^the Rerun viewer ended at once: Error: no screen$"
    with pytest.raises(InputError, match=line):
        viewer_module.attach_viewer(None, None, None)
    with pytest.raises(InputError, match=line):
        viewer_module.view_recordings([recording])
