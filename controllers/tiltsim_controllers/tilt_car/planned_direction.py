"""Control of the tilt-car with the direction of its thrusts planned (ch. 10, Sec. 5; ch. 11).

The gait moves the tilt, the controller sets the squares of both rotor speeds: two inputs for two
outputs, so that no state drifts. A thrust cannot pull, so negative squares become zero (ch. 11,
Eq. 13), which ch. 11 writes with the switch matrix ``S_pq``.
"""

from typing import Any, ClassVar, Final, Literal

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.gaits.motion import GaitParameters
from tiltsim_controllers.laws.keys import (
    Gains2,
    GainSets,
    Keys,
    NamedGains,
    default,
    record_of,
    required,
)
from tiltsim_controllers.references.trajectories import ReferenceParameters, reference_motion
from tiltsim_controllers.tilt_car.vehicle import TiltCar, rotation, squared_speeds


class PlannedDirectionGainTable(Keys):
    """Explicit gains of the planned-direction law."""

    x: Gains2 = required(
        "K_X1, K_X2, on the errors of velocity and position along x [1/s, 1/s^2]", [12.0, 6.0]
    )
    y: Gains2 = required(
        "K_Y1, K_Y2, on the errors of velocity and position along y [1/s, 1/s^2]", [9.0, 18.0]
    )


Gains = record_of(PlannedDirectionGainTable)

GAIN_SETS: Final = {
    # Ours, both poles at -2: ch. 10 prints none.
    "ch10": Gains((4.0, 4.0), (4.0, 4.0)),
    # ch. 11, Sec. 4.2
    "ch11": Gains((12.0, 6.0), (9.0, 18.0)),
}
"""Gains by name."""


class PlannedDirection(Keys):
    """Keys of `planned_direction_inputs`."""

    gain_sets: ClassVar[GainSets] = {"gains": GAIN_SETS}

    law: Literal["tilt_car_planned_direction"] = required(
        "the tilt-car's rotor speeds control x and y; the tilt follows the gait"
    )
    gains: NamedGains[Literal["ch10", "ch11"], PlannedDirectionGainTable] = default(
        "ch11", "ch11 is the thesis's set, ch10 has its poles at -2; or a table of gains"
    )


Parameters = record_of(
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
