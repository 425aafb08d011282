"""Progress on a terminal."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

TICK: Final = 1.0
"""So often (s) the clock of a counting bar moves while nothing gets finished."""


@contextmanager
def announce_compilation(*, shown: bool) -> Iterator[None]:
    """Meanwhile, a line on standard error, if that is a terminal, tells what is being compiled."""
    if not shown or not sys.stderr.isatty():
        yield
        return
    from tiltsim.engines.cache import before_compiling

    def tell(name: str) -> None:
        from tqdm import tqdm

        plant, _, step = name.partition(".")
        law = step.rpartition(".")[0].rpartition(".")[2]
        tqdm.write(
            f"tiltsim: compiling {law} for the {plant} plant, once: some ten seconds",
            file=sys.stderr,
        )

    before_compiling.append(tell)
    try:
        yield
    finally:
        before_compiling.remove(tell)


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
    """A progress bar for things that are counted, with their rate and the time left.

    Like `progress_bar`; the bar appears with the first call, which says what was finished before
    and took no time.
    """
    if not shown or not sys.stderr.isatty():
        yield lambda value: None
        return
    layout = "{l_bar}{bar}| {n}/{total}{unit} [{elapsed}<{remaining}, {rate_noinv_fmt}]"
    bar: Any = None
    finished = threading.Event()

    def tick() -> None:
        while not finished.wait(TICK):
            bar.refresh()

    ticking = threading.Thread(target=tick, daemon=True)

    def move(value: int) -> None:
        nonlocal bar
        if bar is None:
            bar = _bar(total, f" {unit}", layout, value)
            ticking.start()
        bar.update(value - bar.n)

    with announce_compilation(shown=True):
        try:
            yield move
        finally:
            finished.set()
            if bar is not None:
                ticking.join()
                bar.close()


def _bar(total: float, unit: str, layout: str, initial: float = 0) -> Any:
    """A bar as wide as the terminal; one that tells no size, as some services', has 80 columns."""
    from tqdm import tqdm

    try:
        size = os.get_terminal_size(sys.stderr.fileno())
    except OSError:
        size = os.terminal_size((0, 0))
    # Left to itself, tqdm shows no bar at all on a terminal of no size.
    columns, rows = size.columns or 80, size.lines or 24
    options = {"leave": False, "bar_format": layout, "ncols": columns, "nrows": rows}
    return tqdm(total=total, initial=initial, unit=unit, **options)
