"""The tilt-car's equations of motion as ch. 10 prints them (Eqs. 2 and 3)."""

from __future__ import annotations

from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.tilt_car.vehicle import TiltCar, acceleration, counter_yaw_per_tilt


@scalar
def yaw_of(alpha: float, heading: float, car: TiltCar) -> float:
    """Yaw (rad) at a tilt angle, ``heading`` at zero tilt; Eq. (2)."""
    return heading - counter_yaw_per_tilt(car) * alpha


@scalar
def equations_of_motion(
    state: Vector,
    direction: float,
    square_1: float,
    square_2: float,
    car: TiltCar,
    disturbance: Triple,
) -> Values:
    """Rates of position and velocity, the state's first four numbers; Eq. (3).

    Args:
        state: Begins with position and velocity.
        direction: Of the thrusts' bisector, rad.
        square_1, square_2: Of the rotor speeds, (rad/s)^2.
        car: The vehicle.
        disturbance: An acceleration unknown to the controller, m/s^2, world axes.
    """
    ax, ay = acceleration(direction, square_1, square_2, car)
    gust_x, gust_y, _ = disturbance
    return state[2], state[3], ax + gust_x, ay + gust_y


@scalar
def limited_rate(speed: float, rate: float) -> float:
    """The rate (rad/s^2) of a rotor that cannot turn backwards, from the demanded rate."""
    return 0.0 if speed <= 0.0 and rate < 0.0 else rate
