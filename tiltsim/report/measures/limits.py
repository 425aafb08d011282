"""Torques, thrusts and accelerations under rotor limits (ch. 9)."""

from typing import Final

import numpy as np

from tiltsim_controllers.analysis.attainable import (
    AttainableSet,
    attainable_accelerations,
    attainable_torque_thrust,
    published_speed_limits,
)
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS
from tiltsim_controllers.analysis.singularity import rank
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]
_LIMITS: Final = published_speed_limits(_VEHICLE)


def weight() -> float:
    """Mass times gravity, N."""
    return _VEHICLE.mass * _VEHICLE.gravity


def centripetal(speeds: list[float]) -> tuple[float, ...]:
    """Accelerations (m/s^2) on the circle of 5 m at angular frequencies (rad/s)."""
    return tuple(5.0 * speed**2 for speed in speeds)


def _angles(number: int, *, exact: bool = False) -> list[float]:
    published = PUBLISHED_GAITS[f"ch09_gait_{number}"]
    gait = (published.exact or published.gait) if exact else published.gait
    return [float(angle) for angle in gait.angles(np.array([0.0]))[0]]


def _torques(number: int, thrust: float | None = None, *, exact: bool = False) -> AttainableSet:
    angles = _angles(number, exact=exact)
    return attainable_torque_thrust(angles, _VEHICLE, _LIMITS, vertical_thrust=thrust)


def has_solution(number: int, thrust: float | None = None) -> bool:
    """Whether a gait has torques and thrusts without yaw torque, at a vertical thrust (N)."""
    return not _torques(number, thrust).is_empty


def largest_thrust(number: int) -> float:
    """The largest vertical thrust of a gait without yaw torque, N."""
    return float(_torques(number).upper[2])


def torques_are_coupled(number: int) -> bool:
    """Whether for one thrust in the middle the torques on the exact lines are on a line."""
    thrusts = _torques(number, exact=True)
    middle = 0.5 * float(thrusts.lower[2] + thrusts.upper[2])
    return _torques(number, middle, exact=True).dimension <= 1


def has_full_rank(number: int, exact: bool) -> bool:
    """Whether the torque matrix of a gait, on the exact lines or as printed, has rank 3."""
    return bool(rank(_angles(number, exact=exact), _VEHICLE) == 3)


def accelerations(number: int) -> tuple[float, ...]:
    """Attainable accelerations in body axes, m/s^2: least along x and y, largest along x and y."""
    reached = attainable_accelerations(_angles(number), _VEHICLE, _LIMITS)
    return (*reached.lower.tolist(), *reached.upper.tolist())


def accelerations_are_a_rectangle(number: int) -> bool:
    """Whether their set has four corners, with two values along each axis."""
    corners = attainable_accelerations(_angles(number), _VEHICLE, _LIMITS).vertices
    spans = [np.unique(np.round(axis, 9)) for axis in corners.T]
    return len(corners) == 4 and all(len(span) == 2 for span in spans)


def accelerations_are_equal(first: int, second: int) -> bool:
    """Whether two gaits reach the same accelerations, to six digits."""
    return bool(np.allclose(accelerations(first), accelerations(second), rtol=1e-6))
