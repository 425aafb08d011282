"""Third-derivative feedback linearization of the tilt-car (ch. 10, Sec. 3.1).

Three inputs, the rates of both rotor speeds and of the tilt angle, make two outputs, the third
derivative of the position. Of all inputs the law takes the shortest (`minimum_norm`, Eq. 12), which
is why its states drift (`tiltsim_controllers.tilt_car.state_drift`). Optionally a restoring rate
along the inputs that the outputs do not feel turns the thrusts' middle back to the acceleration.
"""

from __future__ import annotations

from math import atan2, nan
from typing import Final, NamedTuple

from tiltsim_controllers.mathematics.scalar import Pair, Triple, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.tilt_car.vehicle import TiltCar, body_acceleration, turn_per_tilt, turned

State = tuple[float, ...]


class Gains(NamedTuple):
    """Gains on acceleration, velocity and position, the same for both axes."""

    acceleration: float  # [k_1] 1/s
    velocity: float  # [k_2] 1/s^2
    position: float  # [k_3] 1/s^3


class Parameters(NamedTuple):
    """All that the law needs to know besides time and state."""

    car: TiltCar
    gains: Gains
    reference: ReferenceParameters
    restoring_rate: float  # 1/s, 0 as published


GAIN_SETS: Final = {
    # Ours, all three poles at -2: the thesis prints none.
    "ch10": Gains(6.0, 12.0, 8.0),
}
"""Gains by name."""


@scalar
def input_columns(speed_1: float, speed_2: float, car: TiltCar) -> tuple[float, ...]:
    """``Delta`` of Eqs. (9)-(11) seen from the thrusts' middle, its three columns in a row.

    The rotation to the world (Eq. 4) stands before the whole matrix and drops out of its inverse.
    """
    push_1, side_1 = body_acceleration(2.0 * speed_1, 0.0, car)
    push_2, side_2 = body_acceleration(0.0, 2.0 * speed_2, car)
    along, across = body_acceleration(speed_1 * speed_1, speed_2 * speed_2, car)
    share = turn_per_tilt(car)
    return push_1, side_1, push_2, side_2, -share * across, share * along


@scalar
def minimum_norm(columns: tuple[float, ...], wanted: Pair) -> Triple:
    """The shortest inputs that make the wanted outputs, ``Delta^T (Delta Delta^T)^-1`` (Eq. 12).

    NaN where the matrix has no full row rank: with both rotors at rest. One rotor at rest does no
    harm, other than ch. 10 says: the tilt then turns the other one's thrust.
    """
    x1, y1, x2, y2, x3, y3 = columns
    xx = x1 * x1 + x2 * x2 + x3 * x3
    xy = x1 * y1 + x2 * y2 + x3 * y3
    yy = y1 * y1 + y2 * y2 + y3 * y3
    det = xx * yy - xy * xy
    if det == 0.0:
        return nan, nan, nan
    x, y = wanted
    p, q = (yy * x - xy * y) / det, (xx * y - xy * x) / det
    return x1 * p + y1 * q, x2 * p + y2 * q, x3 * p + y3 * q


@scalar
def null_space_input(columns: tuple[float, ...]) -> Triple:
    """The direction of the inputs that the outputs do not feel: the null space of ``Delta``."""
    x1, y1, x2, y2, x3, y3 = columns
    return x2 * y3 - x3 * y2, x3 * y1 - x1 * y3, x1 * y2 - x2 * y1


@scalar
def restoring_inputs(lean: float, rate: float, columns: tuple[float, ...], car: TiltCar) -> Triple:
    """Inputs without effect on the outputs that shrink the lean at a rate (1/s).

    The lean is the angle from the thrusts' middle to the acceleration. Zero where a rotor rests:
    no silent input turns the middle then.
    """
    n1, n2, n3 = null_space_input(columns)
    if n3 == 0.0:
        return 0.0, 0.0, 0.0
    scale = rate * lean / (turn_per_tilt(car) * n3)
    return scale * n1, scale * n2, scale * n3


@scalar
def wanted_jerk(time: float, state: State, parameters: Parameters) -> Pair:
    """The third derivative of the position (m/s^3, world) to ask for; Eq. (14)."""
    x, y, vx, vy, yaw, alpha, speed_1, speed_2 = state
    car, gains = parameters.car, parameters.gains
    reference = reference_derivatives(time, parameters.reference)
    along, across = body_acceleration(speed_1 * speed_1, speed_2 * speed_2, car)
    ax, ay = turned(along, across, yaw + alpha)
    k1, k2, k3 = gains.acceleration, gains.velocity, gains.position
    return (
        reference[9]
        + k1 * (reference[6] - ax)
        + k2 * (reference[3] - vx)
        + k3 * (reference[0] - x),
        reference[10]
        + k1 * (reference[7] - ay)
        + k2 * (reference[4] - vy)
        + k3 * (reference[1] - y),
    )


@scalar
def third_derivative_inputs(time: float, state: State, parameters: Parameters) -> Triple:
    """Rates of the rotor speeds (rad/s^2) and of the tilt angle (rad/s); Eq. (14)."""
    car = parameters.car
    jerk_x, jerk_y = wanted_jerk(time, state, parameters)
    wanted = turned(jerk_x, jerk_y, -(state[4] + state[5]))
    columns = input_columns(state[6], state[7], car)
    rate_1, rate_2, tilt_rate = minimum_norm(columns, wanted)
    if parameters.restoring_rate == 0.0:
        return rate_1, rate_2, tilt_rate
    along, across = body_acceleration(state[6] * state[6], state[7] * state[7], car)
    extra = restoring_inputs(atan2(across, along), parameters.restoring_rate, columns, car)
    return rate_1 + extra[0], rate_2 + extra[1], tilt_rate + extra[2]
