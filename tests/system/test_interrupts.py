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
from tiltsim.system.interrupts import (
    defer_interrupts,
    reraise_swallowed_interrupts,
    terminations_as_interrupts,
)

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
    """Call a function as compiled code does: what it raises is reported and dropped."""
    CALLED_BACK(function)()


def test_an_interrupt_swallowed_by_c_is_raised_after_the_block():
    def raises():
        raise KeyboardInterrupt

    reached = []

    def work():
        with reraise_swallowed_interrupts():
            call_from_c(raises)
            reached.append("goes on")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached == ["goes on"]


def test_an_interrupt_swallowed_by_c_comes_before_what_fails_of_it():
    def raises():
        raise KeyboardInterrupt

    def work():
        with reraise_swallowed_interrupts():
            call_from_c(raises)
            raise LookupError

    with pytest.raises(KeyboardInterrupt):
        work()


def test_other_exceptions_swallowed_by_c_are_reported_as_usual(monkeypatch):
    def raises():
        raise LookupError

    reported = []
    monkeypatch.setattr(sys, "unraisablehook", lambda found: reported.append(found.exc_type))
    with reraise_swallowed_interrupts():
        call_from_c(raises)
    call_from_c(raises)
    assert reported == [LookupError, LookupError]


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
        with defer_interrupts(), reraise_swallowed_interrupts():
            ran.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert ran == [True]


def test_an_interrupt_while_files_are_written_loses_none(tmp_path, monkeypatch, capsys):
    flight = flight_named("fixed")
    monkeypatch.setattr(tiltsim.commands.run, "fly", lambda *_: flight)
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
