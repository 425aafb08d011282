"""What the loops around the tilt-car share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from controllers.references import ReferenceParameters, reference_derivatives
from controllers.scalar import Pair, scalar
from controllers.tilt_car.vehicle import TiltCar
from tiltsim.loop import Floats, Watched

if TYPE_CHECKING:
    from tiltsim.scenario import Scenario

CarState = tuple[float, float, float, float, float, float, float, float]

REFERENCE_COLUMNS: Final = ("x_ref", "y_ref", "vx_ref", "vy_ref")


@scalar
def running_speed(speed: float) -> float:
    """A rotor speed (rad/s) that an integrator's stage may have carried below zero."""
    return 0.0 if speed < 0.0 else speed


@scalar
def car_state(
    qpos: Sequence[float], qvel: Sequence[float], speed_1: float, speed_2: float
) -> CarState:
    """The laws' state (`controllers.tilt_car.vehicle.STATE_FIELDS`) from MuJoCo's."""
    return (
        *(qpos[0], qpos[1], qvel[0], qvel[1], qpos[2], qpos[3]),
        *(running_speed(speed_1), running_speed(speed_2)),
    )


@scalar
def speed_squares(act: Sequence[float]) -> Pair:
    """Controls of the thrust actuators, the squares of the rotor speeds."""
    speed_1, speed_2 = running_speed(act[0]), running_speed(act[1])
    return speed_1 * speed_1, speed_2 * speed_2


def reference_columns(samples: Mapping[str, Floats], reference: ReferenceParameters) -> Floats:
    """The reference and its derivatives at the samples' times, shape (15, N)."""
    time = samples["time"]
    rows = [reference_derivatives(t, reference) for t in time.tolist()]
    return np.array(rows).reshape(len(time), 15).T


def derived_columns(
    samples: Mapping[str, Floats], reference: Floats, wanted: tuple[Floats, Floats], car: TiltCar
) -> dict[str, Floats]:
    """Reference, directions and the split of the inputs.

    ``reference`` are `reference_columns`, ``wanted`` the acceleration whose direction the thrusts
    are to bracket.
    """
    direction = samples["yaw"] + samples["alpha"]
    away = np.arctan2(wanted[1], wanted[0]) - direction
    return {
        **dict(zip(REFERENCE_COLUMNS, reference[[0, 1, 3, 4]], strict=True)),
        "direction": direction,
        "direction_lower": direction - car.half_angle,
        "direction_upper": direction + car.half_angle,
        "direction_ref": direction + np.arctan2(np.sin(away), np.cos(away)),
        "input_split": samples["rotor_speed_1"] ** 2 - samples["rotor_speed_2"] ** 2,
    }


def rotors_at_rest(sample: Mapping[str, float]) -> tuple[Watched, ...]:
    """Both rotors' squares: the inputs' matrix loses its rank where both are at rest."""
    squares = sample["rotor_speed_1"] ** 2 + sample["rotor_speed_2"] ** 2
    return (Watched(squares, "the decoupling matrix became singular: both rotors came to rest"),)


@scalar
def squares_of_speeds(values: Sequence[float], parameters: object) -> tuple[float]:
    """What `rotors_at_rest` watches, from what a loop around the car observes."""
    return (values[8] * values[8] + values[9] * values[9],)


def initial_rotor_speeds(scenario: Scenario) -> tuple[float, float]:
    """The rotor speeds (rad/s) at time zero."""
    speed_1, speed_2 = scenario.initial.rotor_speeds(2)
    return speed_1, speed_2


def initial_heading(scenario: Scenario) -> float:
    """Yaw (rad) at zero tilt."""
    return float(scenario.initial.attitude[2])
