"""Fourth-derivative feedback linearization of the tilt-car (ch. 10, Sec. 6.1).

The inputs are the second derivatives of both rotor speeds and of the tilt angle; their first
derivatives are states of the controller. As printed, the tilt's column of the decoupling matrix
(Eq. 27) lacks the factor ``1 - I_T / I_B`` due to the counter-rotation, which the ``decoupling``
``exact`` includes.

The rotor speeds that the controller integrates may drift below zero, where no thrust follows them.
The controller then continues, as in the chapter, with speeds that no rotor has (windup), and fails;
with ``anti_windup`` they stop at zero, and the other rotor and the tilt continue alone.
"""

from __future__ import annotations

from typing import Any, ClassVar, Final, Literal

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.keys import (
    Gains4,
    GainSets,
    Keys,
    NamedGains,
    choice,
    default,
    record_of,
    required,
)
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion
from tiltsim_controllers.tilt_car.third_derivative import minimum_norm
from tiltsim_controllers.tilt_car.vehicle import (
    TiltCar,
    input_matrix,
    rotation,
    thrust_map,
    turn_per_tilt,
)

GAIN_SETS: Final = {
    # Ours, all four poles at -3: the thesis prints none.
    "ch10": (12.0, 54.0, 108.0, 81.0)
}
"""Gains by name, the same for both axes."""


class FourthDerivative(Keys):
    """Keys of `fourth_derivative_inputs`."""

    gain_sets: ClassVar[GainSets] = {"gains": GAIN_SETS}

    law: Literal["tilt_car_fourth_derivative"] = required(
        "the tilt-car's rotor speeds and tilt control the fourth derivative of x and y"
    )
    decoupling: Literal["published", "exact"] = default(
        "exact",
        "effect of the tilt in the decoupling matrix: as published, or with the yaw's reaction",
    )
    anti_windup: bool = default(False, "stop the rotor speeds that the law integrates at zero")
    gains: NamedGains[Literal["ch10"], Gains4] = default(
        "ch10",
        "poles at -3, or four gains on the errors of jerk, acceleration, velocity and position "
        "[1/s, 1/s^2, 1/s^3, 1/s^4]",
        [12.0, 54.0, 108.0, 81.0],
    )


Parameters = record_of(FourthDerivative, car=TiltCar, reference=ReferenceParameters)

PUBLISHED: Final = choice(FourthDerivative, "decoupling", "published")


def body_derivatives(state: Any, car: TiltCar) -> Any:
    """Acceleration, jerk and drift ``M_P`` in the frame of the thrusts' bisector, shape (3, 2).

    Eq. (21) without its terms in the second derivatives of the inputs, written with the turn rate
    of the bisector, ``(1 - I_T / I_B) alpha'``, for the products of ``J_psi`` and ``J_alpha``.

    Args:
        state: `tiltsim_controllers.tilt_car.vehicle.STATE_FIELDS`, then the controller's own tilt
            rate (rad/s) and rotor accelerations (rad/s^2), shape (11,).
        car: The vehicle.
    """
    speeds, tilt_rate, rates = state[6:8], state[8], state[9:11]
    turn = turn_per_tilt(car) * tilt_rate * xp.array([[0.0, -1.0], [1.0, 0.0]])
    pushed, push_rate, push_curve = (
        thrust_map(car) @ squares
        for squares in (speeds * speeds, 2.0 * speeds * rates, 2.0 * rates * rates)
    )
    drift = push_curve + turn @ (turn @ pushed) + 2.0 * (turn @ push_rate)
    return xp.array([pushed, push_rate + turn @ pushed, drift])


def fourth_derivative_inputs(time: Any, state: Any, p: Any) -> Any:
    """Second derivatives of the rotor speeds (rad/s^3) and of the tilt angle (rad/s^2); Eq. (29).

    Args:
        time: s
        state: See `body_derivatives`.
        p: `Parameters`.

    Returns:
        Shape (3,).
    """
    car, (k1, k2, k3, k4) = p.car, p.gains
    to_world = rotation(state[4] + state[5])
    pushed, moved, drift = body_derivatives(state, car)
    position, velocity, acceleration, jerk, snap = reference_motion(time, p.reference)[:, :2]
    demanded = (
        snap
        + k1 * (jerk - to_world @ moved)
        + k2 * (acceleration - to_world @ pushed)
        + k3 * (velocity - state[2:4])
        + k4 * (position - state[0:2])
    )
    matrix = input_matrix(state[6:8], car)
    if p.decoupling == PUBLISHED:
        matrix = xp.hstack([matrix[:, :2], xp.array([[-pushed[1]], [pushed[0]]])])
    return minimum_norm(matrix, to_world.T @ demanded - drift)
