"""Minimum-snap motion through waypoints.

The motion through given points at given times, from rest to rest, that minimizes the integral of
squared snap consists of polynomials of degree seven whose first six derivatives are continuous at
the points (D. Mellinger and V. Kumar, "Minimum snap trajectory generation and control for
quadrotors", ICRA 2011): a spline of degree seven whose first three derivatives vanish at both ends.
It is computed once; a flight evaluates it from its knots.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import isfinite
from typing import Any, Final

from tiltsim_controllers.code.arrays import is_known, xp
from tiltsim_controllers.mathematics.pieces import piece_at, polynomial_derivatives
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.mathematics.splines import spline_knots

COEFFICIENTS: Final = 8
"""Coefficients of a polynomial of degree seven, highest power first."""


def waypoint_motion(time: Any, rows: float, offset: float, knots: Any, axes: int = 3) -> Any:
    """Position, velocity, acceleration, jerk and snap, shape (5, axes), m and s.

    Args:
        time: s
        rows: Number of segments: the time at which each begins, and a polynomial per axis.
        offset: Index of the first knot.
        knots: Contains the segments of `minimum_snap_knots` or `table_knots`.
        axes: Number of coordinates.
    """
    row = piece_at(time, int(rows), int(offset), 1 + axes * COEFFICIENTS, knots)
    coefficients = row[1:].reshape(axes, COEFFICIENTS).T
    return polynomial_derivatives(xp.maximum(time - row[0], 0.0), coefficients, 4)


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
    if len(points) < 2:
        raise ValueError(f"{len(points)} waypoints: at least 2 are needed")
    if len(times) != len(points):
        raise ValueError(f"{len(points)} waypoints but {len(times)} times")
    numbers = (*times, *(value for point in points for value in point))
    if not all(map(isfinite, filter(is_known, numbers))):
        raise ValueError("waypoints and times must be finite numbers")
    if times[0] != 0.0 or any(b <= a for a, b in itertools.pairwise(times)):
        raise ValueError(f"times {list(times)}: must start at 0 and increase")
    rest = [(order, [0.0, 0.0, 0.0]) for order in (1, 2, 3)]
    return spline_knots(times, points, COEFFICIENTS, degree=COEFFICIENTS - 1, ends=(rest, rest))


def table_knots(
    times: Sequence[float], points: Sequence[Sequence[float]], interpolation: str
) -> Values:
    """The knots of `waypoint_motion` through the rows of a table, with free ends.

    Args:
        times: s, increasing
        points: m or rad, of any number of coordinates each
        interpolation: ``minimum_snap``: of all motions through the points, the one that minimizes
            the integral of squared snap; up to four points are joined by one polynomial, without
            snap. ``cubic``: a spline of degree three, whose acceleration is continuous.
    """
    if interpolation == "cubic" or len(points) <= 4:
        return spline_knots(times, points, COEFFICIENTS, degree=min(3, len(points) - 1))
    free = [(order, [0.0] * len(points[0])) for order in (4, 5, 6)]
    return spline_knots(times, points, COEFFICIENTS, degree=COEFFICIENTS - 1, ends=(free, free))
