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

TICK: Final = 1.0
"""Interval (s) at which the clock of a bar moves while nothing is finished."""

LINE_INTERVAL: Final = 8.0
"""Interval (s) of the lines where there is no terminal: CI services end a job that is silent."""


class Progress:
    """The stages of a command, one after the other; this class shows nothing."""

    interval = TICK

    def __init__(self) -> None:
        self._stage = ""

    def begin(self, stage: str, total: float = 0, done: float = 0) -> None:
        """Begin a stage.

        Args:
            stage: Its name; if it counts, what it counts, as in ``flights``.
            total: How many there are, or seconds if it is a float; 0 if that is not known.
            done: How many an earlier run has finished, which the rate leaves out.
        """
        self._stage = stage

    def move(self, done: float) -> None:
        """Tell how much of the stage is done."""

    def expect(self, total: float) -> None:
        """Tell how many there will be, where that becomes known during the stage."""

    def tell(self, stage: str, done: int, total: int) -> None:
        """Report how much of a stage is done; the first report begins the stage."""
        if stage != self._stage:
            self.begin(stage, total, done)
        self.expect(total)
        self.move(done)

    def print(self, line: str, *, error: bool = False) -> None:
        """Print a line, of results or to standard error."""
        print_line(line, error=error)

    def tick(self) -> None:
        """Called every ``interval``, from another thread."""

    def end(self) -> None:
        """Remove what is shown."""


class _Bars(Progress):
    """A bar per stage."""

    def __init__(self) -> None:
        super().__init__()
        self._bar: tqdm | None = None

    def begin(self, stage: str, total: float = 0, done: float = 0) -> None:
        super().begin(stage)
        self.end()
        if isinstance(total, float):
            values = "{n:.1f}/{total:g} s [{elapsed}<{remaining}]"
        else:
            values = "{n}/{total} [{elapsed}<{remaining}, {rate_noinv_fmt}]"
        shown = ": {percentage:3.0f}%|{bar}| " + values if total else " [{elapsed}]"
        self._bar = _bar(total, stage + shown, done)

    def move(self, done: float) -> None:
        if self._bar is not None:
            if not self._bar.total:
                self._bar.bar_format = self._stage + ": {n} [{elapsed}]"
            self._bar.update(done - self._bar.n)

    def print(self, line: str, *, error: bool = False) -> None:
        from tqdm import tqdm

        tqdm.write(printable(line), file=sys.stderr if error else sys.stdout)

    def expect(self, total: float) -> None:
        if self._bar is not None:
            self._bar.total = total

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
        super().__init__()
        self.begin("starting")

    def begin(self, stage: str, total: float = 0, done: float = 0) -> None:
        super().begin(stage)
        self._total, self._done, self._initial = total, done, done
        self._start = monotonic()

    def move(self, done: float) -> None:
        self._done = done

    def expect(self, total: float) -> None:
        self._total = total

    def tick(self) -> None:
        now, done, total = monotonic(), self._done, self._total
        line = f"tiltsim: {self._stage}"
        if total:
            line += f": {done:.0f} of {_total(total)}"
        elif done:
            line += f": {done:.0f}"
        line += f", {_clock(now - self._start)}"
        if self._initial < done < total:
            left = (now - self._start) * (total - done) / (done - self._initial)
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


def _total(total: float) -> str:
    """Seconds in a few digits, a count in all of its own."""
    return f"{total:g} s" if isinstance(total, float) else str(total)


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"


def _bar(total: float, layout: str, initial: float) -> tqdm:
    """A bar as wide as the terminal, or 80 columns if that reports no size."""
    from tqdm import tqdm

    try:
        size = os.get_terminal_size(sys.stderr.fileno())
    except OSError:
        size = os.terminal_size((0, 0))
    # On a terminal of unknown size tqdm's default is to show no bar at all.
    return tqdm(
        total=total,
        initial=initial,
        unit="",
        leave=False,
        bar_format=layout,
        ncols=size.columns or 80,
        nrows=size.lines or 24,
    )
