"""Smooth motion through waypoints with the least snap.

Of all motions that pass given points at given times, from rest to rest, the one with the least
integral of squared snap is made of polynomials of degree seven whose first six derivatives run on
through the points (D. Mellinger and V. Kumar, "Minimum snap trajectory generation and control for
quadrotors", ICRA 2011): a spline of degree seven with its first three derivatives zero at both
ends. It is computed once; a flight evaluates it from a table.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import factorial, isfinite
from typing import Final

from tiltsim_controllers.mathematics.scalar import scalar

COEFFICIENTS: Final = 8
"""Coefficients of a polynomial of degree seven, highest power first."""

ROW: Final = 25
"""Floats in a row of the table: the time at which it begins, and one polynomial an axis."""


@scalar
def polynomial_motion(
    since: float, start: int, table: Sequence[float]
) -> tuple[float, float, float, float, float]:
    """A polynomial of the table, from index ``start``, and its first four derivatives."""
    value = first = second = third = fourth = 0.0
    for index in range(start, start + COEFFICIENTS):
        fourth = fourth * since + third
        third = third * since + second
        second = second * since + first
        first = first * since + value
        value = value * since + table[index]
    return value, first, 2.0 * second, 6.0 * third, 24.0 * fourth


@scalar
def waypoint_motion(
    time: float, rows: float, offset: float, table: Sequence[float]
) -> tuple[float, ...]:
    """Position, velocity, acceleration, jerk and snap, three floats each, at a time (s).

    ``rows`` of the table, from index ``offset`` on, hold the motion (`minimum_snap_knots`).
    """
    begin = int(offset)
    low, high = 0, int(rows)
    while high - low > 1:
        middle = (low + high) // 2
        if table[begin + ROW * middle] <= time:
            low = middle
        else:
            high = middle
    row = begin + ROW * low
    since = max(0.0, time - table[row])
    x0, x1, x2, x3, x4 = polynomial_motion(since, row + 1, table)
    y0, y1, y2, y3, y4 = polynomial_motion(since, row + 1 + COEFFICIENTS, table)
    z0, z1, z2, z3, z4 = polynomial_motion(since, row + 1 + 2 * COEFFICIENTS, table)
    return x0, y0, z0, x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4


def minimum_snap_knots(
    points: Sequence[Sequence[float]], times: Sequence[float]
) -> tuple[float, ...]:
    """The rows of `waypoint_motion` through points (m) at increasing times (s) from 0.

    One row a segment and a last one that rests at the last point for ever.

    Raises
    ------
    ValueError
        If there are fewer than two points, not as many times, the times do not start at 0 or do
        not increase, or a number is not finite.
    """
    from scipy.interpolate import make_interp_spline  # a third of a second to import

    if len(points) < 2:
        raise ValueError(f"{len(points)} waypoints: at least 2 are needed")
    if len(times) != len(points):
        raise ValueError(f"{len(points)} waypoints but {len(times)} times")
    if not all(map(isfinite, (*times, *(value for point in points for value in point)))):
        raise ValueError("waypoints and times must be finite numbers")
    if times[0] != 0.0 or any(b <= a for a, b in itertools.pairwise(times)):
        raise ValueError(f"times {list(times)}: must start at 0 and increase")
    rest = [(order, [0.0, 0.0, 0.0]) for order in (1, 2, 3)]
    spline = make_interp_spline(times, points, k=COEFFICIENTS - 1, bc_type=(rest, rest))
    powers = range(COEFFICIENTS - 1, -1, -1)
    rows: list[float] = []
    for start in times[:-1]:
        # Taylor's coefficients at the start of the segment, from the right, one row a power.
        piece = [spline(start, nu=power) / factorial(power) for power in powers]
        rows += [float(start), *(float(row[axis]) for axis in range(3) for row in piece)]
    ends = ([*[0.0] * (COEFFICIENTS - 1), float(value)] for value in points[-1])
    return (*rows, float(times[-1]), *(value for end in ends for value in end))
