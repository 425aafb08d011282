"""What counts as a number."""

from __future__ import annotations

from math import isfinite
from operator import index
from typing import Any, TypeGuard

from tiltsim.errors import InputError
from tiltsim.system.text import short_repr


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether a value is an integer or a float, true and false excepted."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_finite(value: object) -> TypeGuard[int | float]:
    """Whether a value is a number other than NaN and infinity."""
    return is_number(value) and isfinite(value)


def whole_number(name: str, value: Any) -> int:
    """An argument that is a whole number from 1, of numpy too. Raises `InputError` otherwise."""
    if isinstance(value, bool) or not hasattr(value, "__index__") or index(value) < 1:
        raise InputError(f"{name} = {short_repr(value)}: must be a whole number from 1")
    return index(value)
