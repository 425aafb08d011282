"""Interrupts from the keyboard: none is dropped, and none loses what is computed."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

import tiltsim.commands.run
from tests.flights import flight as flight_named
from tiltsim.cli import main
from tiltsim.flight.reading import load_flight
from tiltsim.system.interrupts import defer_interrupts, terminations_as_interrupts

CALLED_BACK = ctypes.CFUNCTYPE(None)
TELLING = """
import time
from pathlib import Path
from tiltsim import Command

def law(observation):
    if observation.time > 0.1:
        Path(__file__).with_suffix(".flying").touch()
        time.sleep(0.05)
    return Command(thrusts=[1.05105] * 4)
"""


def interrupt():
    os.kill(os.getpid(), signal.SIGINT)


def call_from_c(function):
    """Call a function as compiled code does: exceptions are reported and dropped."""
    CALLED_BACK(function)()


def test_an_interrupt_waits_for_the_block_and_is_raised_after_it():
    done = []

    def work():
        with defer_interrupts():
            interrupt()
            done.append("finished")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == ["finished"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_second_interrupt_does_not_wait():
    def work():
        with defer_interrupts():
            interrupt()
            interrupt()
            pytest.fail("still running")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_threads_are_unaffected():
    ran = []

    def work():
        with defer_interrupts():
            ran.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert ran == [True]


def test_an_interrupt_while_files_are_written_loses_none(tmp_path, monkeypatch, capsys):
    flight = flight_named("fixed")
    monkeypatch.setattr(tiltsim.commands.run, "fly", lambda *_, **__: flight)
    save = type(flight).save

    def interrupted_save(self, folder):
        interrupt()
        save(self, folder)

    monkeypatch.setattr(type(flight), "save", interrupted_save)
    address = "ch04_tracking/setpoint#rho_065_modified"
    assert main(["run", address, "--out", str(tmp_path), "--quiet"]) == 130
    assert len(load_flight(tmp_path)) == len(flight)
    assert (tmp_path / "scenario.toml").exists()
    assert "interrupted" in capsys.readouterr().err


DURING_A_BATCH = """
import signal
import mujoco
from mujoco.batch import Batch
from tiltsim.system.hooks import mujoco_hooks

FALLING = "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
batch = Batch(mujoco.MjModel.from_xml_string(FALLING), 2, 1)
batch.bind("qvel")[1] = 1e30  # MuJoCo warns of this row, after the long flight of the first
signal.signal(signal.SIGALRM, signal.default_int_handler)
signal.setitimer(signal.ITIMER_REAL, 0.02)
try:
    with mujoco_hooks():
        batch.rollout(500_000, record=())
except KeyboardInterrupt:
    print("interrupted", int(batch.warning[1].sum()))
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs a timer of POSIX")
def test_an_interrupt_while_mujoco_warns_in_a_batch_is_raised_after_it():
    command = [sys.executable, "-c", DURING_A_BATCH]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "interrupted 1\n", "")


@pytest.mark.parametrize("keyboard", [signal.default_int_handler, signal.SIG_IGN])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_swallowed_interrupt_of_a_command_is_sent_again(keyboard, number, capsys):
    if (keyboard, number) == (signal.SIG_IGN, signal.SIGINT):
        return
    swallowed = []

    def interrupted():
        try:
            os.kill(os.getpid(), number)
            time.sleep(1.0)
        except KeyboardInterrupt:
            swallowed.append(True)
            raise

    def work():
        call_from_c(interrupted)
        if len(swallowed) == 1:
            call_from_c(lambda: time.sleep(1.0))  # the second is also swallowed
        time.sleep(20.0)

    before = signal.signal(signal.SIGINT, keyboard)
    try:
        with terminations_as_interrupts() as terminated, pytest.raises(KeyboardInterrupt):
            work()
        assert signal.getsignal(signal.SIGINT) is keyboard
    finally:
        signal.signal(signal.SIGINT, before)
    assert terminated() is (number == signal.SIGTERM)
    assert capsys.readouterr().err == ""


@pytest.mark.skipif(sys.platform == "win32", reason="other signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_the_exit_code_is_the_same_if_text_is_executed(number, code):
    script = f"""
import signal, sys
import tiltsim.commands.files
from tiltsim.__main__ import main

def run():
    exec("signal.raise_signal({int(number)})")

tiltsim.commands.files.run_list = run
sys.argv = ["tiltsim", "list"]
sys.exit(main())
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, "tiltsim: interrupted\n")


def terminate():
    os.kill(os.getpid(), signal.SIGTERM)


@pytest.mark.parametrize("keyboard", [signal.default_int_handler, signal.SIG_IGN])
def test_a_termination_interrupts_and_a_second_one_would_kill(keyboard):
    before = signal.signal(signal.SIGINT, keyboard)
    ended = signal.getsignal(signal.SIGTERM)
    try:
        with terminations_as_interrupts() as terminated:
            assert not terminated()
            with pytest.raises(KeyboardInterrupt):
                terminate()
            assert terminated()
            assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGINT, before)
    assert signal.getsignal(signal.SIGTERM) is ended


@pytest.mark.parametrize("keyboard", [signal.default_int_handler, signal.SIG_IGN])
def test_a_termination_waits_for_a_deferred_block(keyboard):
    done = []

    def work():
        with terminations_as_interrupts(), defer_interrupts():
            with defer_interrupts():
                terminate()
                done.append("inner")
            done.append("outer")

    before = signal.signal(signal.SIGINT, keyboard)
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
        assert signal.getsignal(signal.SIGINT) is keyboard
    finally:
        signal.signal(signal.SIGINT, before)
    assert done == ["inner", "outer"]


@pytest.mark.slow
def test_a_terminated_run_keeps_its_flight_and_leaves_no_part_file(tmp_path):
    law, out = tmp_path / "law.py", tmp_path / "out"
    law.write_text(TELLING, encoding="utf-8")
    command = [sys.executable, "-m", "tiltsim", "run", "ch04_tracking/setpoint#rho_065_modified"]
    options = ["--controller", f"{law}:law", "--out", str(out), "--rerun", str(out / "flight.rrd")]
    out.mkdir()
    with subprocess.Popen([*command, *options], stderr=subprocess.PIPE, text=True) as process:
        while not law.with_suffix(".flying").exists() and process.poll() is None:
            time.sleep(0.02)
        process.terminate()
        _, error = process.communicate(timeout=300.0)
    assert (process.returncode, error.splitlines()[-1][:29]) == (
        143,
        "tiltsim: interrupted at t = 0",
    )
    assert load_flight(out).end.kind == "interrupted"
    names = ["flight.parquet", "flight.rrd", "law.py", "metrics.json", "scenario.toml"]
    assert sorted(path.name for path in out.iterdir()) == names
