"""Types of numbers and vectors, and functions of plain numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Quad = tuple[float, float, float, float]
Octet = tuple[float, float, float, float, float, float, float, float]
Values = tuple[float, ...]
Vector = Sequence[float]
Floats = npt.NDArray[np.float64]


def clipped(value: float, low: float, high: float) -> float:
    """Limit ``value`` to the interval from ``low`` to ``high``; NaN stays NaN."""
    if value < low:
        return low
    return high if value > high else value
