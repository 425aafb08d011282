"""References to track as functions of time: set-point, line, circle and others (ch. 4, Sec. 6).

The motion through given points at given times, from rest to rest, that minimizes the integral of
squared snap consists of polynomials of degree seven whose first six derivatives are continuous at
the points (D. Mellinger and V. Kumar, "Minimum snap trajectory generation and control for
quadrotors", ICRA 2011): a spline of degree seven whose first three derivatives vanish at both ends.
It is computed once; a flight evaluates it from its knots.
"""

import itertools
from collections.abc import Sequence
from math import isfinite
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import is_known, traceable, xp
from tiltsim_controllers.gaits.motion import NO_KNOTS
from tiltsim_controllers.mathematics.attitude import wrapped
from tiltsim_controllers.mathematics.records import Vector3
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.mathematics.splines import piece_at, polynomial_derivatives, spline_knots

_ZEROS: Final = (0.0, 0.0, 0.0)

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

    Points have three coordinates (m), times (s) start at 0 and increase.

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

    Times (s) increase; points (m or rad) have any number of coordinates. By ``minimum_snap``, of
    all motions through the points the one that minimizes the integral of squared snap; up to four
    points are joined by one polynomial, without snap. By ``cubic``, a spline of degree three, whose
    acceleration is continuous.
    """
    if interpolation == "cubic" or len(points) <= 4:
        return spline_knots(times, points, COEFFICIENTS, degree=min(3, len(points) - 1))
    free = [(order, [0.0] * len(points[0])) for order in (4, 5, 6)]
    return spline_knots(times, points, COEFFICIENTS, degree=COEFFICIENTS - 1, ends=(free, free))


SETPOINT: Final = 0.0
LINE: Final = 1.0
CIRCLE: Final = 2.0
ATTITUDE_ALTITUDE: Final = 3.0
LISSAJOUS: Final = 4.0
WAYPOINTS: Final = 5.0
POSES: Final = 6.0

REFERENCE_TYPES: Final = {
    "setpoint": SETPOINT,
    "line": LINE,
    "circle": CIRCLE,
    "attitude_altitude": ATTITUDE_ALTITUDE,
    "lissajous": LISSAJOUS,
    "figure_eight": LISSAJOUS,
    "waypoints": WAYPOINTS,
    "push": WAYPOINTS,
    "table": WAYPOINTS,  # POSES if its roll, pitch and yaw vary
}
"""Reference types by their name in a scenario."""


class ReferenceParameters(NamedTuple):
    """Parameters of a reference; each type reads the fields it needs."""

    type: float
    position: Vector3 = _ZEROS  # m: set-point, start of the line, center of circle and lissajous
    velocity: Vector3 = _ZEROS  # m/s, line
    acceleration: Vector3 = _ZEROS  # m/s^2, line
    radius: float = 0.0  # m, circle
    angular_frequency: float = 0.0  # rad/s, circle
    amplitude: Vector3 = _ZEROS  # m, lissajous
    frequency: Vector3 = _ZEROS  # rad/s, lissajous
    phase: Vector3 = _ZEROS  # rad, lissajous
    segments: float = 0.0  # number of segments in the knots, waypoints and table
    offset: float = 0.0  # index of their first knot, waypoints
    roll: float = 0.0  # rad, all types but poses
    pitch: float = 0.0
    yaw: float = 0.0
    acceleration_feedforward: float = 0.0  # 1 or 0: whether the controller gets the acceleration


def reference_motion(time: Any, reference: ReferenceParameters, knots: Any = NO_KNOTS) -> Any:
    """Position, velocity, acceleration, jerk and snap of a reference at a time (s), shape (5, 3).

    World axes, m and s. In the knots, the table data of a flight, waypoints and tables begin at
    `ReferenceParameters.offset`.
    """
    r = reference
    if r.type == WAYPOINTS:
        return waypoint_motion(time, r.segments, r.offset, knots)
    if r.type == POSES:
        return waypoint_motion(time, r.segments, r.offset, knots, 6)[:, :3]
    start, rest = xp.array(r.position), xp.zeros(3)
    if r.type == SETPOINT:
        return xp.array([start, rest, rest, rest, rest])
    if r.type in (CIRCLE, LISSAJOUS):
        if r.type == CIRCLE:
            amplitude = xp.array([r.radius, r.radius, 0.0])
            turning, phase = xp.array([r.angular_frequency] * 3), xp.zeros(3)
            quarter = xp.array([1.0, 0.0, 0.0])  # x is a cosine
        else:
            amplitude, turning, phase = map(xp.array, (r.amplitude, r.frequency, r.phase))
            quarter = rest
        sine, cosine = xp.sin(turning * time + phase), xp.cos(turning * time + phase)
        along = amplitude * (quarter * cosine + (1.0 - quarter) * sine)
        across = amplitude * turning * ((1.0 - quarter) * cosine - quarter * sine)
        square = turning * turning
        return xp.array(
            [start + along, across, -square * along, -square * across, square * square * along]
        )
    velocity, acceleration = xp.array(r.velocity), xp.array(r.acceleration)
    position = start + velocity * time + acceleration * (0.5 * time * time)
    return xp.array([position, velocity + acceleration * time, acceleration, rest, rest])


@traceable
def reference_derivatives(time: Any, reference: ReferenceParameters, knots: Any = NO_KNOTS) -> Any:
    """`reference_motion` as one vector, shape (15,)."""
    return reference_motion(time, reference, knots).ravel()


@traceable
def position_reference(time: Any, reference: ReferenceParameters, knots: Any = NO_KNOTS) -> Any:
    """Position (m), velocity (m/s) and acceleration (m/s^2) to track, world axes, shape (9,).

    Arguments as for `reference_motion`. Ch. 4 sets the acceleration to zero, for the circle
    too (Sec. 6.3); `ReferenceParameters.acceleration_feedforward` restores it.
    """
    position, velocity, acceleration = reference_motion(time, reference, knots)[:3]
    feedforward = reference.acceleration_feedforward * acceleration
    return xp.hstack([position, velocity, feedforward])


def reference_attitude(time: Any, reference: ReferenceParameters, knots: Any = NO_KNOTS) -> Any:
    """Roll, pitch and yaw to track with three derivatives, rad and s, shape (4, 3).

    The angles are between -pi and pi. Arguments as for `reference_motion`.
    """
    r = reference
    if r.type == POSES:
        motion = waypoint_motion(time, r.segments, r.offset, knots, 6)[:4, 3:]
        return xp.vstack([wrapped(motion[0]).reshape(1, 3), motion[1:]])
    rest = xp.zeros(3)
    return xp.array([xp.array([r.roll, r.pitch, r.yaw]), rest, rest, rest])


@traceable
def attitude_reference(time: Any, reference: ReferenceParameters, knots: Any = NO_KNOTS) -> Any:
    """Roll, pitch and yaw (rad) to track, shape (3,); arguments as for `reference_motion`."""
    return reference_attitude(time, reference, knots)[0]
