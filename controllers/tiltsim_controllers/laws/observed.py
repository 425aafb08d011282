"""What a control law for any rotorcraft sees, as scalar code.

The law is a scalar function ``(observed, parameters) -> thrusts, tilts, rates``: what it sees, the
record of its own parameters; the thrust (N) of every rotor along its axis, the tilt angles (rad)
where the law moves them, else ``()``, and the rates of its own states, ``()`` without any.
"""

from __future__ import annotations

from typing import NamedTuple

from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector
from tiltsim_controllers.vehicle.multirotor import Body


class Desired(NamedTuple):
    """The reference: motion in world axes, roll, pitch and yaw, and the planned gait."""

    position: Triple  # m
    velocity: Triple  # m/s
    acceleration: Triple  # m/s^2
    jerk: Triple  # m/s^3
    attitude: Triple  # rad
    tilt_angles: Values  # rad
    tilt_rates: Values  # rad/s


class Observed(NamedTuple):
    """The vehicle, as far as the sensors show it, and what is known about it."""

    time: float  # s
    position: Triple  # m, world axes
    velocity: Triple  # m/s, world axes
    attitude: Triple  # roll, pitch, yaw, rad
    rotation: Values  # body to world, nine entries, rows first
    body_rates: Triple  # rad/s, body axes
    tilt_angles: Values  # rad
    tilt_rates: Values  # rad/s
    rotor_speeds: Values  # rad/s, along the spin
    thrusts: Values  # N, with which the rotors push now
    states: Values  # the law's own
    reference: Desired
    vehicle: Body  # mass, gravity, inertia
    force: tuple[Values, Values, Values]  # x, y, z of every rotor per newton of its thrust, body
    torque: tuple[Values, Values, Values]  # likewise, N m per newton
    table: Vector  # of the rotors per newton from `at` on; see `vehicle.effectiveness`
    at: int
    own: int  # index in `table` of the law's own numbers, if it has a table
