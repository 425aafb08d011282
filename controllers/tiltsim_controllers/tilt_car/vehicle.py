"""The tilt-car (ch. 10, Sec. 2): its parameters and its equations of motion.

A bottom disc slides without friction on a plane; a top disc is hinged on it and carries two
propellers whose thrusts pass through the axis, at ``+theta`` and ``-theta`` from their bisector.
The bisector has the direction ``psi + alpha``: yaw of the bottom disc plus tilt of the top disc
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
    half_angle: float  # [theta] rad, from the bisector of the thrusts to either
    thrust_coefficient: float  # [K_F] N s^2/rad^2


THESIS_CAR: Final = TiltCar(
    mass=1.0, top_inertia=0.001, bottom_inertia=0.001, half_angle=pi / 6, thrust_coefficient=0.001
)
"""Ch. 10's car.

The thesis does not state the mass; 1 kg is our choice. Its ``I_B = 0.002`` is that of the whole
car: only then Eq. (2) conserves angular momentum (see `turn_per_tilt`).
"""

STATE_FIELDS: Final = ("x", "y", "vx", "vy", "yaw", "alpha", "rotor_speed_1", "rotor_speed_2")
"""The state of the car: m, m/s, world; yaw of the bottom disc and tilt of the top disc relative to
it, rad; [omega] rad/s, never negative."""


@scalar
def counter_yaw_per_tilt(car: TiltCar) -> float:
    """Counter-rotation of the bottom disc per tilt of the top disc: ``-d psi / d alpha``.

    Angular momentum is conserved: ``I_T (psi' + alpha') + I_bottom psi' = 0``. That is Eq. (2),
    ``psi = -(I_T / I_B) alpha``, with ``I_B = I_T + I_bottom``, the inertia of the whole car.
    """
    return car.top_inertia / (car.top_inertia + car.bottom_inertia)


@scalar
def turn_per_tilt(car: TiltCar) -> float:
    """Rotation of the thrusts per tilt of the top disc: ``1 - I_T / I_B`` of Eqs. (11), (18)."""
    return 1.0 - counter_yaw_per_tilt(car)


@scalar
def body_acceleration(square_1: float, square_2: float, car: TiltCar) -> Pair:
    """Acceleration (m/s^2) along the thrusts' bisector and across it: ``J_theta`` of Eq. (5).

    ``square_1`` and ``square_2`` are the squares of the rotor speeds (rad^2/s^2).
    """
    per_mass = car.thrust_coefficient / car.mass
    return (
        per_mass * cos(car.half_angle) * (square_1 + square_2),
        per_mass * sin(car.half_angle) * (square_1 - square_2),
    )


@scalar
def squared_speeds(along: float, across: float, car: TiltCar) -> Pair:
    """The squared rotor speeds (rad^2/s^2) for an acceleration (m/s^2), of any sign: Eq. (5)."""
    mass = 0.5 * car.mass / car.thrust_coefficient
    same, apart = along / cos(car.half_angle), across / sin(car.half_angle)
    return mass * (same + apart), mass * (same - apart)


@scalar
def rotate(x: float, y: float, angle: float) -> Pair:
    """A vector rotated by an angle (rad): ``J`` of Eq. (4)."""
    along, across = cos(angle), sin(angle)
    return along * x - across * y, across * x + along * y


@scalar
def acceleration(direction: float, square_1: float, square_2: float, car: TiltCar) -> Pair:
    """Acceleration (m/s^2, world); Eq. (3).

    Args:
        direction: of the thrusts' bisector, rad
        square_1, square_2: squared rotor speeds, rad^2/s^2
        car: the tilt-car
    """
    along, across = body_acceleration(square_1, square_2, car)
    return rotate(along, across, direction)
