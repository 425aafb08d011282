"""Progress on a terminal."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from tqdm import tqdm

TICK: Final = 1.0
"""Interval (s) at which the clock of a counting bar moves while nothing is finished."""


@contextmanager
def announce_compilation(*, shown: bool) -> Iterator[None]:
    """Announce compilations within the block on standard error, if that is a terminal."""
    if not shown or not sys.stderr.isatty():
        yield
        return
    from tiltsim.engines.cache import before_compiling

    def announce(name: str) -> None:
        from tqdm import tqdm

        plant, _, step = name.partition(".")
        law = step.rpartition(".")[0].rpartition(".")[2]
        tqdm.write(
            f"tiltsim: compiling {law} for the {plant} plant, once: some ten seconds",
            file=sys.stderr,
        )

    before_compiling.append(announce)
    try:
        yield
    finally:
        before_compiling.remove(announce)


@contextmanager
def progress_bar(total: float, unit: str, *, shown: bool) -> Iterator[Callable[[float], None]]:
    """A progress bar on standard error, when that is a terminal and ``shown`` is true.

    Yields the function that moves the bar to a value between 0 and ``total``.
    """
    if not shown or not sys.stderr.isatty():
        yield lambda value: None
        return
    layout = "{l_bar}{bar}| {n:.1f}/{total:g} {unit} [{elapsed}<{remaining}]"
    with _bar(total, unit, layout) as bar, announce_compilation(shown=True):

        def move(value: float) -> None:
            bar.update(value - bar.n)

        yield move


@contextmanager
def counting_bar(total: int, unit: str, *, shown: bool) -> Iterator[Callable[[int], None]]:
    """A progress bar for countable things, with their rate and the remaining time.

    Like `progress_bar`; the bar appears with the first call, whose value is the number that an
    earlier run finished, which the rate leaves out.
    """
    if not shown or not sys.stderr.isatty():
        yield lambda value: None
        return
    layout = "{l_bar}{bar}| {n}/{total}{unit} [{elapsed}<{remaining}, {rate_noinv_fmt}]"
    bars: list[tqdm] = []
    finished = threading.Event()

    def tick() -> None:
        while not finished.wait(TICK):
            bars[0].refresh()

    ticking = threading.Thread(target=tick, daemon=True)

    def move(value: int) -> None:
        if not bars:
            bars.append(_bar(total, f" {unit}", layout, value))
            ticking.start()
        bars[0].update(value - bars[0].n)

    with announce_compilation(shown=True):
        try:
            yield move
        finally:
            finished.set()
            for bar in bars:
                ticking.join()
                bar.close()


def _bar(total: float, unit: str, layout: str, initial: float = 0) -> tqdm:
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
        unit=unit,
        leave=False,
        bar_format=layout,
        ncols=size.columns or 80,
        nrows=size.lines or 24,
    )
