"""What counts as a number."""

from __future__ import annotations

from math import isfinite
from numbers import Real
from operator import index
from typing import Any, TypeGuard

import numpy as np

from tiltsim.errors import InputError
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether a value is an integer or a float, true and false excepted."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_finite(value: object) -> TypeGuard[int | float]:
    """Whether a value is a number other than NaN and infinity."""
    return is_number(value) and isfinite(value)


def real_array(values: Any) -> Floats:
    """Numbers as an array of floats.

    Raises TypeError or ValueError for what only converts to numbers: dates and times, whose unit
    would be lost, true and false, complex numbers, text.
    """
    array = np.asarray(values)
    if array.dtype == object and all(_is_real(value) for value in array.flat):
        array = array.astype(float)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"of type {array.dtype}")
    return array.astype(float, copy=False)


def _is_real(value: object) -> bool:
    # numpy counts durations among its integers
    return isinstance(value, Real) and not isinstance(value, bool | np.timedelta64)


def whole_number(name: str, value: Any) -> int:
    """An argument that is a whole number from 1, of numpy too. Raises `InputError` otherwise."""
    if isinstance(value, bool) or not hasattr(value, "__index__") or index(value) < 1:
        raise InputError(f"{name} = {short_repr(value)}: must be a whole number from 1")
    return index(value)
