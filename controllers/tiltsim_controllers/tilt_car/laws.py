"""Control laws of the tilt-car (ch. 10, Secs. 3.1, 5 and 6.1; ch. 11).

**Third and fourth derivative.** The inputs, the first or second derivatives of both rotor speeds
and of the tilt angle, are three; they determine two outputs, the third or fourth derivatives of the
position. The controller takes the shortest of all solutions (`minimum_norm`, Eq. 12), which makes
its states drift (`tiltsim_controllers.tilt_car.cycles`). Optionally a restoring rate in the null
space turns the thrusts' bisector back toward the acceleration.

The first derivatives of the inputs are states of the controller of the fourth derivative. As
printed, the tilt's column of its decoupling matrix (Eq. 27) lacks the factor ``1 - I_T / I_B`` due
to the counter-rotation, which the ``decoupling`` ``exact`` includes. The rotor speeds that it
integrates may drift below zero, where no thrust follows them. The controller then continues, as in
the chapter, with speeds that no rotor has (windup), and fails; with ``anti_windup`` they stop at
zero, and the other rotor and the tilt continue alone.

**Planned direction.** The gait moves the tilt, the controller sets the squares of both rotor
speeds: two inputs for two outputs, so that no state drifts. A thrust cannot pull, so negative
squares become zero (ch. 11, Eq. 13), which ch. 11 writes with the switch matrix ``S_pq``.
"""

from collections.abc import Sequence
from typing import Any, ClassVar, Final, Literal

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.gaits.motion import GaitParameters
from tiltsim_controllers.laws.feedback import error_dynamics
from tiltsim_controllers.laws.keys import (
    Gains2,
    Gains4,
    GainSets,
    Keys,
    NamedGains,
    NonNegative,
    Vector3,
    choice,
    default,
    record_of,
    required,
)
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion
from tiltsim_controllers.tilt_car.vehicle import (
    TiltCar,
    input_matrix,
    rotation,
    squared_speeds,
    thrust_map,
    turn_per_tilt,
)

THIRD_GAINS: Final = {"ch10": (6.0, 12.0, 8.0)}
"""Gains of the third-derivative law by name, the same for both axes.

Ours, all poles at -2: the thesis prints none.
"""

FOURTH_GAINS: Final = {"ch10": (12.0, 54.0, 108.0, 81.0)}
"""Likewise of the fourth-derivative law, all poles at -3."""


class ThirdDerivative(Keys):
    """Keys of `third_derivative_inputs`."""

    gain_sets: ClassVar[GainSets] = {"gains": THIRD_GAINS}

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


class FourthDerivative(Keys):
    """Keys of `fourth_derivative_inputs`."""

    gain_sets: ClassVar[GainSets] = {"gains": FOURTH_GAINS}

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


ThirdParameters = record_of(ThirdDerivative, vehicle=TiltCar, reference=ReferenceParameters)
FourthParameters = record_of(FourthDerivative, vehicle=TiltCar, reference=ReferenceParameters)

PUBLISHED: Final = choice(FourthDerivative, "decoupling", "published")


