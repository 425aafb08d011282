"""What counts as a number."""

from __future__ import annotations

from math import isfinite
from typing import TypeGuard


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether a value is an integer or a float, true and false excepted."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_finite(value: object) -> TypeGuard[int | float]:
    """Whether a value is a number other than NaN and infinity."""
    return is_number(value) and isfinite(value)
