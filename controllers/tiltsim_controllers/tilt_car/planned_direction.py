"""Control of the tilt-car with the direction of its thrusts planned (ch. 10, Sec. 5; ch. 11).

The gait moves the tilt, the controller sets the squares of both rotor speeds: as many inputs as
outputs, so that no state drifts. A thrust cannot pull, so negative squares become zero (ch. 11,
Eq. 13), which ch. 11 writes with the switch matrix ``S_pq``.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from tiltsim_controllers.mathematics.scalar import Pair, Values, scalar
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_derivatives
from tiltsim_controllers.tilt_car.vehicle import TiltCar, rotate, squared_speeds


class Gains(NamedTuple):
    """Gains of both axes, on velocity and on position."""

    x_velocity: float  # [K_X1] 1/s
    x_position: float  # [K_X2] 1/s^2
    y_velocity: float  # [K_Y1] 1/s
    y_position: float  # [K_Y2] 1/s^2


class Parameters(NamedTuple):
    """Parameters of the controller."""

    car: TiltCar
    gains: Gains
    reference: ReferenceParameters


GAIN_SETS: Final = {
    # Ours, both poles at -2: ch. 10 prints none.
    "ch10": Gains(4.0, 4.0, 4.0, 4.0),
    # ch. 11, Sec. 4.2
    "ch11": Gains(12.0, 6.0, 9.0, 18.0),
}
"""Gains by name."""


@scalar
def demanded_acceleration(time: float, state: Values, parameters: Parameters) -> Pair:
    """The desired acceleration (m/s^2, world); ch. 10, Eq. (20) and ch. 11, Eqs. (9), (10)."""
    gains = parameters.gains
    x, y, vx, vy = state[:4]
    x0, y0, _, x1, y1, _, x2, y2, _ = reference_derivatives(time, parameters.reference)[:9]
    return (
        x2 + gains.x_velocity * (x1 - vx) + gains.x_position * (x0 - x),
        y2 + gains.y_velocity * (y1 - vy) + gains.y_position * (y0 - y),
    )


@scalar
def demanded_squared_speeds(time: float, state: Values, parameters: Parameters) -> Pair:
    """The desired squares of the rotor speeds (rad^2/s^2), of any sign; ch. 11, Eq. (12)."""
    x, y = demanded_acceleration(time, state, parameters)
    yaw, alpha = state[4:6]
    along, across = rotate(x, y, -(yaw + alpha))
    return squared_speeds(along, across, parameters.car)


@scalar
def planned_direction_inputs(time: float, state: Values, parameters: Parameters) -> Pair:
    """The squares of the rotor speeds (rad^2/s^2), never below zero; ch. 11, Eqs. (12), (13)."""
    square_1, square_2 = demanded_squared_speeds(time, state, parameters)
    # Written so that NaN stays NaN.
    return (0.0 if square_1 < 0.0 else square_1, 0.0 if square_2 < 0.0 else square_2)


def lyapunov_candidate(error_y: float, error_rate_y: float, gains: Gains) -> float:
    """Ch. 11's candidate ``L = e_y'^2 / 2 + K_Y2 e_y^2 / 2`` (Eq. 49), m^2/s^2."""
    return 0.5 * error_rate_y * error_rate_y + 0.5 * gains.y_position * error_y * error_y
