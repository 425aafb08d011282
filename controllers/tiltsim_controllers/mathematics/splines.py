"""Splines as knots: rows of the time at which a polynomial begins, and its coefficients.

They are computed once; a flight evaluates them, in Python or in native code.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.mathematics.scalar import Values, Vector, affine_in, scalar


@scalar
def row_at(position: float, rows: int, begin: int, size: int, knots: Vector) -> int:
    """Index of the last row that begins at or before a position; the first row if none does.

    Args:
        position: time, or a fraction of a period
        rows: how many there are, in increasing order
        begin: index of the first knot
        size: floats per row, of which the first is where it begins
        knots: contains the rows
    """
    row, left = 0, rows  # the row is one of so many
    while left > 1:
        half = left // 2
        if knots[begin + size * (row + half)] <= position:
            row = row + half
        left = left - half
    return row


@scalar
def polynomial_motion(
    since: float, start: int, coefficients: int, knots: Vector
) -> tuple[float, float, float, float, float]:
    """A polynomial and its first four derivatives.

    Args:
        since: its beginning, s
        start: index of its first coefficient, that of the highest power
        coefficients: how many
        knots: contains the coefficients
    """
    value = first = second = third = fourth = 0.0
    for place in range(coefficients):
        fourth = fourth * since + third
        third = third * since + second
        second = second * since + first
        first = first * since + value
        value = value * since + knots[start + place]
    return value, first, 2.0 * second, 6.0 * third, 24.0 * fourth


@affine_in("points")
def spline_knots(
    times: Sequence[float], points: ArrayLike, coefficients: int, *, degree: int, ends: Any = None
) -> Values:
    """The knots of a spline through points: one row a segment, and a last one at rest.

    Args:
        times: of the points, increasing, s
        points: shape (N, axes)
        coefficients: of each polynomial; those above the spline's degree are zero
        degree: of the spline, below N unless ``ends`` has conditions
        ends: ``bc_type`` of `scipy.interpolate.make_interp_spline`; default: not-a-knot

    Raises:
        ValueError: If the spline cannot be computed, as with times of very different distances.
    """
    from scipy.interpolate import make_interp_spline  # a third of a second to import

    values = np.asarray(points, dtype=float)
    spline = make_interp_spline(times, values, k=degree, bc_type=ends)
    starts = np.asarray(times[:-1], dtype=float)
    rows = np.zeros((len(values), values.shape[1], coefficients))
    for power in range(degree + 1):  # Taylor coefficients at the start of the segment
        rows[:-1, :, coefficients - 1 - power] = spline(starts, nu=power) / factorial(power)
    rows[-1, :, -1] = values[-1]
    table = np.column_stack([times, rows.reshape(len(values), -1)])
    if not np.isfinite(table).all():
        raise ValueError("no spline: the distances of the times differ too much")
    return tuple(table.ravel().tolist())
