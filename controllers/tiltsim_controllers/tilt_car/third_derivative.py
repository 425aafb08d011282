"""Third-derivative feedback linearization of the tilt-car (ch. 10, Sec. 3.1).

Three inputs, the rates of both rotor speeds and of the tilt angle, determine two outputs, the third
derivatives of the position. The controller takes the shortest of all solutions (`minimum_norm`,
Eq. 12), which makes its states drift (`tiltsim_controllers.tilt_car.cycles`). Optionally a
restoring rate in the null space turns the thrusts' bisector back toward the acceleration.
"""

from __future__ import annotations

from typing import Any, ClassVar, Final, Literal

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.keys import (
    GainSets,
    Keys,
    NamedGains,
    NonNegative,
    Vector3,
    default,
    record_of,
    required,
)
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion
from tiltsim_controllers.tilt_car.vehicle import (
    TiltCar,
    input_matrix,
    rotation,
    thrust_map,
    turn_per_tilt,
)

GAIN_SETS: Final = {
    # Ours, all three poles at -2: the thesis prints none.
    "ch10": (6.0, 12.0, 8.0)
}
"""Gains by name: k_1 to k_3, the same for both axes."""


class ThirdDerivative(Keys):
    """Keys of `third_derivative_inputs`."""

    gain_sets: ClassVar[GainSets] = {"gains": GAIN_SETS}

    law: Literal["tilt_car_third_derivative"] = required(
        "the tilt-car's rotor speeds and tilt control the third derivative of x and y"
    )
    gains: NamedGains[Literal["ch10"], Vector3] = default(
        "ch10",
        "poles at -2, or three gains on the errors of acceleration, velocity and position [1/s, "
        "1/s^2, 1/s^3]",
        [6.0, 12.0, 8.0],
    )
    restoring_rate: NonNegative = default(
        0.0,
        "rate of turning the mean thrust direction toward the acceleration; 0 as published [1/s]",
        1.0,
    )


Parameters = record_of(ThirdDerivative, car=TiltCar, reference=ReferenceParameters)


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


def third_derivative_inputs(time: Any, state: Any, p: Any) -> Any:
    """Rates of the rotor speeds (rad/s^2) and of the tilt angle (rad/s), shape (3,); Eq. (14).

    Args:
        time: s
        state: `tiltsim_controllers.tilt_car.vehicle.STATE_FIELDS`, shape (8,).
        p: `Parameters`.
    """
    car, (k1, k2, k3) = p.car, p.gains
    yaw, alpha, speeds = state[4], state[5], state[6:8]
    position, velocity, acceleration, jerk = reference_motion(time, p.reference)[:4, :2]
    to_world, pushed = rotation(yaw + alpha), thrust_map(car) @ (speeds * speeds)
    demanded = (
        jerk
        + k1 * (acceleration - to_world @ pushed)
        + k2 * (velocity - state[2:4])
        + k3 * (position - state[0:2])
    )
    matrix = input_matrix(speeds, car)
    lean = xp.arctan2(pushed[1], pushed[0])
    restoring = restoring_inputs(lean, p.restoring_rate, matrix, car)
    return minimum_norm(matrix, to_world.T @ demanded) + restoring
