"""Why the states of the over-actuated tilt-car drift, and how fast (ch. 10, Secs. 4.2 and 6.2).

The car's acceleration is a function of three numbers, both rotor speeds and the tilt, and two of
them would do: each acceleration can be had along a curve of inputs. Along the curve runs the *lean*
``beta``, the angle from the middle of the thrusts to the acceleration. The minimum-norm law moves
the inputs at right angles to these curves. The planes at right angles to them do not fit together
into surfaces (`twist` is not zero: Frobenius), so inputs that go round with an acceleration do not
come back to where they were: the lean advances by a holonomy. Nothing in the law sees it.

On a circle the acceleration keeps its size ``A`` and turns at ``Omega``, and the minimum of
``W beta'^2 + alpha'^2`` under ``beta' + kappa alpha' = Omega`` gives the drift in closed form::

    beta' = Omega / (1 + kappa^2 W(beta))

with ``kappa = 1 - I_T / I_B`` and ``W`` the squared speed of the rotor speeds per lean
(`lean_stiffness`). It has the sign of ``Omega``, never ends before a rotor stands still at ``beta =
theta``, and slows down on the way there, for ``W`` grows without bound.
"""

from __future__ import annotations

from math import cos, log, pi, sin, tan
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tiltsim_controllers.tilt_car.third_derivative import input_columns, null_space_input
from tiltsim_controllers.tilt_car.vehicle import (
    TiltCar,
    turn_per_tilt,
)

Array = npt.NDArray[np.float64]


class Orbit(NamedTuple):
    """Uniform motion around a circle."""

    acceleration: float  # [A] m/s^2, towards the centre
    angular_frequency: float  # [Omega] rad/s, positive counter-clockwise


def orbit(radius: float, angular_frequency: float) -> Orbit:
    """The orbit of a radius (m, its sign does not matter) at an angular frequency (rad/s)."""
    return Orbit(abs(radius) * angular_frequency**2, angular_frequency)


def lean_stiffness(lean: float, acceleration: float, car: TiltCar) -> float:
    """``W(beta)``: the squares of both rotor speeds' change per radian of lean, (rad/s)^2/rad^2."""
    theta = car.half_angle
    scale = _scale(acceleration, car)
    return scale * sum(cos(angle) ** 2 / sin(angle) for angle in (theta + lean, theta - lean))


def _scale(acceleration: float, car: TiltCar) -> float:
    return car.mass * acceleration / (4.0 * car.thrust_coefficient * sin(2.0 * car.half_angle))


def drift_rate(lean: float, path: Orbit, car: TiltCar) -> float:
    """The rate (rad/s) at which the lean advances under the minimum-norm law."""
    stiffness = lean_stiffness(lean, path.acceleration, car)
    return path.angular_frequency / (1.0 + turn_per_tilt(car) ** 2 * stiffness)


def holonomy(lean: float, path: Orbit, car: TiltCar) -> float:
    """By how much (rad) the lean has advanced after one lap that began with this lean."""
    time = 2.0 * pi / abs(path.angular_frequency)
    return lean_after(time, lean, path, car) - lean


def turned_angle(lean: float, path: Orbit, car: TiltCar) -> float:
    """The integral of ``1 + kappa^2 W`` from no lean: how far the acceleration turns meanwhile."""
    theta = car.half_angle

    def integral(angle: float) -> float:  # of cos^2 / sin
        return log(tan(0.5 * angle)) + cos(angle)

    weight = turn_per_tilt(car) ** 2 * _scale(path.acceleration, car)
    return lean + weight * (integral(theta + lean) - integral(theta - lean))


def lean_after(time: float, start: float, path: Orbit, car: TiltCar) -> float:
    """The lean (rad) that a lean at the start has become after a time (s), on a settled orbit."""
    wanted = turned_angle(start, path, car) + path.angular_frequency * time
    low, high = -car.half_angle, car.half_angle
    for _ in range(200):  # bisection; the integral grows from minus to plus infinity
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if turned_angle(middle, path, car) < wanted:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def twist(speed_1: float, speed_2: float, car: TiltCar) -> float:
    """``n . curl n`` of the unit silent input ``n(omega_1, omega_2, alpha)``, per unit of input.

    Zero, and only zero, would let the minimum-norm planes fit into surfaces (Frobenius), on which
    every lap closes. By central differences; ``n`` does not depend on the tilt.
    """
    steps = 1e-5 * speed_1, 1e-5 * speed_2

    def direction(w1: float, w2: float) -> Array:
        n = np.array(null_space_input(input_columns(w1, w2, car)))
        return np.asarray(n / np.linalg.norm(n))

    by_1 = (direction(speed_1 + steps[0], speed_2) - direction(speed_1 - steps[0], speed_2)) / (
        2.0 * steps[0]
    )
    by_2 = (direction(speed_1, speed_2 + steps[1]) - direction(speed_1, speed_2 - steps[1])) / (
        2.0 * steps[1]
    )
    curl = np.array([by_2[2], -by_1[2], by_1[1] - by_2[0]])
    return float(direction(speed_1, speed_2) @ curl)
