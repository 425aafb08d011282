"""Cause and rate of the state drift of the over-actuated tilt-car (ch. 10, Secs. 4.2 and 6.2).

The car's acceleration is a function of three numbers, both rotor speeds and the tilt, where two
would suffice: each acceleration is produced along a curve of inputs, parametrized by the *lean*
``beta``, the angle from the thrusts' bisector to the acceleration. The minimum-norm controller
moves the inputs perpendicular to these curves. The planes perpendicular to them are not tangent to
any surfaces (`twist` is not zero: Frobenius), so inputs that follow a closed path of accelerations
do not return to their start: the lean advances by a holonomy, unobserved by the controller.

On a circle the acceleration keeps its magnitude ``A`` and turns at ``Omega``, and the minimum of
``W beta'^2 + alpha'^2`` under ``beta' + kappa alpha' = Omega`` gives the drift in closed form::

    beta' = Omega / (1 + kappa^2 W(beta))

with ``kappa = 1 - I_T / I_B`` and ``W`` the squared speed of the rotor speeds per lean
(`lean_stiffness`). It has the sign of ``Omega``, continues until a rotor stops at ``beta = theta``,
and slows down on the way there, as ``W`` grows without bound.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np

from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.tilt_car.third_derivative import null_space_input
from tiltsim_controllers.tilt_car.vehicle import TiltCar, input_matrix, turn_per_tilt


class Orbit(NamedTuple):
    """Uniform motion around a circle."""

    acceleration: float  # [A] m/s^2, toward the center
    angular_frequency: float  # [Omega] rad/s, positive counter-clockwise


def orbit(radius: float, angular_frequency: float) -> Orbit:
    """The orbit of a radius (m, of either sign) at an angular frequency (rad/s)."""
    return Orbit(abs(radius) * angular_frequency**2, angular_frequency)


def lean_stiffness(lean: float, acceleration: float, car: TiltCar) -> float:
    """``W(beta)`` ((rad/s)^2/rad^2): squared change of the rotor speeds per lean.

    ``lean`` in rad, ``acceleration`` in m/s^2.
    """
    theta = car.half_angle
    scale = _scale(acceleration, car)
    return scale * sum(cos(angle) ** 2 / sin(angle) for angle in (theta + lean, theta - lean))


def _scale(acceleration: float, car: TiltCar) -> float:
    return car.mass * acceleration / (4.0 * car.thrust_coefficient * sin(2.0 * car.half_angle))


def drift_rate(lean: float, path: Orbit, car: TiltCar) -> float:
    """The rate (rad/s) at which the lean (rad) advances under the minimum-norm controller."""
    stiffness = lean_stiffness(lean, path.acceleration, car)
    return path.angular_frequency / (1.0 + turn_per_tilt(car) ** 2 * stiffness)


def twist(speed_1: float, speed_2: float, car: TiltCar) -> float:
    """``n . curl n`` of the unit null-space input ``n(omega_1, omega_2, alpha)``, per input.

    Only if it were zero would the minimum-norm planes be tangent to surfaces (Frobenius), on which
    every lap closes. By central differences at rotor speeds (rad/s); ``n`` is independent of tilt.
    """
    steps = 1e-5 * speed_1, 1e-5 * speed_2

    def direction(w1: float, w2: float) -> Floats:
        n = null_space_input(input_matrix(np.array([w1, w2]), car))
        return np.asarray(n / np.linalg.norm(n))

    by_1 = (direction(speed_1 + steps[0], speed_2) - direction(speed_1 - steps[0], speed_2)) / (
        2.0 * steps[0]
    )
    by_2 = (direction(speed_1, speed_2 + steps[1]) - direction(speed_1, speed_2 - steps[1])) / (
        2.0 * steps[1]
    )
    curl = np.array([by_2[2], -by_1[2], by_1[1] - by_2[0]])
    return float(direction(speed_1, speed_2) @ curl)
