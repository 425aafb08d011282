"""The tilt-car's lean: its drift time, its split of the rotor speeds, and where it is restored."""

from __future__ import annotations

from math import copysign, cos, log, pi, sin, tan

import numpy as np

from tiltsim_controllers.tilt_car.cycles import _scale, drift_rate
from tiltsim_controllers.tilt_car.vehicle import squared_speeds, thrust_map, turn_per_tilt


def turned_angle(lean, path, car):
    """The integral of ``1 + kappa^2 W`` from zero to a lean (rad): rotation of the acceleration."""
    theta = car.half_angle

    def integral(angle):  # of cos^2 / sin
        return log(tan(0.5 * angle)) + cos(angle)

    weight = turn_per_tilt(car) ** 2 * _scale(path.acceleration, car)
    return lean + weight * (integral(theta + lean) - integral(theta - lean))


def lean_after(time, start, path, car):
    """The lean (rad) after a time on an orbit, in steady state.

    Args:
        time: s
        start: initial lean, rad
        path, car: the orbit and the tilt-car
    """
    target = turned_angle(start, path, car) + path.angular_frequency * time
    low, high = -car.half_angle, car.half_angle
    for _ in range(200):  # bisection; the integral grows from minus to plus infinity
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if turned_angle(middle, path, car) < target:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def drift_time(start, end, path, car):
    """The time (s) that the lean takes from one value to another, in closed form.

    Negative where the drift leads the other way. Both must lie within plus and minus the half
    angle.

    Raises:
        ValueError: If a lean is not within.
    """
    for lean in (start, end):
        if not abs(lean) < car.half_angle:
            raise ValueError(
                f"lean = {lean!r}: must lie within the half angle, {car.half_angle:.6g} rad"
            )
    angle = turned_angle(end, path, car) - turned_angle(start, path, car)
    return angle / path.angular_frequency


def lean_of_split(split, acceleration, car):
    """The lean (rad) at which the squares of the rotor speeds differ by ``split`` (rad^2/s^2)."""
    _, across = thrust_map(car) @ (split, 0.0)
    return float(np.arcsin(across / acceleration))


def split_of_lean(lean, acceleration, car):
    """``omega_1^2 - omega_2^2`` (rad^2/s^2) at a lean (rad) and acceleration (m/s^2)."""
    square_1, square_2 = squared_speeds((acceleration * cos(lean), acceleration * sin(lean)), car)
    return square_1 - square_2


def lean_of(square_1, square_2, car):
    """The lean (rad) at squares of rotor speeds (rad^2/s^2), arrays of any shape."""
    along = cos(car.half_angle) * (np.asarray(square_1) + square_2)
    across = sin(car.half_angle) * (np.asarray(square_1) - square_2)
    return np.asarray(np.arctan2(across, along))


def restored_lean(path, car, rate):
    """The lean (rad) at which a restoring rate (1/s) and the drift hold each other.

    There is one for every rate above 0, for the drift dies away toward the half angle.

    Raises:
        ValueError: If the rate is not above 0.
    """
    if not rate > 0.0:
        raise ValueError(f"rate = {rate!r}: must be above 0")
    low, high = 0.0, car.half_angle
    for _ in range(200):  # bisection; both signs of the drift are alike
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if abs(drift_rate(middle, path, car)) > rate * middle:
            low = middle
        else:
            high = middle
    return copysign(low, path.angular_frequency)


def holonomy(lean, path, car):
    """The advance (rad) of the lean over one lap that begins with this lean (rad)."""
    time = 2.0 * pi / abs(path.angular_frequency)
    return lean_after(time, lean, path, car) - lean