def minimum_norm(matrix: Any, desired: Any) -> Any:
    """The shortest inputs for the desired outputs (2,), ``Delta^T (Delta Delta^T)^-1`` (Eq. 12).

    NaN where `input_matrix` is rank-deficient: with both rotors at rest. With one rotor at rest it
    is not, contrary to ch. 10: the tilt turns the other thrust.
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


def body_derivatives(state: Any, car: TiltCar) -> Any:
    """Acceleration, jerk and drift ``M_P`` in the frame of the thrusts' bisector, shape (3, 2).

    Eq. (21) without its terms in the second derivatives of the inputs, written with the turn rate
    of the bisector, ``(1 - I_T / I_B) alpha'``, for the products of ``J_psi`` and ``J_alpha``. The
    state has `tiltsim_controllers.tilt_car.vehicle.STATE_FIELDS`, then the controller's own tilt
    rate (rad/s) and rotor accelerations (rad/s^2), shape (11,).
    """
    speeds, tilt_rate, rates = state[6:8], state[8], state[9:11]
    turn = turn_per_tilt(car) * tilt_rate * xp.array([[0.0, -1.0], [1.0, 0.0]])
    pushed, push_rate, push_curve = (
        thrust_map(car) @ squares
        for squares in (speeds * speeds, 2.0 * speeds * rates, 2.0 * rates * rates)
    )
    drift = push_curve + turn @ (turn @ pushed) + 2.0 * (turn @ push_rate)
    return xp.array([pushed, push_rate + turn @ pushed, drift])


def _demanded(time: Any, state: Any, p: Any, derivatives: Sequence[Any]) -> Any:
    """The demanded derivative of the position after the present ones, along the bisector, (2,).

    ``derivatives`` are the acceleration and any higher ones, along the bisector, m and s.
    """
    to_world = rotation(state[4] + state[5])
    present = (state[0:2], state[2:4], *(to_world @ own for own in derivatives))
    reference = reference_motion(time, p.reference)[: len(present) + 1, :2]
    return to_world.T @ error_dynamics(reference, present, p.gains)


def third_derivative_inputs(time: Any, state: Any, p: Any) -> Any:
    """Rates of the rotor speeds (rad/s^2) and of the tilt angle (rad/s), shape (3,); Eq. (14).

    The state has `tiltsim_controllers.tilt_car.vehicle.STATE_FIELDS`, shape (8,).
    """
    speeds, matrix = state[6:8], input_matrix(state[6:8], p.vehicle)
    pushed = thrust_map(p.vehicle) @ (speeds * speeds)
    lean = xp.arctan2(pushed[1], pushed[0])
    restoring = restoring_inputs(lean, p.restoring_rate, matrix, p.vehicle)
    return minimum_norm(matrix, _demanded(time, state, p, [pushed])) + restoring


def fourth_derivative_inputs(time: Any, state: Any, p: Any) -> Any:
    """Second derivatives of rotor speeds (rad/s^3) and tilt angle (rad/s^2), (3,); Eq. (29).

    The state is as for `body_derivatives`.
    """
    pushed, moved, drift = body_derivatives(state, p.vehicle)
    matrix = input_matrix(state[6:8], p.vehicle)
    if p.decoupling == PUBLISHED:
        matrix = xp.hstack([matrix[:, :2], xp.array([[-pushed[1]], [pushed[0]]])])
    return minimum_norm(matrix, _demanded(time, state, p, [pushed, moved]) - drift)


class PlannedDirectionGainTable(Keys):
    """Explicit gains of the planned-direction law."""

    x: Gains2 = required(
        "K_X1, K_X2, on the errors of velocity and position along x [1/s, 1/s^2]", [12.0, 6.0]
    )
    y: Gains2 = required(
        "K_Y1, K_Y2, on the errors of velocity and position along y [1/s, 1/s^2]", [9.0, 18.0]
    )


PlannedGains = record_of(PlannedDirectionGainTable)

PLANNED_GAINS: Final = {
    # Ours, both poles at -2: ch. 10 prints none.
    "ch10": PlannedGains((4.0, 4.0), (4.0, 4.0)),
    # ch. 11, Sec. 4.2
    "ch11": PlannedGains((12.0, 6.0), (9.0, 18.0)),
}
"""Gains of the law with planned direction by name."""


class PlannedDirection(Keys):
    """Keys of `planned_direction_inputs`."""

    gain_sets: ClassVar[GainSets] = {"gains": PLANNED_GAINS}

    law: Literal["tilt_car_planned_direction"] = required(
        "the tilt-car's rotor speeds control x and y; the tilt follows the gait"
    )
    gains: NamedGains[Literal["ch10", "ch11"], PlannedDirectionGainTable] = default(
        "ch11", "ch11 is the thesis's set, ch10 has its poles at -2; or a table of gains"
    )


PlannedParameters = record_of(
    PlannedDirection, vehicle=TiltCar, gait=GaitParameters, reference=ReferenceParameters
)


def demanded_acceleration(time: Any, state: Any, p: Any) -> Any:
    """The desired acceleration (m/s^2, world), (2,); ch. 10, Eq. (20); ch. 11, Eqs. (9), (10).

    The state begins with `tiltsim_controllers.tilt_car.vehicle.STATE_FIELDS`.
    """
    on_velocity, on_position = xp.array([p.gains.x, p.gains.y]).T
    position, velocity, acceleration = reference_motion(time, p.reference)[:3, :2]
    feedback = on_velocity * (velocity - state[2:4]) + on_position * (position - state[0:2])
    return acceleration + feedback


def demanded_squared_speeds(time: Any, state: Any, p: Any) -> Any:
    """The desired squares of the rotor speeds (rad^2/s^2), of any sign; ch. 11, Eq. (12).

    Arguments as for `demanded_acceleration`; shape (2,).
    """
    to_body = rotation(state[4] + state[5]).T
    return squared_speeds(to_body @ demanded_acceleration(time, state, p), p.vehicle)


def planned_direction_inputs(time: Any, state: Any, p: Any) -> Any:
    """The squares of the rotor speeds (rad^2/s^2), never below zero; ch. 11, Eqs. (12), (13)."""
    squares = demanded_squared_speeds(time, state, p)
    return xp.where(squares < 0.0, 0.0, squares)  # NaN stays NaN


def lyapunov_candidate(error_y: float, error_rate_y: float, gains: Any) -> float:
    """Ch. 11's candidate ``L = e_y'^2 / 2 + K_Y2 e_y^2 / 2`` (Eq. 49), m^2/s^2."""
    return 0.5 * error_rate_y * error_rate_y + 0.5 * gains.y[1] * error_y * error_y
