"""Progress of long work, as its caller wants to hear of it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Final

from tiltsim.errors import InputError
from tiltsim.system.public import public
from tiltsim.system.text import short_repr

INTERVAL: Final = 0.1  # wall time (s) between reports; the last one always comes
Report = Callable[[float], None]


@contextmanager
def reported(progress: Report | bool | None, stage: str, total: float) -> Iterator[Report]:
    """Yield a function to call with the amount done, from 0 to ``total``.

    Args:
        progress: A function that is called with it now and then; True for a bar on a terminal and a
            line now and then elsewhere; None or False for silence.
        stage: Name of the work.
        total: The amount when all is done: seconds if a float, a count if an integer.

    Raises:
        InputError: See `check_progress`.
    """
    check_progress(progress)
    if progress is None or progress is False:
        yield lambda done: None
    elif progress is True:
        with public("show_progress")(shown=True) as display:
            display.begin(stage, total)
            yield display.move
    else:
        yield _seldom(progress, total)


def check_progress(progress: object) -> None:
    """Raise `InputError` unless it can be the first argument of `reported`."""
    if not (progress is None or isinstance(progress, bool) or callable(progress)):
        allowed = "must be True or a function"
        raise InputError(f"progress = {short_repr(progress)}: {allowed}")


def check_function(name: str, value: object) -> None:
    """Raise `InputError` unless an argument can be called."""
    if not callable(value):
        raise InputError(f"{name} = {short_repr(value)}: must be a function")


def _seldom(report: Report, total: float) -> Report:
    """A report that passes on a value when an interval has passed, and at the end."""
    last = -INTERVAL

    def move(done: float) -> None:
        nonlocal last
        now = monotonic()
        if now - last >= INTERVAL or done >= total:
            last = now
            report(done)

    return move
