"""Third-derivative feedback linearization of the tilt-car (ch. 10, Sec. 3.1).

Three inputs, the rates of both rotor speeds and of the tilt angle, determine two outputs, the third
derivatives of the position. The controller takes the shortest of all solutions (`minimum_norm`,
Eq. 12), which makes its states drift (`tiltsim_controllers.tilt_car.state_drift`). Optionally a
restoring rate in the null space turns the thrusts' bisector back towards the acceleration.
"""

from __future__ import annotations

from math import atan2, nan
from typing import Final, NamedTuple

from tiltsim_controllers.mathematics.scalar import Pair, Triple, Values, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.tilt_car.vehicle import TiltCar, body_acceleration, rotate, turn_per_tilt


class Gains(NamedTuple):
    """Gains on acceleration, velocity and position, the same for both axes."""

    acceleration: float  # [k_1] 1/s
    velocity: float  # [k_2] 1/s^2
    position: float  # [k_3] 1/s^3


class Parameters(NamedTuple):
    """Parameters of the controller."""

    car: TiltCar
    gains: Gains
    reference: ReferenceParameters
    restoring_rate: float  # 1/s, 0 as published


GAIN_SETS: Final = {
    # Ours, all three poles at -2: the thesis prints none.
    "ch10": Gains(6.0, 12.0, 8.0)
}
"""Gains by name."""


@scalar
def input_columns(speed_1: float, speed_2: float, car: TiltCar) -> Values:
    """The three columns of ``Delta`` of Eqs. (9)-(11) in the frame of the thrusts' bisector.

    The rotation to the world (Eq. 4) multiplies the whole matrix and cancels. Rotor speeds in
    rad/s.
    """
    push_1, side_1 = body_acceleration(2.0 * speed_1, 0.0, car)
    push_2, side_2 = body_acceleration(0.0, 2.0 * speed_2, car)
    along, across = body_acceleration(speed_1 * speed_1, speed_2 * speed_2, car)
    share = turn_per_tilt(car)
    return push_1, side_1, push_2, side_2, -share * across, share * along


@scalar
def minimum_norm(columns: Values, desired: Pair) -> Triple:
    """The shortest inputs for the desired outputs, ``Delta^T (Delta Delta^T)^-1`` (Eq. 12).

    ``columns`` are the `input_columns`. NaN where the matrix is rank-deficient: with both rotors at
    rest. With one rotor at rest it is not, contrary to ch. 10: the tilt turns the other thrust.
    """
    x1, y1, x2, y2, x3, y3 = columns
    xx = x1 * x1 + x2 * x2 + x3 * x3
    xy = x1 * y1 + x2 * y2 + x3 * y3
    yy = y1 * y1 + y2 * y2 + y3 * y3
    det = xx * yy - xy * xy
    if det == 0.0:
        return nan, nan, nan
    x, y = desired
    p, q = (yy * x - xy * y) / det, (xx * y - xy * x) / det
    return x1 * p + y1 * q, x2 * p + y2 * q, x3 * p + y3 * q


@scalar
def null_space_input(columns: Values) -> Triple:
    """The direction of inputs without effect on the outputs: the null space of ``Delta``."""
    x1, y1, x2, y2, x3, y3 = columns
    return x2 * y3 - x3 * y2, x3 * y1 - x1 * y3, x1 * y2 - x2 * y1


@scalar
def restoring_inputs(lean: float, rate: float, columns: Values, car: TiltCar) -> Triple:
    """Inputs without effect on the outputs that reduce the lean.

    Zero where a rotor rests, as then no input in the null space turns the bisector.

    Args:
        lean: angle from the thrusts' bisector to the acceleration, rad
        rate: 1/s
        columns: `input_columns`
        car: the tilt-car
    """
    n1, n2, n3 = null_space_input(columns)
    if n3 == 0.0:
        return 0.0, 0.0, 0.0
    scale = rate * lean / (turn_per_tilt(car) * n3)
    return scale * n1, scale * n2, scale * n3


@scalar
def demanded_jerk(time: float, state: Values, parameters: Parameters) -> Pair:
    """The desired third derivative of the position (m/s^3, world); Eq. (14)."""
    x, y, vx, vy, yaw, alpha, speed_1, speed_2 = state
    car, gains = parameters.car, parameters.gains
    motion = reference_derivatives(time, parameters.reference)
    x0, y0, _, x1, y1, _, x2, y2, _, x3, y3, _, _, _, _ = motion
    along, across = body_acceleration(speed_1 * speed_1, speed_2 * speed_2, car)
    ax, ay = rotate(along, across, yaw + alpha)
    k1, k2, k3 = gains.acceleration, gains.velocity, gains.position
    return (
        x3 + k1 * (x2 - ax) + k2 * (x1 - vx) + k3 * (x0 - x),
        y3 + k1 * (y2 - ay) + k2 * (y1 - vy) + k3 * (y0 - y),
    )


@scalar
def third_derivative_inputs(time: float, state: Values, parameters: Parameters) -> Triple:
    """Rates of the rotor speeds (rad/s^2) and of the tilt angle (rad/s); Eq. (14)."""
    car = parameters.car
    _, _, _, _, yaw, alpha, speed_1, speed_2 = state
    jerk_x, jerk_y = demanded_jerk(time, state, parameters)
    desired = rotate(jerk_x, jerk_y, -(yaw + alpha))
    columns = input_columns(speed_1, speed_2, car)
    rate_1, rate_2, tilt_rate = minimum_norm(columns, desired)
    if parameters.restoring_rate == 0.0:
        return rate_1, rate_2, tilt_rate
    along, across = body_acceleration(speed_1 * speed_1, speed_2 * speed_2, car)
    extra = restoring_inputs(atan2(across, along), parameters.restoring_rate, columns, car)
    return rate_1 + extra[0], rate_2 + extra[1], tilt_rate + extra[2]
