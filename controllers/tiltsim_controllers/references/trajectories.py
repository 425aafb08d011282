"""References to track: where the vehicle should be, as functions of time alone (ch. 4, Sec. 6)."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin
from typing import Final, NamedTuple

from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.mathematics.scalar import scalar
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
}
"""Reference types by the name a scenario gives them."""


class ReferenceParameters(NamedTuple):
    """What a reference is made of; each type reads the fields it knows."""

    type: float
    x: float = 0.0  # m: the setpoint, the start of the line, the centre of circle and lissajous
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
    acceleration_feedforward: float = 0.0  # 1 or 0: pass the acceleration on to the controller
    amplitude_x: float = 0.0  # m, lissajous
    amplitude_y: float = 0.0
    amplitude_z: float = 0.0
    frequency_x: float = 0.0  # rad/s, lissajous
    frequency_y: float = 0.0
    frequency_z: float = 0.0
    phase_x: float = 0.0  # rad, lissajous
    phase_y: float = 0.0
    phase_z: float = 0.0
    segments: float = 0.0  # number of rows of the table, waypoints
    offset: float = 0.0  # where in the table of the flight they begin, waypoints
    acceleration_x: float = 0.0  # m/s^2, line
    acceleration_y: float = 0.0
    acceleration_z: float = 0.0


@scalar
def sine_motion(
    time: float, amplitude: float, frequency: float, phase: float
) -> tuple[float, float, float, float, float]:
    """``amplitude sin(frequency time + phase)`` and its first four derivatives."""
    along = amplitude * sin(frequency * time + phase)
    across = amplitude * frequency * cos(frequency * time + phase)
    square = frequency * frequency
    return along, across, -square * along, -square * across, square * square * along


@scalar
def reference_derivatives(
    time: float, reference: ReferenceParameters, table: Sequence[float] = NO_KNOTS
) -> tuple[float, ...]:
    """A reference and its first four derivatives at a time (s), world axes.

    Returns position, velocity, acceleration, jerk and snap, three floats each, in m and s. Nothing
    is left out: laws of the fourth order (ch. 2, Eq. A2) need them all.
    """
    if reference.type == CIRCLE:
        radius = reference.radius
        omega = reference.angular_frequency
        across, along = radius * sin(omega * time), radius * cos(omega * time)
        square = omega * omega
        return (
            *(reference.x + along, reference.y + across, reference.z),
            *(-omega * across, omega * along, 0.0),
            *(-square * along, -square * across, 0.0),
            *(square * omega * across, -square * omega * along, 0.0),
            *(square * square * along, square * square * across, 0.0),
        )
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
        return (
            *(reference.x + x0, reference.y + y0, reference.z + z0),
            *(x1, y1, z1, x2, y2, z2, x3, y3, z3, x4, y4, z4),
        )
    if reference.type == WAYPOINTS:
        return waypoint_motion(time, reference.segments, reference.offset, table)
    if reference.type == SETPOINT:
        return (
            *(reference.x, reference.y, reference.z),
            *(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        )
    vx, vy, vz = reference.velocity_x, reference.velocity_y, reference.velocity_z
    ax, ay, az = reference.acceleration_x, reference.acceleration_y, reference.acceleration_z
    half = 0.5 * time * time
    return (
        reference.x + vx * time + ax * half,
        reference.y + vy * time + ay * half,
        reference.z + vz * time + az * half,
        *(vx + ax * time, vy + ay * time, vz + az * time),
        *(ax, ay, az, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    )


@scalar
def position_reference(
    time: float, reference: ReferenceParameters, table: Sequence[float] = NO_KNOTS
) -> tuple[float, ...]:
    """Position (m), velocity (m/s) and acceleration (m/s^2) to track at a time (s), world axes.

    Returns ``(x, y, z, vx, vy, vz, ax, ay, az)``. Ch. 4 sets the acceleration to zero for the
    circle too (Sec. 6.3); `ReferenceParameters.acceleration_feedforward` restores it. ``table`` is
    the flight's, in which `ReferenceParameters.offset` tells where waypoints lie.
    """
    if reference.type == SETPOINT:
        return reference.x, reference.y, reference.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if reference.type == CIRCLE:
        radius = reference.radius
        omega = reference.angular_frequency
        along, across = cos(omega * time), sin(omega * time)
        centripetal = -reference.acceleration_feedforward * radius * omega * omega
        return (
            reference.x + radius * along,
            reference.y + radius * across,
            reference.z,
            -radius * omega * across,
            radius * omega * along,
            0.0,
            centripetal * along,
            centripetal * across,
            0.0,
        )
    if reference.type == LISSAJOUS or reference.type == WAYPOINTS:
        motion = reference_derivatives(time, reference, table)
        known = reference.acceleration_feedforward
        return (
            *(motion[0], motion[1], motion[2], motion[3], motion[4], motion[5]),
            *(known * motion[6], known * motion[7], known * motion[8]),
        )
    ax, ay, az = reference.acceleration_x, reference.acceleration_y, reference.acceleration_z
    half = 0.5 * time * time
    feedforward = reference.acceleration_feedforward
    return (
        reference.x + reference.velocity_x * time + ax * half,
        reference.y + reference.velocity_y * time + ay * half,
        reference.z + reference.velocity_z * time + az * half,
        reference.velocity_x + ax * time,
        reference.velocity_y + ay * time,
        reference.velocity_z + az * time,
        feedforward * ax,
        feedforward * ay,
        feedforward * az,
    )
