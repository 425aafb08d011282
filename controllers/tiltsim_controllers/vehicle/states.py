"""Names and indices of the vehicles' states."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

X, Y, Z, VX, VY, VZ, ROLL, PITCH, YAW, P, Q, R = range(12)
ALPHA_1, ALPHA_2, ALPHA_3, ALPHA_4, SPEED_1, SPEED_2, SPEED_3, SPEED_4 = range(12, 20)
THRUST, THRUST_RATE = range(12, 14)

ROTORS: Final = (1, 2, 3, 4)
"""Numbers of the rotors of tiltrotor and quadrotor."""

BODY_FIELDS: Final = ("x", "y", "z", "vx", "vy", "vz", "roll", "pitch", "yaw", "p", "q", "r")
"""A rigid body: position (m) and velocity (m/s), world axes; rad; body rates, rad/s."""

TILT_FIELDS: Final = ("alpha_1", "alpha_2", "alpha_3", "alpha_4")
"""Tilt angles, rad."""

ROTOR_FIELDS: Final = ("rotor_speed_1", "rotor_speed_2", "rotor_speed_3", "rotor_speed_4")
"""Rotor speeds, rad/s, signed."""

TILTROTOR_FIELDS: Final = (*BODY_FIELDS, *TILT_FIELDS, *ROTOR_FIELDS)
"""The state of the tiltrotor: one float per name, in this order."""

EXTENDED_QUADROTOR_FIELDS: Final = (*BODY_FIELDS, "thrust", "thrust_rate")
"""The state of the quadrotor and of the dynamic extension of ch. 2, [zeta] N and [xi] N/s."""


class RotorcraftState(NamedTuple):
    """The state of a vehicle with N rotors and M tilts."""

    position: Any  # m, world axes, shape (3,)
    velocity: Any  # m/s, world axes, shape (3,)
    attitude: Any  # roll, pitch and yaw, rad, shape (3,)
    omega: Any  # body rates, rad/s, shape (3,)
    tilts: Any  # rad, shape (M,)
    speeds: Any  # of the rotors, rad/s, signed, shape (N,)


def state_of(values: Any, tilt_of_rotor: tuple[int, ...]) -> RotorcraftState:
    """The state by name.

    Args:
        values: Fields of the state one after the other, shape (12 + M + N,).
        tilt_of_rotor: The layout: the number of each rotor's tilt, from 0; -1 for a fixed rotor.
    """
    first = 12 + max(tilt_of_rotor) + 1
    body = values[0:3], values[3:6], values[6:9], values[9:12]
    return RotorcraftState(*body, values[12:first], values[first : first + len(tilt_of_rotor)])
