"""Recordings that a separate process writes."""

from __future__ import annotations

import os
import pickle
import signal
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from tests.flights import flight
from tests.views.recordings import rerun_rrd
from tiltsim.errors import InputError
from tiltsim.views.rerun.recording import save_recording
from tiltsim.views.rerun.recording_process import RecordingProcess


def test_the_process_reports_an_error(tmp_path):
    path = tmp_path / "no folder" / "flight.rrd"
    with RecordingProcess(flight("fixed").scenario) as process:
        process.start(flight("fixed"), path)
        with pytest.raises(InputError, match=r"flight\.rrd: cannot be written: No such file"):
            process.finish()


def test_a_recording_is_written_although_its_process_was_killed(tmp_path):
    this, paths = flight("trot"), [tmp_path / "a.rrd", tmp_path / "b.rrd"]
    with RecordingProcess(this.scenario) as process:
        process._process.kill()
        process._process.join()
        process.start(this, paths[0])
        process.finish()
    save_recording([this], paths[1])
    done = rerun_rrd("compare", *paths)
    assert done.returncode == 0, done.stderr


def test_the_process_ends_with_an_interrupted_flight():
    with pytest.raises(KeyboardInterrupt), RecordingProcess(flight("trot").scenario) as process:
        raise KeyboardInterrupt
    assert process._process.exitcode is not None


@pytest.mark.slow
def test_the_process_prints_nothing_if_its_answer_is_not_read(tmp_path, capfd):
    """As if another file of the flight could not be written."""
    path = tmp_path / "flight.rrd"
    with RecordingProcess(flight("fixed").scenario) as process:
        process.start(flight("fixed"), path)
    assert process._process.exitcode == 0
    assert path.is_file()
    assert capfd.readouterr().err == ""


@pytest.mark.slow
def test_the_process_prints_nothing_about_an_incomplete_message(capfd):
    with RecordingProcess(flight("fixed").scenario) as process:
        process._work = flight("fixed"), Path("nowhere")
        message = pickle.dumps(process._work)
        header = struct.pack("!i", len(message))  # of `multiprocessing.connection`
        os.write(process._connection.fileno(), header + message[:1000])
        process._answers = process._connection.close
    assert process._process.exitcode == 0
    assert capfd.readouterr().err == ""


def test_the_process_ends_with_its_parent(tmp_path):
    """Even if that is killed and cannot clean up."""
    program = (
        "import os, signal; from tests.flights import flight; "
        "from tiltsim.views.rerun.recording_process import RecordingProcess; "
        "RecordingProcess(flight('fixed').scenario); os.kill(os.getpid(), signal.SIGKILL)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    # Both write to one pipe, of which the end is seen when both have ended.
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment, stderr=subprocess.PIPE, text=True, timeout=300)
    assert (done.returncode, done.stderr) == (-signal.SIGKILL, "")


@pytest.mark.slow
def test_recording_a_flight_does_not_import_rerun(tmp_path):
    path = tmp_path / "flight.rrd"
    options = ["--set", "simulation.duration=0.1", "--set", "expect=[]", "--quiet"]
    arguments = ["run", "ch04_tracking/setpoint#rho_065_modified", *options, "--rerun", str(path)]
    program = (
        f"import sys; from tiltsim.cli import main; main({arguments!r}); "
        "assert 'rerun' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert path.is_file()
