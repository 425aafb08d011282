"""Piecewise polynomials as flat data: rows of the time at which a piece begins, and coefficients.

They are computed once, before a flight; the functions here evaluate them, on real arrays and
traced numbers.
"""

from __future__ import annotations

from typing import Any

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.blocks import take_span


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
    """Polynomials and their derivatives, shape (order + 1, ...).

    Args:
        since: Argument, s.
        coefficients: Highest power first, shape (powers, ...).
        order: Number of derivatives, at most 4.
    """
    terms = [0.0 * coefficients[0]] * (order + 1)  # derivatives divided by 1, 1, 2, 6, 24
    for coefficient in coefficients:
        for k in range(order, 0, -1):
            terms[k] = terms[k] * since + terms[k - 1]
        terms[0] = terms[0] * since + coefficient
    return xp.array([factor * term for factor, term in zip((1.0, 1.0, 2.0, 6.0, 24.0), terms)])
