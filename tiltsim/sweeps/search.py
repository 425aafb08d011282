"""Stability boundaries: the first value along a line at which a condition fails."""

from __future__ import annotations

from collections.abc import Generator
from math import ceil, copysign
from typing import NamedTuple


class Boundary(NamedTuple):
    """The last value found at which the condition holds, and the first at which it fails.

    ``holds`` is None if it fails at the start, ``fails`` is None if it holds up to the end.
    """

    holds: float | None
    fails: float | None


def boundary(
    start: float, stop: float, step: float, tolerance: float
) -> Generator[float, bool, Boundary]:
    """Search a boundary; yields values, and is sent whether the condition holds there.

    The value walks from ``start`` to ``stop`` (up or down) in steps, so that the condition holds at
    all values before the boundary, as in ch. 3, Eq. (26). After the first failure the bracket is
    halved.

    Args:
        start, stop: Ends of the walk.
        step: Its step; the last one may be shorter.
        tolerance: Maximum width of the final bracket, unless floats are coarser.
    """
    length = abs(stop - start)
    last = start
    holding: float | None = None
    for number in range(ceil(length / step - 1e-9) + 1):
        # Decimal steps stay decimal: 0.3, not 0.30000000000000004.
        last = round(start + copysign(min(number * step, length), stop - start), 12)
        if not (yield last):
            break
        holding = last
    else:
        return Boundary(holding, None)
    if holding is None:
        return Boundary(None, last)
    while abs(last - holding) > tolerance * (1.0 + 1e-9):
        middle = 0.5 * (holding + last)
        if middle in (holding, last):
            break
        if (yield middle):
            holding = middle
        else:
            last = middle
    return Boundary(holding, last)
