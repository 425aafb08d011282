"""References to track: where the vehicle should be, as functions of time alone (ch. 4, Sec. 6)."""

from __future__ import annotations

from math import cos, sin
from typing import Final, NamedTuple

from controllers.scalar import scalar

SETPOINT: Final = 0
LINE: Final = 1
CIRCLE: Final = 2
ATTITUDE_ALTITUDE: Final = 3

REFERENCE_TYPES: Final = {
    "setpoint": SETPOINT,
    "line": LINE,
    "circle": CIRCLE,
    "attitude_altitude": ATTITUDE_ALTITUDE,
}
"""Reference types by the name a scenario gives them."""


class ReferenceParameters(NamedTuple):
    """What a reference is made of; each type reads the fields it knows."""

    type: float
    x: float = 0.0  # m: the setpoint, the start of the line, the centre of the circle
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
    acceleration_x: float = 0.0  # m/s^2, line
    acceleration_y: float = 0.0
    acceleration_z: float = 0.0


@scalar
def position_reference(time: float, reference: ReferenceParameters) -> tuple[float, ...]:
    """Position (m), velocity (m/s) and acceleration (m/s^2) to track at a time (s), world axes.

    Returns ``(x, y, z, vx, vy, vz, ax, ay, az)``. Ch. 4 sets the acceleration to zero for the
    circle too (Sec. 6.3); `ReferenceParameters.acceleration_feedforward` restores it.
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


@scalar
def reference_derivatives(time: float, reference: ReferenceParameters) -> tuple[float, ...]:
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
    x, y, z, vx, vy, vz, _, _, _ = position_reference(time, reference)
    ax, ay, az = reference.acceleration_x, reference.acceleration_y, reference.acceleration_z
    return (x, y, z, vx, vy, vz, ax, ay, az, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
