"""Control of the tilt-car with the direction of its thrusts planned (ch. 10, Sec. 5; ch. 11).

The gait moves the tilt, the controller sets the squares of both rotor speeds: inputs and outputs
are equal in number, so that no state drifts. A thrust cannot pull, so negative squares become zero
(ch. 11, Eq. 13), which ch. 11 writes with the switch matrix ``S_pq``.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion
from tiltsim_controllers.tilt_car.vehicle import TiltCar, rotation, squared_speeds


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


def demanded_acceleration(time: Any, state: Any, parameters: Parameters) -> Any:
    """The desired acceleration (m/s^2, world), ch. 10, Eq. (20); ch. 11, Eqs. (9), (10).

    Args:
        time: s
        state: Begins with `tiltsim_controllers.tilt_car.vehicle.STATE_FIELDS`.
        parameters: Parameters of the controller.

    Returns:
        Shape (2,).
    """
    gains = parameters.gains
    on_velocity = xp.array([gains.x_velocity, gains.y_velocity])
    on_position = xp.array([gains.x_position, gains.y_position])
    position, velocity, acceleration = reference_motion(time, parameters.reference)[:3, :2]
    feedback = on_velocity * (velocity - state[2:4]) + on_position * (position - state[0:2])
    return acceleration + feedback


def demanded_squared_speeds(time: Any, state: Any, parameters: Parameters) -> Any:
    """The desired squares of the rotor speeds (rad^2/s^2), of any sign; ch. 11, Eq. (12).

    Arguments as for `demanded_acceleration`; shape (2,).
    """
    to_body = rotation(state[4] + state[5]).T
    return squared_speeds(to_body @ demanded_acceleration(time, state, parameters), parameters.car)


def planned_direction_inputs(time: Any, state: Any, parameters: Parameters) -> Any:
    """The squares of the rotor speeds (rad^2/s^2), never below zero; ch. 11, Eqs. (12), (13)."""
    squares = demanded_squared_speeds(time, state, parameters)
    return xp.where(squares < 0.0, 0.0, squares)  # NaN stays NaN


def lyapunov_candidate(error_y: float, error_rate_y: float, gains: Gains) -> float:
    """Ch. 11's candidate ``L = e_y'^2 / 2 + K_Y2 e_y^2 / 2`` (Eq. 49), m^2/s^2."""
    return 0.5 * error_rate_y * error_rate_y + 0.5 * gains.y_position * error_y * error_y
