"""Progress on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def compiling_told(*, shown: bool) -> Iterator[None]:
    """Meanwhile, a line on standard error, if that is a terminal, tells what is being compiled."""
    if not shown or not sys.stderr.isatty():
        yield
        return
    from tiltsim.cache import before_compiling

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
    from tqdm import tqdm

    layout = "{l_bar}{bar}| {n:.1f}/{total:g} {unit} [{elapsed}<{remaining}]"
    with (
        tqdm(total=total, unit=unit, leave=False, bar_format=layout) as bar,
        compiling_told(shown=True),
    ):

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
    with (
        tqdm(total=total, unit=unit, leave=False, bar_format=layout) as bar,
        compiling_told(shown=True),
    ):
        begun = False

        def move(value: int) -> None:
            nonlocal begun
            if not begun:
                bar.initial = bar.n = value
                bar.refresh()
                begun = True
            bar.update(value - bar.n)

        yield move
