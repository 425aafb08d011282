"""Quantiles of distributions, by which tests of consistency and gates are set."""

from math import sqrt
from statistics import NormalDist


def chi_square_quantile(probability: float, degrees: float) -> float:
    """The number below which a chi-square variable stays with a probability.

    By the cube root, which is nearly normal (Wilson and Hilferty, 1931): within 2 % from 9 degrees
    of freedom on, and within 5 % in the upper tail for fewer; exact for one.

    Args:
        probability: Between 0 and 1.
        degrees: Degrees of freedom.
    """
    if degrees == 1.0:
        return float(NormalDist().inv_cdf(0.5 + 0.5 * probability) ** 2)
    share = 2.0 / (9.0 * degrees)
    root = 1.0 - share + NormalDist().inv_cdf(probability) * sqrt(share)
    return degrees * max(root, 0.0) ** 3
