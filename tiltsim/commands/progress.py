"""Progress on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(total: float, unit: str, *, shown: bool) -> Iterator[Callable[[float], None]]:
    """A progress bar on standard error, when that is a terminal and ``shown`` is true.

    Yields the function that moves the bar to a value between 0 and ``total``.
    """
    if not shown or not sys.stderr.isatty():
        yield lambda value: None
        return
    from tqdm import tqdm

    layout = "{l_bar}{bar}| {n:.1f}/{total:g} {unit} [{elapsed}<{remaining}]"
    with tqdm(total=total, unit=unit, leave=False, bar_format=layout) as bar:

        def move(value: float) -> None:
            bar.update(value - bar.n)

        yield move


@contextmanager
def counting_bar(total: int, unit: str, *, shown: bool) -> Iterator[Callable[[int], None]]:
    """A progress bar for things that are counted, with the time left.

    Like `progress_bar`; the first call says what was finished before, which took no time.
    """
    if not shown or not sys.stderr.isatty():
        yield lambda value: None
        return
    from tqdm import tqdm

    layout = "{l_bar}{bar}| {n}/{total} " + unit + " [{elapsed}<{remaining}]"
    with tqdm(total=total, unit=unit, leave=False, bar_format=layout) as bar:
        begun = False

        def move(value: int) -> None:
            nonlocal begun
            if not begun:
                bar.initial = bar.n = value
                bar.refresh()
                begun = True
            bar.update(value - bar.n)

        yield move
