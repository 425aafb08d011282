"""References to track as functions of time: set-point, line, circle and others (ch. 4, Sec. 6)."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.mathematics.attitude import wrapped
from tiltsim_controllers.references.waypoints import waypoint_motion

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
    x: float = 0.0  # m: set-point, start of the line, center of circle and lissajous
    y: float = 0.0
    z: float = 0.0
    velocity_x: float = 0.0  # m/s, line
    velocity_y: float = 0.0
    velocity_z: float = 0.0
    radius: float = 0.0  # m, circle
    angular_frequency: float = 0.0  # rad/s, circle
    roll: float = 0.0  # rad, all types but poses
    pitch: float = 0.0
    yaw: float = 0.0
    acceleration_feedforward: float = 0.0  # 1 or 0: whether the controller gets the acceleration
    amplitude_x: float = 0.0  # m, lissajous
    amplitude_y: float = 0.0
    amplitude_z: float = 0.0
    frequency_x: float = 0.0  # rad/s, lissajous
    frequency_y: float = 0.0
    frequency_z: float = 0.0
    phase_x: float = 0.0  # rad, lissajous
    phase_y: float = 0.0
    phase_z: float = 0.0
    segments: float = 0.0  # number of segments in the knots, waypoints and table
    offset: float = 0.0  # index of their first knot, waypoints
    acceleration_x: float = 0.0  # m/s^2, line
    acceleration_y: float = 0.0
    acceleration_z: float = 0.0


def reference_motion(time: Any, reference: ReferenceParameters, knots: Any = NO_KNOTS) -> Any:
    """A reference and its first four derivatives, for controllers of up to fourth order.

    Args:
        time: s
        reference: Type and parameters.
        knots: Table data of the flight; `ReferenceParameters.offset` is the index where the knots
            of waypoints or of a table begin.

    Returns:
        Position, velocity, acceleration, jerk and snap, m and s, world axes, shape (5, 3).
    """
    r = reference
    if r.type == WAYPOINTS:
        return waypoint_motion(time, r.segments, r.offset, knots)
    if r.type == POSES:
        return waypoint_motion(time, r.segments, r.offset, knots, 6)[:, :3]
    start, rest = xp.array([r.x, r.y, r.z]), xp.zeros(3)
    if r.type == SETPOINT:
        return xp.array([start, rest, rest, rest, rest])
    if r.type in (CIRCLE, LISSAJOUS):
        if r.type == CIRCLE:
            amplitude = xp.array([r.radius, r.radius, 0.0])
            turning, phase = xp.array([r.angular_frequency] * 3), xp.zeros(3)
            quarter = xp.array([1.0, 0.0, 0.0])  # x is a cosine
        else:
            amplitude = xp.array([r.amplitude_x, r.amplitude_y, r.amplitude_z])
            turning = xp.array([r.frequency_x, r.frequency_y, r.frequency_z])
            phase = xp.array([r.phase_x, r.phase_y, r.phase_z])
            quarter = rest
        sine, cosine = xp.sin(turning * time + phase), xp.cos(turning * time + phase)
        along = amplitude * (quarter * cosine + (1.0 - quarter) * sine)
        across = amplitude * turning * ((1.0 - quarter) * cosine - quarter * sine)
        square = turning * turning
        return xp.array(
            [start + along, across, -square * along, -square * across, square * square * along]
        )
    velocity = xp.array([r.velocity_x, r.velocity_y, r.velocity_z])
    acceleration = xp.array([r.acceleration_x, r.acceleration_y, r.acceleration_z])
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
