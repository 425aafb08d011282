"""References to track as functions of time: set-point, line, circle and others (ch. 4, Sec. 6)."""

from __future__ import annotations

from math import cos, sin
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar
from tiltsim_controllers.references.waypoints import waypoint_motion

SETPOINT: Final = 0.0
LINE: Final = 1.0
CIRCLE: Final = 2.0
ATTITUDE_ALTITUDE: Final = 3.0
LISSAJOUS: Final = 4.0
WAYPOINTS: Final = 5.0

REFERENCE_TYPES: Final = {
    "setpoint": SETPOINT,
    "line": LINE,
    "circle": CIRCLE,
    "attitude_altitude": ATTITUDE_ALTITUDE,
    "lissajous": LISSAJOUS,
    "figure_eight": LISSAJOUS,
    "waypoints": WAYPOINTS,
    "table": WAYPOINTS,
}
"""Reference types by their name in a scenario."""


class ReferenceParameters(NamedTuple):
    """Parameters of a reference; each type reads the fields it needs."""

    type: float
    x: float = 0.0  # m: set-point, start of the line, centre of circle and lissajous
    y: float = 0.0
    z: float = 0.0
    velocity_x: float = 0.0  # m/s, line
    velocity_y: float = 0.0
    velocity_z: float = 0.0
    radius: float = 0.0  # m, circle
    angular_frequency: float = 0.0  # rad/s, circle
    roll: float = 0.0  # rad, attitude_altitude
    pitch: float = 0.0
    yaw: float = 0.0  # rad, all types
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


_AT_REST: Final = (0.0,) * 12


@scalar
def sine_motion(
    time: float, amplitude: float, frequency: float, phase: float
) -> tuple[float, float, float, float, float]:
    """``amplitude sin(frequency time + phase)`` and its first four derivatives.

    Args:
        time: s
        amplitude: m
        frequency, phase: rad/s and rad
    """
    along = amplitude * sin(frequency * time + phase)
    across = amplitude * frequency * cos(frequency * time + phase)
    square = frequency * frequency
    return along, across, -square * along, -square * across, square * square * along


@scalar
def reference_derivatives(
    time: float, reference: ReferenceParameters, knots: Vector = NO_KNOTS
) -> Values:
    """A reference and its first four derivatives, for controllers of up to fourth order.

    Args:
        time: s
        reference: type and parameters
        knots: those of the flight; `ReferenceParameters.offset` is the index where those of
            waypoints or of a table begin

    Returns:
        Position, velocity, acceleration, jerk and snap, three floats each, m and s, world axes.
    """
    if reference.type == CIRCLE:
        radius = reference.radius
        omega = reference.angular_frequency
        across, along = radius * sin(omega * time), radius * cos(omega * time)
        square = omega * omega
        position = (reference.x + along, reference.y + across, reference.z)
        velocity = (-omega * across, omega * along, 0.0)
        acceleration = (-square * along, -square * across, 0.0)
        jerk = (square * omega * across, -square * omega * along, 0.0)
        snap = (square * square * along, square * square * across, 0.0)
        return (*position, *velocity, *acceleration, *jerk, *snap)
    if reference.type == LISSAJOUS:
        x0, x1, x2, x3, x4 = sine_motion(
            time, reference.amplitude_x, reference.frequency_x, reference.phase_x
        )
        y0, y1, y2, y3, y4 = sine_motion(
            time, reference.amplitude_y, reference.frequency_y, reference.phase_y
        )
        z0, z1, z2, z3, z4 = sine_motion(
            time, reference.amplitude_z, reference.frequency_z, reference.phase_z
        )
        position = (reference.x + x0, reference.y + y0, reference.z + z0)
        return (*position, x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4)
    if reference.type == WAYPOINTS:
        return waypoint_motion(time, reference.segments, reference.offset, knots)
    if reference.type == SETPOINT:
        return (reference.x, reference.y, reference.z, *_AT_REST)
    vx, vy, vz = reference.velocity_x, reference.velocity_y, reference.velocity_z
    ax, ay, az = reference.acceleration_x, reference.acceleration_y, reference.acceleration_z
    half = 0.5 * time * time
    position = (
        reference.x + vx * time + ax * half,
        reference.y + vy * time + ay * half,
        reference.z + vz * time + az * half,
    )
    velocity = (vx + ax * time, vy + ay * time, vz + az * time)
    return (*position, *velocity, ax, ay, az, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@scalar
def position_reference(
    time: float, reference: ReferenceParameters, knots: Vector = NO_KNOTS
) -> Values:
    """Position (m), velocity (m/s) and acceleration (m/s^2) to track, world axes.

    Arguments as for `reference_derivatives`. Ch. 4 sets the acceleration to zero, for the circle
    too (Sec. 6.3); `ReferenceParameters.acceleration_feedforward` restores it. Returns ``(x, y, z,
    vx, vy, vz, ax, ay, az)``.
    """
    if reference.type == SETPOINT:
        return reference.x, reference.y, reference.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if reference.type == CIRCLE:
        radius = reference.radius
        omega = reference.angular_frequency
        along, across = cos(omega * time), sin(omega * time)
        centripetal = -reference.acceleration_feedforward * radius * omega * omega
        position = (reference.x + radius * along, reference.y + radius * across, reference.z)
        velocity = (-radius * omega * across, radius * omega * along, 0.0)
        return (*position, *velocity, centripetal * along, centripetal * across, 0.0)
    x, y, z, vx, vy, vz, ax, ay, az, _, _, _, _, _, _ = reference_derivatives(
        time, reference, knots
    )
    factor = reference.acceleration_feedforward
    return x, y, z, vx, vy, vz, factor * ax, factor * ay, factor * az
