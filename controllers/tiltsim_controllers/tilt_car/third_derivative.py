"""Third-derivative feedback linearization of the tilt-car (ch. 10, Sec. 3.1).

Three inputs, the rates of both rotor speeds and of the tilt angle, determine two outputs, the third
derivatives of the position. The controller takes the shortest of all solutions (`minimum_norm`, Eq.
12), which makes its states drift (`tiltsim_controllers.tilt_car.state_drift`). Optionally a
restoring rate in the null space turns the thrusts' bisector back toward the acceleration.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion
from tiltsim_controllers.tilt_car.vehicle import (
    TiltCar,
    input_matrix,
    rotation,
    thrust_map,
    turn_per_tilt,
)


class Gains(NamedTuple):
    """Gains on acceleration, velocity and position, equal for both axes."""

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


def minimum_norm(matrix: Any, desired: Any) -> Any:
    """The shortest inputs for the desired outputs, ``Delta^T (Delta Delta^T)^-1`` (Eq. 12).

    NaN where the matrix is rank-deficient: with both rotors at rest. With one rotor at rest it is
    not, contrary to ch. 10: the tilt turns the other thrust.

    Args:
        matrix: `input_matrix`, shape (2, 3).
        desired: Shape (2,).
    """
    (xx, xy), (_, yy) = gram = matrix @ matrix.T
    determinant = xx * yy - xy * xy
    adjugate = xp.array([[yy, -xy], [-xy, gram[0, 0]]])
    shares = adjugate @ desired / xp.where(determinant == 0.0, xp.nan, determinant)
    return matrix.T @ shares


def null_space_input(matrix: Any) -> Any:
    """The direction of inputs without effect on the outputs: the null space of ``Delta``, (3,)."""
    (x1, x2, x3), (y1, y2, y3) = matrix
    return xp.array([x2 * y3 - x3 * y2, x3 * y1 - x1 * y3, x1 * y2 - x2 * y1])


def restoring_inputs(lean: Any, rate: Any, matrix: Any, car: TiltCar) -> Any:
    """Inputs without effect on the outputs that reduce the lean, shape (3,).

    Zero where a rotor rests, as then no input in the null space turns the bisector.

    Args:
        lean: Angle from the thrusts' bisector to the acceleration, rad.
        rate: 1/s
        matrix: `input_matrix`
        car: The vehicle.
    """
    silent = null_space_input(matrix)
    turns = silent[2] != 0.0
    scale = rate * lean / (turn_per_tilt(car) * xp.where(turns, silent[2], 1.0))
    return xp.where(turns, scale, 0.0) * silent


def third_derivative_inputs(time: Any, state: Any, parameters: Parameters) -> Any:
    """Rates of the rotor speeds (rad/s^2) and of the tilt angle (rad/s), shape (3,); Eq. (14).

    Args:
        time: s
        state: `tiltsim_controllers.tilt_car.vehicle.STATE_FIELDS`, shape (8,).
        parameters: Parameters of the controller.
    """
    car, gains = parameters.car, parameters.gains
    yaw, alpha, speeds = state[4], state[5], state[6:8]
    position, velocity, acceleration, jerk = reference_motion(time, parameters.reference)[:4, :2]
    to_world, pushed = rotation(yaw + alpha), thrust_map(car) @ (speeds * speeds)
    demanded = (
        jerk
        + gains.acceleration * (acceleration - to_world @ pushed)
        + gains.velocity * (velocity - state[2:4])
        + gains.position * (position - state[0:2])
    )
    matrix = input_matrix(speeds, car)
    lean = xp.arctan2(pushed[1], pushed[0])
    restoring = restoring_inputs(lean, parameters.restoring_rate, matrix, car)
    return minimum_norm(matrix, to_world.T @ demanded) + restoring
