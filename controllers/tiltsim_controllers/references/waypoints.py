"""Minimum-snap motion through waypoints.

Of all motions through given points at given times, from rest to rest, the one that minimizes the
integral of squared snap consists of polynomials of degree seven whose first six derivatives are
continuous at the points (D. Mellinger and V. Kumar, "Minimum snap trajectory generation and control
for quadrotors", ICRA 2011): a spline of degree seven whose first three derivatives vanish at both
ends. It is computed once; a flight evaluates it from its knots.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import factorial, isfinite
from typing import Final

from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar

COEFFICIENTS: Final = 8
"""Coefficients of a polynomial of degree seven, highest power first."""

ROW: Final = 25
"""Floats per segment: the time at which it begins, and one polynomial per axis."""


@scalar
def polynomial_motion(
    since: float, start: int, knots: Vector
) -> tuple[float, float, float, float, float]:
    """A polynomial and its first four derivatives, ``since`` (s) its beginning.

    Its coefficients are in ``knots`` from index ``start``.
    """
    value = first = second = third = fourth = 0.0
    for index in range(start, start + COEFFICIENTS):
        fourth = fourth * since + third
        third = third * since + second
        second = second * since + first
        first = first * since + value
        value = value * since + knots[index]
    return value, first, 2.0 * second, 6.0 * third, 24.0 * fourth


@scalar
def waypoint_motion(time: float, rows: float, offset: float, knots: Vector) -> Values:
    """Position, velocity, acceleration, jerk and snap, three floats each, m and s.

    Args:
        time: s
        rows: number of segments
        offset: index of the first knot
        knots: contains the segments of `minimum_snap_knots`
    """
    begin = int(offset)
    low, high = 0, int(rows)
    while high - low > 1:
        middle = (low + high) // 2
        if knots[begin + ROW * middle] <= time:
            low = middle
        else:
            high = middle
    row = begin + ROW * low
    since = max(0.0, time - knots[row])
    x0, x1, x2, x3, x4 = polynomial_motion(since, row + 1, knots)
    y0, y1, y2, y3, y4 = polynomial_motion(since, row + 1 + COEFFICIENTS, knots)
    z0, z1, z2, z3, z4 = polynomial_motion(since, row + 1 + 2 * COEFFICIENTS, knots)
    return x0, y0, z0, x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4


def minimum_snap_knots(
    points: Sequence[Sequence[float]], times: Sequence[float]
) -> tuple[float, ...]:
    """The knots of `waypoint_motion`: one segment between two points, and a last one at rest.

    Args:
        points: waypoints, m, of three coordinates each
        times: when they are reached, s: 0 and increasing

    Raises:
        ValueError: If there are fewer than two points, the number of times differs, the times do
            not start at 0 or do not increase, or a number is not finite.
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
        # Taylor coefficients at the start of the segment, from the right, one row per power.
        piece = [spline(start, nu=power) / factorial(power) for power in powers]
        rows += [float(start), *(float(row[axis]) for axis in range(3) for row in piece)]
    ends = ([*[0.0] * (COEFFICIENTS - 1), float(value)] for value in points[-1])
    return (*rows, float(times[-1]), *(value for end in ends for value in end))
