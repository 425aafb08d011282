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
    return (
        reference.x + reference.velocity_x * time,
        reference.y + reference.velocity_y * time,
        reference.z + reference.velocity_z * time,
        reference.velocity_x,
        reference.velocity_y,
        reference.velocity_z,
        0.0,
        0.0,
        0.0,
    )
