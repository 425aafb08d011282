"""Progress on a terminal, also on one that reports no size, as on CI services."""

from __future__ import annotations

import os
import re
import sys
import time
from contextlib import contextmanager, nullcontext, suppress
from threading import Semaphore, Thread
from types import SimpleNamespace

import numpy as np
import pytest

import tiltsim.views.video
import tiltsim.views.video.rendering
from tests.flights import saved
from tests.sweeps.files import short_sweep
from tiltsim.cli import main
from tiltsim.commands import text
from tiltsim.commands.text import show_progress

pty = pytest.importorskip("pty")


class Shown:
    """Output of a terminal without a size."""

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
    with terminal_as_stderr(monkeypatch) as shown, show_progress(shown=True) as progress:
        progress.begin("flights", 5, done=1)
        for count in (2, 3):
            time.sleep(0.11)
            progress.move(count)
    assert re.search(r"flights:  20%\|.*\| 1/5 \[\d\d:\d\d<\?, \?/s\]", shown.text)
    rate = r" +\d\.\d\d(/s|s/)"  # the latter on a machine that is very busy
    assert re.search(rf"\| 3/5 \[\d\d:\d\d<\d\d:\d\d,{rate}\]", shown.text)


def test_a_total_may_change(monkeypatch, capsys):
    with terminal_as_stderr(monkeypatch) as shown, show_progress(shown=True) as progress:
        progress.tell("flights", 1, 10)
        progress.tell("flights", 2, 4)
        progress.tick()
    assert "| 2/4 [" in shown.text
    with show_progress(shown=True) as progress:
        progress.tell("flights", 1, 10)
        progress.tell("flights", 2, 4)
        progress.tick()
    assert "flights: 2 of 4, 0:00" in capsys.readouterr().err


def test_the_clock_moves_while_nothing_is_finished(monkeypatch):
    ticks, tick = Semaphore(0), text._Bars.tick

    def counted(bars):
        tick(bars)
        if bars._bar is not None:
            ticks.release()

    monkeypatch.setattr(text._Bars, "tick", counted)
    monkeypatch.setattr(text.Progress, "interval", 0.02)
    with terminal_as_stderr(monkeypatch) as shown, show_progress(shown=True) as moving:
        moving.begin("flights", 5)
        assert all(ticks.acquire(timeout=60.0) for _ in range(6))
    assert shown.text.count("| 0/5 [") > 5


def test_time_is_shown_on_a_terminal_of_unknown_size(monkeypatch):
    with terminal_as_stderr(monkeypatch) as shown, show_progress(shown=True) as progress:
        progress.begin("flight", 2.0)
        progress.begin("writing")
    assert "| 0.0/2 s [00:00<?]" in shown.text
    assert "writing [00:00]" in shown.text


def test_lines_of_results_and_bars_do_not_mix(monkeypatch, capsys):
    with terminal_as_stderr(monkeypatch) as shown, show_progress(shown=True) as progress:
        progress.tell("flights", 1, 2)
        progress.print("ok a\x1b[2J")
        progress.print("warning", error=True)
    assert capsys.readouterr().out == "ok a\\x1b[2J\n"
    assert "\rwarning\r\n" in shown.text


def test_without_a_terminal_lines_tell_how_far_it_is(monkeypatch, capsys):
    monkeypatch.setattr(text._Lines, "interval", 1e6)
    clock = iter(range(0, 10_000, 30))
    monkeypatch.setattr(text, "monotonic", lambda: next(clock))
    with show_progress(shown=True) as lines:
        lines.tick()
        lines.tell("flights", 1_234_010, 1_234_100)
        lines.move(1_234_020)
        lines.tick()
    assert capsys.readouterr().err.splitlines() == [
        "tiltsim: starting, 0:30",
        "tiltsim: flights: 1234020 of 1234100, 0:30, about 4:00 left",
    ]


def test_without_a_terminal_a_line_comes_every_interval(monkeypatch):
    ticks = Semaphore(0)
    monkeypatch.setattr(text._Lines, "interval", 0.01)
    monkeypatch.setattr(text._Lines, "tick", lambda _lines: ticks.release())
    with show_progress(shown=True):
        assert all(ticks.acquire(timeout=60.0) for _ in range(3))


def test_the_silence_is_below_ten_seconds_and_short_work_says_nothing(capsys):
    assert 5.0 < text._Lines.interval < 10.0
    with show_progress(shown=True) as lines:
        lines.begin("flights", 5)
    assert capsys.readouterr().err == ""


def test_quiet_shows_nothing(monkeypatch):
    with terminal_as_stderr(monkeypatch) as shown, show_progress(shown=False) as progress:
        progress.tell("flights", 1, 2)
    assert shown.text == ""


def test_a_sweep_shows_how_far_it_is(tmp_path, monkeypatch):
    file = short_sweep(tmp_path / "sweep.toml")
    with terminal_as_stderr(monkeypatch) as shown:
        assert main(["sweep", str(file), "--out", str(tmp_path / "out"), "--jobs", "1"]) == 0
    assert "checking the sweep [00:00]" in shown.text
    assert "\rshort flights: 12 flights\r\n" in shown.text
    assert re.search(r"flights: +0%\|.*\| 0/12 \[", shown.text)


def test_a_video_counts_its_frames(tmp_path, monkeypatch):
    def frame(_sample):
        time.sleep(0.02)
        return np.zeros((64, 64, 3), dtype=np.uint8)

    stage = SimpleNamespace(canvas=nullcontext(), frame=frame)
    monkeypatch.setattr(tiltsim.views.video, "prefer_offscreen_gl", lambda: None)
    monkeypatch.setattr(tiltsim.views.video.rendering, "FlightRenderer", lambda *_: stage)
    with terminal_as_stderr(monkeypatch) as shown:
        assert main(["video", str(saved("fixed", tmp_path)), "--size", "64x64", "--fps", "10"]) == 0
    assert re.search(r"frames: +0%\|.*\| 0/13 \[00:00<\?, \?/s\]", shown.text)
    assert re.search(r"\| [1-9]\d*/13 \[", shown.text)
