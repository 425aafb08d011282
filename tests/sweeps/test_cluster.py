"""A sweep on a Dask cluster started by hand, as docs/sweeps.md shows it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from importlib.util import find_spec

import pytest

from tests.sweeps.files import short_sweep
from tiltsim.cli import main
from tiltsim.errors import InputError
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.running import _connect, run_sweep

pytestmark = pytest.mark.skipif(
    find_spec("distributed") is None, reason="needs the extra tiltsim[cluster]"
)

DASK = (sys.executable, "-m", "distributed.cli.dask_{}")


@contextmanager
def dask(kind, *arguments):
    command = [part.format(kind) for part in DASK]
    with subprocess.Popen(
        [*command, *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as process:
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def free_port():
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        return server.getsockname()[1]


def wait_for_workers(address, count):
    from distributed import Client

    with Client(address, timeout=300, set_as_default=False) as client:
        client.wait_for_workers(count, timeout=300)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_loses_a_worker_gives_the_local_dataset(tmp_path):
    file = short_sweep(tmp_path / "sweep.toml", count=60, chunk_size=3)
    definition = load_sweep(file)
    local = run_sweep(definition, tmp_path / "local")
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    scheduler = ["--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    worker = [address, "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path)]
    with dask("scheduler", *scheduler), dask("worker", *worker), dask("worker", *worker) as second:
        wait_for_workers(address, 2)
        killed_at = []

        def report(rows):
            if rows >= 12 and not killed_at:
                os.killpg(second.pid, signal.SIGKILL)
                killed_at.append(rows)

        remote = run_sweep(definition, tmp_path / "remote", cluster=address, report=report)
    assert killed_at
    assert killed_at[0] < 120
    assert remote.read_bytes() == local.read_bytes()


@pytest.mark.filterwarnings("ignore")
def test_an_unreachable_cluster_is_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("tiltsim.sweeps.running.CONNECT_TIMEOUT", 1.0)
    file = short_sweep(tmp_path / "sweep.toml")
    address = f"tcp://127.0.0.1:{free_port()}"
    start = time.monotonic()
    options = ["--cluster", address, "--out", str(tmp_path / "out"), "--quiet"]
    assert main(["sweep", str(file), *options]) == 2
    assert time.monotonic() - start < 60.0
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "cannot reach a scheduler" in error
    assert address in error


@pytest.mark.parametrize("address", ["nowhere", "tcp://nowhere", "http://nowhere:8786", ":1"])
def test_an_invalid_address_is_refused_immediately(tmp_path, capsys, address):
    file = short_sweep(tmp_path / "sweep.toml")
    options = ["--cluster", address, "--out", str(tmp_path / "out"), "--quiet"]
    assert main(["sweep", str(file), *options]) == 2
    assert capsys.readouterr().err.endswith("such as tcp://192.168.0.1:8786\n")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_is_killed_is_one_line(tmp_path, capfd):
    file = short_sweep(tmp_path / "sweep.toml", count=300, chunk_size=3)
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    scheduler = ["--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    worker = [address, "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path)]
    with dask("scheduler", *scheduler) as process, dask("worker", *worker):
        wait_for_workers(address, 1)

        def report(rows):
            if rows >= 12:
                process.kill()

        with pytest.raises(InputError) as caught:
            run_sweep(load_sweep(file), tmp_path / "out", cluster=address, report=report)
    assert str(caught.value).startswith(f"--cluster {address}: the scheduler no longer answers; ")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ModuleNotFoundError("No module named 'distributed'", name="distributed"), "needs Dask"),
        (ImportError("cannot import name 'X' from 'tornado'", name="tornado"), "cannot import nam"),
    ],
)
def test_only_a_missing_dask_is_called_so(monkeypatch, error, words):
    class Broken:
        def find_spec(self, name, *_):
            if name == "distributed":
                raise error

    monkeypatch.delitem(sys.modules, "distributed", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Broken(), *sys.meta_path])
    with pytest.raises(InputError, match=words):
        _connect("tcp://127.0.0.1:1")


def test_without_dask_the_extra_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    file = short_sweep(tmp_path / "sweep.toml")
    options = ["--cluster", "tcp://127.0.0.1:1", "--out", str(tmp_path / "out"), "--quiet"]
    assert main(["sweep", str(file), *options]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "pip install 'tiltsim[cluster]'" in error
