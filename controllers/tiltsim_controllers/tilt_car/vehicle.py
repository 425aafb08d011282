"""The tilt-car (ch. 10, Sec. 2): its parameters and its equations of motion.

A bottom disc slides without friction on a plane; a top disc is hinged on it and carries two
propellers whose thrusts pass through the axis, at ``+theta`` and ``-theta`` from the middle between
them. The middle points to ``psi + alpha``: yaw of the bottom disc plus tilt of the top disc
relative to it.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import Final, NamedTuple

from tiltsim_controllers.mathematics.scalar import Pair, scalar


class TiltCar(NamedTuple):
    """A tilt-car (thesis symbols in brackets)."""

    mass: float  # [m] kg, everything on board
    top_inertia: float  # [I_T] kg m^2, of the top disc about the axis
    bottom_inertia: float  # kg m^2, of the bottom disc about the axis
    half_angle: float  # [theta] rad, from the middle of the thrusts to either
    thrust_coefficient: float  # [K_F] N s^2/rad^2


THESIS_CAR: Final = TiltCar(
    mass=1.0,
    top_inertia=0.001,
    bottom_inertia=0.001,
    half_angle=pi / 6,
    thrust_coefficient=0.001,
)
"""Ch. 10's car.

The thesis does not give the mass; 1 kg is ours. Its ``I_B = 0.002`` is the whole car's: Eq. (2)
conserves angular momentum with no other reading (see `turn_per_tilt`).
"""

STATE_FIELDS: Final = (
    *("x", "y", "vx", "vy"),  # 0-3: m, m/s, world
    *("yaw", "alpha"),  # 4-5: rad, of the bottom disc; of the top disc relative to it
    *("rotor_speed_1", "rotor_speed_2"),  # 6-7: [omega] rad/s, never negative
)
"""The state of the car: one float per name, in this order."""


@scalar
def counter_yaw_per_tilt(car: TiltCar) -> float:
    """By how much the bottom disc turns back as the top disc tilts: ``-d psi / d alpha``.

    Angular momentum is conserved: ``I_T (psi' + alpha') + I_bottom psi' = 0``. That is Eq. (2),
    ``psi = -(I_T / I_B) alpha``, with ``I_B = I_T + I_bottom``, the inertia of the whole car.
    """
    return car.top_inertia / (car.top_inertia + car.bottom_inertia)


@scalar
def turn_per_tilt(car: TiltCar) -> float:
    """By how much the thrusts turn as the top disc tilts: ``1 - I_T / I_B`` of Eqs. (11), (18)."""
    return 1.0 - counter_yaw_per_tilt(car)


@scalar
def body_acceleration(square_1: float, square_2: float, car: TiltCar) -> Pair:
    """Acceleration (m/s^2) along the middle of the thrusts and across it: ``J_theta`` of Eq. (5).

    ``square_1`` and ``square_2`` are the squares of the rotor speeds (rad^2/s^2).
    """
    per_mass = car.thrust_coefficient / car.mass
    return (
        per_mass * cos(car.half_angle) * (square_1 + square_2),
        per_mass * sin(car.half_angle) * (square_1 - square_2),
    )


@scalar
def squared_speeds(along: float, across: float, car: TiltCar) -> Pair:
    """The squares of the rotor speeds that make an acceleration, of any sign: Eq. (5) inverted."""
    mass = 0.5 * car.mass / car.thrust_coefficient
    same, apart = along / cos(car.half_angle), across / sin(car.half_angle)
    return mass * (same + apart), mass * (same - apart)


@scalar
def turned(x: float, y: float, angle: float) -> Pair:
    """A vector turned by an angle (rad): ``J`` of Eq. (4)."""
    along, across = cos(angle), sin(angle)
    return along * x - across * y, across * x + along * y


@scalar
def acceleration(direction: float, square_1: float, square_2: float, car: TiltCar) -> Pair:
    """Acceleration (m/s^2, world) under thrusts whose middle points to ``direction``; Eq. (3)."""
    along, across = body_acceleration(square_1, square_2, car)
    return turned(along, across, direction)
