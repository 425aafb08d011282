"""Fourth-derivative feedback linearization of the tilt-car (ch. 10, Sec. 6.1).

The inputs are the second derivatives of both rotor speeds and of the tilt angle; their first
derivatives are states of the law. As printed, the tilt's column of the decoupling matrix (Eq. 27)
lacks the factor ``1 - I_T / I_B``, for the yaw answers the tilt's acceleration, too: `PUBLISHED`
leaves it out, `EXACT` puts it in.

The rotor speeds that the law integrates may drift below zero, where no thrust follows them. As the
chapter's run, the law then goes on with speeds that no rotor has (windup), and fails; with
``anti_windup`` they stop at zero, and the other rotor and the tilt go on alone.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from tiltsim_controllers.mathematics.scalar import Pair, Quad, Triple, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.tilt_car.third_derivative import input_columns, minimum_norm
from tiltsim_controllers.tilt_car.vehicle import (
    STATE_FIELDS,
    TiltCar,
    body_acceleration,
    turn_per_tilt,
    turned,
)

State = tuple[float, ...]

EXTENDED_STATE_FIELDS: Final = (
    *STATE_FIELDS,
    *("alpha_rate", "rotor_acceleration_1", "rotor_acceleration_2"),  # 8-10: rad/s, rad/s^2
)
"""The state of the car and the law's own first derivatives."""

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
    """All that the law needs to know besides time and state."""

    car: TiltCar
    gains: Gains
    reference: ReferenceParameters
    decoupling: float
    anti_windup: float  # 1 or 0: whether the law's rotor speeds stop at zero


GAIN_SETS: Final = {
    # Ours, all four poles at -3: the thesis prints none.
    "ch10": Gains(12.0, 54.0, 108.0, 81.0),
}
"""Gains by name."""


@scalar
def body_derivatives(state: State, car: TiltCar) -> tuple[float, ...]:
    """Acceleration, jerk and drift ``M_P``, two floats each, seen from the thrusts' middle.

    Eq. (21) without its terms in the second derivatives of the inputs, written with the turn rate
    of the middle, ``(1 - I_T / I_B) alpha'``, for the products of ``J_psi`` and ``J_alpha``.
    """
    speed_1, speed_2, tilt_rate, rate_1, rate_2 = state[6:11]
    turn = turn_per_tilt(car) * tilt_rate
    along, across = body_acceleration(speed_1 * speed_1, speed_2 * speed_2, car)
    along_1, across_1 = body_acceleration(2.0 * speed_1 * rate_1, 2.0 * speed_2 * rate_2, car)
    along_2, across_2 = body_acceleration(2.0 * rate_1 * rate_1, 2.0 * rate_2 * rate_2, car)
    return (
        *(along, across),
        *(along_1 - turn * across, across_1 + turn * along),
        along_2 - turn * turn * along - 2.0 * turn * across_1,
        across_2 - turn * turn * across + 2.0 * turn * along_1,
    )


@scalar
def wanted_snap(time: float, state: State, derivatives: Quad, parameters: Parameters) -> Pair:
    """The fourth derivative of the position (m/s^4, world) to ask for.

    ``derivatives`` are the present acceleration and jerk, world axes.
    """
    gains = parameters.gains
    k1, k2, k3, k4 = gains.jerk, gains.acceleration, gains.velocity, gains.position
    ax, ay, jx, jy = derivatives
    reference = reference_derivatives(time, parameters.reference)
    return (
        reference[12]
        + k1 * (reference[9] - jx)
        + k2 * (reference[6] - ax)
        + k3 * (reference[3] - state[2])
        + k4 * (reference[0] - state[0]),
        reference[13]
        + k1 * (reference[10] - jy)
        + k2 * (reference[7] - ay)
        + k3 * (reference[4] - state[3])
        + k4 * (reference[1] - state[1]),
    )


@scalar
def fourth_derivative_inputs(time: float, state: State, parameters: Parameters) -> Triple:
    """Second derivatives of the rotor speeds (rad/s^3) and of the tilt angle (rad/s^2); Eq. (29).

    ``state`` holds `EXTENDED_STATE_FIELDS`.
    """
    car = parameters.car
    direction = state[4] + state[5]
    along, across, jerk_along, jerk_across, drift_along, drift_across = body_derivatives(state, car)
    ax, ay = turned(along, across, direction)
    jx, jy = turned(jerk_along, jerk_across, direction)
    snap_x, snap_y = wanted_snap(time, state, (ax, ay, jx, jy), parameters)
    snap_along, snap_across = turned(snap_x, snap_y, -direction)
    x1, y1, x2, y2, x3, y3 = input_columns(state[6], state[7], car)
    if parameters.decoupling == PUBLISHED:
        x3, y3 = -across, along
    wanted = (snap_along - drift_along, snap_across - drift_across)
    return minimum_norm((x1, y1, x2, y2, x3, y3), wanted)
