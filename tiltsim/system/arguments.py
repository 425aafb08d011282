"""Checks of arguments, and reports of progress to a caller."""

import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from numbers import Real
from operator import index
from time import monotonic
from typing import Any, Final, TypeGuard

import numpy as np

from tiltsim.errors import InputError
from tiltsim.system.public import public
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats

MOST: Final = 2**31 - 1
"""Largest whole number that compiled code takes, as a number of steps for example."""


OURS: Final = ("tiltsim.", "tiltsim_controllers.")  # beginnings of the names of modules


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether a value is an integer or a float, true and false excepted."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_finite(value: object) -> TypeGuard[int | float]:
    """Whether a value is a number other than NaN and infinity, and no integer beyond floats."""
    return is_number(value) and abs(value) <= sys.float_info.max


def real_array(values: Any) -> Floats:
    """Numbers as an array of floats.

    Raises TypeError or ValueError for values that only convert to numbers: dates and times, whose
    unit would be lost, true and false, complex numbers, text.
    """
    array = np.asarray(values)
    if array.dtype == object and all(_is_real(value) for value in array.flat):
        try:
            array = array.astype(float)
        except OverflowError:
            raise ValueError("a number is too large") from None
    if array.dtype.kind not in "iuf":
        raise TypeError(f"of type {array.dtype}")
    return array.astype(float, copy=False)


def _is_real(value: object) -> bool:
    # numpy counts durations among its integers
    return isinstance(value, Real) and not isinstance(value, bool | np.timedelta64)


def whole_number(name: str, value: Any) -> int:
    """An argument that is an integer from 1, also a NumPy one. Raises `InputError` otherwise."""
    try:
        number = 0 if isinstance(value, bool) else index(value)
    except TypeError:
        number = 0
    if not 1 <= number <= MOST:
        raise InputError(f"{name} = {short_repr(value)}: must be a whole number from 1 to {MOST}")
    return number


def true_or_false(name: str, value: object) -> bool:
    """An argument that is true or false, also a NumPy one. Raises `InputError` otherwise."""
    if not isinstance(value, bool | np.bool_):
        raise InputError(f"{name} = {short_repr(value)}: must be True or False")
    return bool(value)


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


def warn_user(text: str) -> None:
    """Show a `RuntimeWarning` at the nearest line of a caller outside of this project."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith(OURS):
        frame, level = frame.f_back, level + 1
    warnings.warn(text, RuntimeWarning, stacklevel=level)
