"""Progress of a command: a bar on a terminal, elsewhere a line every few seconds."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING, Final

from tiltsim.commands.text import print_line
from tiltsim.system.text import printable

if TYPE_CHECKING:
    from tqdm import tqdm

TICK: Final = 1.0  # interval (s) at which the clock of a bar moves while nothing is finished
LINE_INTERVAL: Final = 8.0
"""Interval (s) of the lines where there is no terminal: CI services end a job that is silent."""


class Progress:
    """The stages of a command, one after the other; this class shows nothing."""

    interval = TICK
    _stage = ""
    _total = _done = _initial = _start = 0.0

    def begin(self, stage: str, total: float = 0, done: float = 0) -> None:
        """Begin a stage; one that counts is called like the things counted, as ``flights``.

        ``total`` are seconds if a float, a number of things if an integer, and 0 if not known;
        ``done`` is the number that an earlier run has finished, which the rate leaves out.
        """
        self._stage, self._total, self._done, self._initial = stage, total, done, done
        self._start = monotonic()

    def move(self, done: float) -> None:
        """Report how much of the stage is done."""
        self._done = done

    def tell(self, stage: str, done: int, total: int) -> None:
        """Report how much of a stage is done; the first report begins the stage."""
        if stage != self._stage:
            self.begin(stage, total, done)
        self._total = total
        self.move(done)

    def print(self, line: str, *, error: bool = False) -> None:
        """Print a line, of results or to standard error."""
        print_line(line, error=error)

    def tick(self) -> None:
        """Called every ``interval``, from another thread."""

    def end(self) -> None:
        """Remove the display."""


class _Bars(Progress):
    """A bar per stage, as wide as the terminal, or 80 columns if that reports no size."""

    _bar: tqdm | None = None

    def begin(self, stage: str, total: float = 0, done: float = 0) -> None:
        from tqdm import tqdm

        super().begin(stage, total, done)
        self.end()
        if isinstance(total, float):
            values = "{n:.1f}/{total:g} s [{elapsed}<{remaining}]"
        else:
            values = "{n}/{total} [{elapsed}<{remaining}, {rate_noinv_fmt}]"
        shown = ": {percentage:3.0f}%|{bar}| " + values if total else " [{elapsed}]"
        try:
            columns, lines = os.get_terminal_size(sys.stderr.fileno())
        except OSError:
            columns, lines = 0, 0
        # On a terminal of unknown size tqdm's default is to show no bar at all.
        size = {"ncols": columns or 80, "nrows": lines or 24}
        self._bar = tqdm(
            total=total, initial=done, unit="", leave=False, bar_format=stage + shown, **size
        )

    def move(self, done: float) -> None:
        super().move(done)
        if self._bar is not None:
            self._bar.total = self._total
            if not self._total:
                self._bar.bar_format = self._stage + ": {n} [{elapsed}]"
            self._bar.update(done - self._bar.n)

    def print(self, line: str, *, error: bool = False) -> None:
        from tqdm import tqdm

        tqdm.write(printable(line), file=sys.stderr if error else sys.stdout)

    def tick(self) -> None:
        if self._bar is not None:
            self._bar.refresh()

    def end(self) -> None:
        if self._bar is not None:
            self._bar.close()


class _Lines(Progress):
    """A line per interval, none in the first one."""

    interval = LINE_INTERVAL

    def __init__(self) -> None:
        self.begin("starting")

    def tick(self) -> None:
        elapsed, done, total = monotonic() - self._start, self._done, self._total
        line = f"tiltsim: {self._stage}"
        if total:
            line += f": {done:.0f} of " + (
                f"{total:g} s" if isinstance(total, float) else str(total)
            )
        elif done:
            line += f": {done:.0f}"
        line += f", {_clock(elapsed)}"
        if self._initial < done < total:
            left = elapsed * (total - done) / (done - self._initial)
            line += f", about {_clock(left)} left"
        print_line(line, error=True)


@contextmanager
def show_progress(*, shown: bool) -> Iterator[Progress]:
    """Show the progress of a command on standard error, so that it is never silent for long."""
    if not shown:
        yield Progress()
        return
    progress = _Bars() if sys.stderr.isatty() else _Lines()
    finished = threading.Event()

    def tick() -> None:
        while not finished.wait(progress.interval):
            progress.tick()

    ticking = threading.Thread(target=tick, daemon=True)
    ticking.start()
    try:
        yield progress
    finally:
        finished.set()
        ticking.join()
        progress.end()


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"
