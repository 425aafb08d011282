"""Output of commands: aligned lines, tables, JSON without negative zeros, and progress."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from textwrap import fill
from time import monotonic
from typing import TYPE_CHECKING, Any, Final

from tiltsim.errors import InputError
from tiltsim.system.text import alike, printable, shortened

if TYPE_CHECKING:
    from tqdm import tqdm

LONGEST_REASON: Final = 300
"""Characters of a reason; messages that list the allowed values can be long."""


def number(value: float, form: str = ".6g") -> str:
    """A number as text; a value that prints as zero has no sign."""
    text = format(value, form)
    return text[1:] if text.startswith("-") and float(text) == 0.0 else text


def numbers(values: Iterable[float]) -> str:
    """Numbers as text, separated by commas."""
    return ", ".join(number(value) for value in values)


def counted(count: int, one: str, many: str) -> str:
    """A count with its noun: ``1 flight``, ``2 flights``."""
    return f"{count} {one if count == 1 else many}"


def tally(counts: Mapping[str, int]) -> str:
    """Counts by name: ``3 passed, 1 failed``."""
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def most_frequent(reasons: Sequence[str]) -> str:
    """The most frequent reason, in a line that says how many rows have it.

    Reasons that differ only in numbers count as one, and the first of them is shown.
    """
    kinds = alike(reasons)
    reason = max(kinds, key=lambda first: len(kinds[first]))
    shown = shortened(reason, LONGEST_REASON)
    return f"most frequent reason ({len(kinds[reason])} of {len(reasons)}): {shown}"


def require_flown(reasons: Sequence[str | None]) -> None:
    """Raise `InputError` if every row has a reason why it could not be flown."""
    known = [reason for reason in reasons if reason is not None]
    if known and len(known) == len(reasons):
        raise InputError(f"nothing could be flown; {most_frequent(known)}")


def print_line(text: str, *, error: bool = False) -> None:
    """Print one line; text of files and names in it cannot control the terminal."""
    print(printable(text), file=sys.stderr if error else sys.stdout, flush=True)


def warn(text: str) -> None:
    """Print a warning on standard error."""
    print_line(f"tiltsim: warning: {text}", error=True)


def viewing(path: Path) -> str:
    """A flight's folder or a recording, and the command that shows it."""
    return f"{path}; see it with tiltsim view {shlex.quote(str(path))}"


def json_text(report: Any) -> str:
    """A report as JSON. Raises ValueError for NaN and infinity."""
    return json.dumps(_unsigned_zeros(report), indent=2, allow_nan=False)


def _unsigned_zeros(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _unsigned_zeros(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_unsigned_zeros(item) for item in value]
    return value + 0.0 if isinstance(value, float) else value


def write_text(path: Path, text: str) -> None:
    """Write a text file as a whole or not at all; it ends with a line break."""
    from tiltsim.system.files import replacing

    with replacing(path) as temporary:
        temporary.write_text(text.rstrip("\n") + "\n", encoding="utf-8")


def aligned(rows: Sequence[tuple[str, str]]) -> list[str]:
    """Pairs of name and value as lines, with the values aligned."""
    width = max(len(name) for name, _ in rows)
    return [fitted(f"{name:<{width}}  {value}", width + 2) for name, value in rows]


def fitted(line: str, indent: int) -> str:
    """A line, wrapped and indented on a terminal that is too narrow for it.

    Lines in files and pipes are never wrapped, so that a program finds one item per line.
    """
    if not sys.stdout.isatty():
        return line
    width = max(shutil.get_terminal_size().columns, indent + 20)
    return fill(
        line, width, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )


Columns = Mapping[str, tuple[str | Callable[[Any], Any], str]]
"""By heading, the key of a row or a function of it, and the format of its numbers."""


def table(columns: Columns, rows: Sequence[Any]) -> str:
    """A table; columns with a format are right-aligned, and a cell without a value has a dash."""
    lines = cells(columns, rows)
    widths = [max(map(len, column)) for column in zip(*lines)]
    signs = [">" if form else "<" for _, form in columns.values()]
    return "\n".join(
        "  ".join(
            f"{cell:{sign}{width}}" for cell, sign, width in zip(line, signs, widths)
        ).rstrip()
        for line in lines
    )


def cells(columns: Columns, rows: Sequence[Any]) -> list[list[str]]:
    """The text of a table, its headings first."""
    return [[*columns], *([_cell(row, *column) for column in columns.values()] for row in rows)]


def _cell(row: Any, key: str | Callable[[Any], Any], form: str) -> str:
    value = row[key] if isinstance(key, str) else key(row)
    if value is None:
        return "-"
    return number(value, form) if form and not isinstance(value, str) else str(value)


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a Markdown table."""
    lines = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    return [f"| {' | '.join(line)} |" for line in (header, ["---"] * len(header), *lines)]


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
