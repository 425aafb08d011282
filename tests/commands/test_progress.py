"""Progress on a terminal, also on one that reports no size, as those of CI services do."""

from __future__ import annotations

import os
import re
import sys
import time
from contextlib import contextmanager, nullcontext, suppress
from threading import Thread
from types import SimpleNamespace

import numpy as np
import pytest

import tiltsim.views.video
import tiltsim.views.video.rendering
from tests.flights import saved
from tests.sweeps.files import short_sweep
from tiltsim.cli import main
from tiltsim.commands import progress
from tiltsim.commands.progress import counting_bar, progress_bar

pty = pytest.importorskip("pty")


class Shown:
    """What a terminal of no size shows."""

    def __init__(self):
        self.text = ""


@contextmanager
def terminal_as_stderr(monkeypatch):
    """Within the block standard error is a terminal; all that it showed is known at the end."""
    keyboard, screen = pty.openpty()
    assert os.get_terminal_size(screen) == (0, 0)
    found, shown = bytearray(), Shown()

    def read():
        with suppress(OSError):  # how Linux reports that the other side is closed
            while part := os.read(keyboard, 4096):
                found.extend(part)

    reader = Thread(target=read, daemon=True)
    reader.start()
    with monkeypatch.context() as patch, os.fdopen(screen, "w", encoding="utf-8") as stream:
        patch.setattr(sys, "stderr", stream)
        yield shown
    reader.join()
    os.close(keyboard)
    shown.text = found.decode()


def test_a_count_is_shown_from_the_start_with_rate_and_time_left(monkeypatch):
    with terminal_as_stderr(monkeypatch) as shown, counting_bar(5, "flights", shown=True) as move:
        move(1)
        for count in (2, 3):
            time.sleep(0.11)
            move(count)
    assert re.search(r"\| 1/5 flights \[\d\d:\d\d<\?, \? flights/s\]", shown.text)
    rate = r" +\d\.\d\d( flights/s|s/ flights)"  # the latter on a machine that is very busy
    assert re.search(rf"\| 3/5 flights \[\d\d:\d\d<\d\d:\d\d,{rate}\]", shown.text)


def test_the_clock_moves_while_nothing_is_finished(monkeypatch):
    monkeypatch.setattr(progress, "TICK", 0.02)
    with terminal_as_stderr(monkeypatch) as shown, counting_bar(5, "flights", shown=True) as move:
        move(0)
        time.sleep(1.0)
    assert shown.text.count("| 0/5 flights") > 5


def test_time_is_shown_on_a_terminal_of_unknown_size(monkeypatch):
    with terminal_as_stderr(monkeypatch) as shown, progress_bar(2.0, "s", shown=True) as move:
        move(0.0)
    assert "| 0.0/2 s [00:00<?]" in shown.text


def test_quiet_shows_nothing(monkeypatch):
    with terminal_as_stderr(monkeypatch) as shown, counting_bar(2, "flights", shown=False) as move:
        move(1)
    assert shown.text == ""


def test_a_sweep_shows_how_far_it_is(tmp_path, monkeypatch):
    file = short_sweep(tmp_path / "sweep.toml")
    with terminal_as_stderr(monkeypatch) as shown:
        assert main(["sweep", str(file), "--out", str(tmp_path / "out"), "--jobs", "1"]) == 0
    assert shown.text.startswith("short flights: 12 flights\r\n")
    assert "| 0/12 flights [" in shown.text


def test_a_video_counts_its_frames(tmp_path, monkeypatch):
    def frame(_sample):
        time.sleep(0.02)
        return np.zeros((64, 64, 3), dtype=np.uint8)

    stage = SimpleNamespace(canvas=nullcontext(), frame=frame)
    monkeypatch.setattr(tiltsim.views.video, "prefer_offscreen_gl", lambda: None)
    monkeypatch.setattr(tiltsim.views.video.rendering, "FlightRenderer", lambda *_: stage)
    with terminal_as_stderr(monkeypatch) as shown:
        assert main(["video", str(saved("fixed", tmp_path)), "--size", "64x64", "--fps", "10"]) == 0
    assert "| 0/13 frames [00:00<?, ? frames/s]" in shown.text
    assert re.search(r"\| [1-9]\d*/13 frames \[", shown.text)
