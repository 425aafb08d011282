"""Fourth-derivative feedback linearization of the tilt-car (ch. 10, Sec. 6.1).

The inputs are the second derivatives of both rotor speeds and of the tilt angle; their first
derivatives are states of the controller. As printed, the tilt's column of the decoupling matrix
(Eq. 27) lacks the factor ``1 - I_T / I_B`` due to the counter-rotation: `PUBLISHED` omits it,
`EXACT` includes it.

The rotor speeds that the controller integrates may drift below zero, where no thrust follows them.
As in the chapter, the controller then continues with speeds that no rotor has (windup), and fails;
with ``anti_windup`` they stop at zero, and the other rotor and the tilt continue alone.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from tiltsim_controllers.mathematics.scalar import Pair, Quad, Triple, Values, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.tilt_car.third_derivative import input_columns, minimum_norm
from tiltsim_controllers.tilt_car.vehicle import (
    STATE_FIELDS,
    TiltCar,
    body_acceleration,
    rotate,
    turn_per_tilt,
)

SPEED_1: Final = STATE_FIELDS.index("rotor_speed_1")
DERIVATIVE_FIELDS: Final = ("alpha_rate", "rotor_acceleration_1", "rotor_acceleration_2")
EXTENDED_STATE_FIELDS: Final = (*STATE_FIELDS, *DERIVATIVE_FIELDS)
"""The state of the car and the controller's own first derivatives, rad/s and rad/s^2."""

PUBLISHED: Final = 0.0
EXACT: Final = 1.0
DECOUPLINGS: Final = {"published": PUBLISHED, "exact": EXACT}
"""Forms of the tilt's column by name."""


class Gains(NamedTuple):
    """Gains on jerk, acceleration, velocity and position, the same for both axes."""

    jerk: float  # 1/s
    acceleration: float  # 1/s^2
    velocity: float  # 1/s^3
    position: float  # 1/s^4


class Parameters(NamedTuple):
    """Parameters of the controller."""

    car: TiltCar
    gains: Gains
    reference: ReferenceParameters
    decoupling: float
    anti_windup: float  # 1 or 0: whether the controller's rotor speeds stop at zero


GAIN_SETS: Final = {
    # Ours, all four poles at -3: the thesis prints none.
    "ch10": Gains(12.0, 54.0, 108.0, 81.0)
}
"""Gains by name."""


@scalar
def body_derivatives(state: Values, car: TiltCar) -> Values:
    """Acceleration, jerk and drift ``M_P``, two floats each, in the frame of the thrusts' bisector.

    Eq. (21) without its terms in the second derivatives of the inputs, written with the turn rate
    of the bisector, ``(1 - I_T / I_B) alpha'``, for the products of ``J_psi`` and ``J_alpha``.
    """
    speed_1, speed_2, tilt_rate, rate_1, rate_2 = state[SPEED_1:]
    turn = turn_per_tilt(car) * tilt_rate
    along, across = body_acceleration(speed_1 * speed_1, speed_2 * speed_2, car)
    along_1, across_1 = body_acceleration(2.0 * speed_1 * rate_1, 2.0 * speed_2 * rate_2, car)
    along_2, across_2 = body_acceleration(2.0 * rate_1 * rate_1, 2.0 * rate_2 * rate_2, car)
    return (
        along,
        across,
        along_1 - turn * across,
        across_1 + turn * along,
        along_2 - turn * turn * along - 2.0 * turn * across_1,
        across_2 - turn * turn * across + 2.0 * turn * along_1,
    )


@scalar
def demanded_snap(time: float, state: Values, derivatives: Quad, parameters: Parameters) -> Pair:
    """The desired fourth derivative of the position (m/s^4, world).

    Args:
        time: s
        state: `EXTENDED_STATE_FIELDS`
        derivatives: present acceleration and jerk, two floats each, world
        parameters: of the controller
    """
    gains = parameters.gains
    k1, k2, k3, k4 = gains.jerk, gains.acceleration, gains.velocity, gains.position
    ax, ay, jx, jy = derivatives
    x, y, vx, vy = state[:4]
    motion = reference_derivatives(time, parameters.reference)
    x0, y0, _, x1, y1, _, x2, y2, _, x3, y3, _, x4, y4, _ = motion
    return (
        x4 + k1 * (x3 - jx) + k2 * (x2 - ax) + k3 * (x1 - vx) + k4 * (x0 - x),
        y4 + k1 * (y3 - jy) + k2 * (y2 - ay) + k3 * (y1 - vy) + k4 * (y0 - y),
    )


@scalar
def fourth_derivative_inputs(time: float, state: Values, parameters: Parameters) -> Triple:
    """Second derivatives of the rotor speeds (rad/s^3) and of the tilt angle (rad/s^2); Eq. (29).

    ``state`` is `EXTENDED_STATE_FIELDS`.
    """
    car = parameters.car
    yaw, alpha, speed_1, speed_2 = state[4:8]
    direction = yaw + alpha
    along, across, jerk_along, jerk_across, drift_along, drift_across = body_derivatives(state, car)
    ax, ay = rotate(along, across, direction)
    jx, jy = rotate(jerk_along, jerk_across, direction)
    snap_x, snap_y = demanded_snap(time, state, (ax, ay, jx, jy), parameters)
    snap_along, snap_across = rotate(snap_x, snap_y, -direction)
    x1, y1, x2, y2, x3, y3 = input_columns(speed_1, speed_2, car)
    if parameters.decoupling == PUBLISHED:
        x3, y3 = -across, along
    desired = (snap_along - drift_along, snap_across - drift_across)
    return minimum_norm((x1, y1, x2, y2, x3, y3), desired)
