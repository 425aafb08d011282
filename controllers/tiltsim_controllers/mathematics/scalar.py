"""Types of numbers and vectors, and functions of plain numbers."""

from collections.abc import Sequence
from math import sqrt

import numpy as np
import numpy.typing as npt

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Quad = tuple[float, float, float, float]
Values = tuple[float, ...]
Vector = Sequence[float]
Floats = npt.NDArray[np.float64]


def clipped(value: float, low: float, high: float) -> float:
    """Limit ``value`` to the interval from ``low`` to ``high``; NaN stays NaN."""
    if value < low:
        return low
    return high if value > high else value


def chi_square_quantile(probability: float, degrees: float) -> float:
    """The number below which a chi-square variable of some degrees of freedom is, by probability.

    By the cube root, which is nearly normal (Wilson and Hilferty, 1931): within 2 % from 9 degrees
    of freedom on, and within 5 % in the upper tail for fewer; exact for one.
    """
    from statistics import NormalDist

    if degrees == 1.0:
        return float(NormalDist().inv_cdf(0.5 + 0.5 * probability) ** 2)
    share = 2.0 / (9.0 * degrees)
    root = 1.0 - share + NormalDist().inv_cdf(probability) * sqrt(share)
    return degrees * max(root, 0.0) ** 3
