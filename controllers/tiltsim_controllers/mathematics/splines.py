"""Piecewise polynomials as flat data: rows of the time at which a piece begins, and coefficients.

Splines are computed once, before a flight; real arrays and traced numbers evaluate them.
"""

from collections.abc import Sequence
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.code.arrays import take_span, xp
from tiltsim_controllers.mathematics.scalar import Values


def piece_at(position: Any, rows: int, begin: int, size: int, knots: Any) -> Any:
    """The last row that begins at or before a position; the first one if none does.

    Args:
        position: Time (s), shape (...).
        rows: Number of rows, in increasing order.
        begin: Index of the first one.
        size: Floats per row, of which the first is where it begins.
        knots: Vector that contains the rows.

    Returns:
        The row, shape (size, ...).
    """
    row = 0.0 * position
    left = rows
    while left > 1:
        half = left // 2
        starts = take_span(knots, begin + size * (row + half), 1)[0]
        row = xp.where(starts <= position, row + half, row)
        left -= half
    return take_span(knots, begin + size * row, size)


def polynomial_derivatives(since: Any, coefficients: Any, order: int) -> Any:
    """Polynomials at an argument (s) and their derivatives up to an order of 4, (order + 1, ...).

    Coefficients are the highest power first, shape (powers, ...).
    """
    terms = [0.0 * coefficients[0]] * (order + 1)  # derivatives divided by 1, 1, 2, 6, 24
    for coefficient in coefficients:
        for k in range(order, 0, -1):
            terms[k] = terms[k] * since + terms[k - 1]
        terms[0] = terms[0] * since + coefficient
    return xp.array([factor * term for factor, term in zip((1.0, 1.0, 2.0, 6.0, 24.0), terms)])


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

    values = xp.array(points)
    if values.dtype == object:  # traced: the knots are affine in the points

        def knots_of(numbers: Any) -> Any:
            plain = np.reshape(numbers, values.shape)
            return np.array(spline_knots(times, plain, coefficients, degree=degree, ends=ends))

        offset = knots_of(np.zeros(values.size))
        columns = np.array([knots_of(unit) - offset for unit in np.eye(values.size)])
        return (*(offset + values.ravel() @ columns),)
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
