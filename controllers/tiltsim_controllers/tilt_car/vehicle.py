"""The tilt-car (ch. 10, Sec. 2): its parameters and its equations of motion.

A bottom disc slides without friction on a plane; a top disc is hinged on it and carries two
propellers whose thrusts pass through the axis, at ``+theta`` and ``-theta`` from their bisector.
The bisector has the direction ``psi + alpha``: yaw of the bottom disc plus tilt of the top disc
relative to it.
"""

from math import pi
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import xp


class TiltCar(NamedTuple):
    """A tilt-car (thesis symbols in brackets)."""

    mass: float  # [m] kg, everything on board
    top_inertia: float  # [I_T] kg m^2, of the top disc about the axis
    bottom_inertia: float  # kg m^2, of the bottom disc about the axis
    half_angle: float  # [theta] rad, from the bisector of the thrusts to either
    thrust_coefficient: float  # [K_F] N s^2/rad^2

    @property
    def tilts(self) -> int:
        """The number of tilt angles that a gait plans."""
        return 1


THESIS_CAR: Final = TiltCar(
    mass=1.0, top_inertia=0.001, bottom_inertia=0.001, half_angle=pi / 6, thrust_coefficient=0.001
)
"""Ch. 10's car.

The thesis does not state the mass; 1 kg is our choice. Its ``I_B = 0.002`` is the inertia of the
whole car: only then Eq. (2) conserves angular momentum (see `turn_per_tilt`).
"""

STATE_FIELDS: Final = ("x", "y", "vx", "vy", "yaw", "alpha", "rotor_speed_1", "rotor_speed_2")
"""The state of the car: m, m/s, world; yaw of the bottom disc and tilt of the top disc relative to
it, rad; [omega] rad/s, never negative."""


def counter_yaw_per_tilt(car: TiltCar) -> float:
    """Counter-rotation of the bottom disc per tilt of the top disc: ``-d psi / d alpha``.

    Angular momentum is conserved: ``I_T (psi' + alpha') + I_bottom psi' = 0``. That is Eq. (2),
    ``psi = -(I_T / I_B) alpha``, with ``I_B = I_T + I_bottom``, the inertia of the whole car.
    """
    return car.top_inertia / (car.top_inertia + car.bottom_inertia)


def turn_per_tilt(car: TiltCar) -> float:
    """Rotation of the thrusts per tilt of the top disc: ``1 - I_T / I_B`` of Eqs. (11), (18)."""
    return 1.0 - counter_yaw_per_tilt(car)


def thrust_map(car: TiltCar) -> Any:
    """Acceleration along the thrusts' bisector and across it per squared rotor speed.

    ``J_theta / m`` of Eq. (5), m/s^2 per (rad/s)^2, shape (2, 2).
    """
    along, across = xp.cos(car.half_angle), xp.sin(car.half_angle)
    return car.thrust_coefficient / car.mass * xp.array([[along, along], [across, -across]])


def squared_speeds(acceleration: Any, car: TiltCar) -> Any:
    """The squared rotor speeds (rad^2/s^2), of any sign, for an acceleration (2,): Eq. (5).

    It is along the bisector and across it, m/s^2.
    """
    same = acceleration[0] / xp.cos(car.half_angle)
    apart = acceleration[1] / xp.sin(car.half_angle)
    return 0.5 * car.mass / car.thrust_coefficient * xp.array([same + apart, same - apart])


def rotation(angle: Any) -> Any:
    """The rotation of the plane by an angle (rad), ``J`` of Eq. (4), shape (2, 2)."""
    c, s = xp.cos(angle), xp.sin(angle)
    return xp.array([[c, -s], [s, c]])


def acceleration(direction: Any, squares: Any, car: TiltCar) -> Any:
    """Acceleration (m/s^2, world), (2,), of a bisector's direction and squared speeds: Eq. (3)."""
    return rotation(direction) @ (thrust_map(car) @ squares)


def input_matrix(speeds: Any, car: TiltCar) -> Any:
    """``Delta`` of Eqs. (9)-(11) in the frame of the thrusts' bisector, shape (2, 3).

    The third derivative of the position per rate of both rotor speeds (rad/s, shape (2,)) and of
    the tilt angle. The rotation to the world (Eq. 4) multiplies the whole matrix.
    """
    rotors = thrust_map(car) * (2.0 * speeds)
    along, across = thrust_map(car) @ (speeds * speeds)
    tilt = turn_per_tilt(car) * xp.array([-across, along])
    return xp.hstack([rotors, tilt.reshape(2, 1)])
