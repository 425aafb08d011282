"""Conversions between a vehicle's quantities and the environment's arrays with their bounds."""

from __future__ import annotations

from math import pi
from typing import Final

import numpy as np
import numpy.typing as npt
from dm_env import specs

from tiltsim.plants.command import Observation
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.scalar import Floats

THRUST_TO_WEIGHT: Final = 2.0
"""Weights that the maximum thrusts lift, where the scenario has no `max_rotor_speed`."""

TILT_RANGE: Final = pi / 2
"""Tilt angles to either side (rad), where the scenario has no `tilt_servo.max_angle`."""

BOUNDS: Final = {
    "position": 1e4,  # m
    "velocity": 1e4,  # m/s
    "attitude": pi,
    "quaternion": 1.0,
    "body_rates": 1e4,  # rad/s
    "tilt_angles": 1e3,  # rad: a pod without a stop may make full turns
    "tilt_rates": 1e5,  # rad/s
    "rotor_speeds": 1e5,  # rad/s
    "reference_position": 1e6,
    "reference_velocity": 1e6,
    "reference_attitude": pi,
}
"""Observations by name and their largest absolute value, wider than any episode reaches."""

_WIDTHS: Final = {"quaternion": 4, "tilt_angles": 4, "tilt_rates": 4, "rotor_speeds": 4}
_TILT_OBSERVATIONS: Final = ("tilt_angles", "tilt_rates")


def has_tilts(scenario: Scenario) -> bool:
    """Whether the scenario's vehicle has tilt servos."""
    return scenario.vehicle.has_tilting_rotors


def action_spec(scenario: Scenario) -> specs.BoundedArray:
    """Shape and bounds of an action: four thrusts (N), then four tilt angles (rad) if any."""
    table = scenario.rotorcraft
    vehicle = table.resolve()
    fastest = table.max_rotor_speed
    highest = THRUST_TO_WEIGHT * vehicle.mass * vehicle.gravity / 4.0
    if fastest is not None:
        highest = vehicle.thrust_coefficient * fastest**2
    lowest = vehicle.thrust_coefficient * (table.min_rotor_speed or 0.0) ** 2
    low, high, name = [lowest] * 4, [highest] * 4, "thrusts"
    if has_tilts(scenario):
        tilt = table.tilt_servo.max_angle or TILT_RANGE
        low, high, name = [*low, *[-tilt] * 4], [*high, *[tilt] * 4], "thrusts, tilt_angles"
    return specs.BoundedArray((len(low),), np.float64, low, high, name)


def observation_spec(scenario: Scenario) -> dict[str, specs.BoundedArray]:
    """Shape and bounds of every array of an observation, by name."""
    return {
        name: specs.BoundedArray((_WIDTHS.get(name, 3),), np.float64, -bound, bound, name)
        for name, bound in BOUNDS.items()
        if has_tilts(scenario) or name not in _TILT_OBSERVATIONS
    }


def clip_action(action: npt.ArrayLike, spec: specs.BoundedArray) -> Floats:
    """An action within its bounds. Raises ValueError for a wrong shape or a non-finite entry."""
    array = np.asarray(action, dtype=np.float64)
    if array.shape != spec.shape:
        raise ValueError(f"action of shape {array.shape}; expected {spec.shape} ({spec.name})")
    if not np.isfinite(array).all():
        index = int(np.flatnonzero(~np.isfinite(array))[0])
        raise ValueError(f"action[{index}] = {array[index]}: must be finite")
    return np.asarray(np.minimum(np.maximum(array, spec.minimum), spec.maximum))


def observation_arrays(observation: Observation, *, tilting: bool) -> dict[str, Floats]:
    """A controller's observation as a flat dict of arrays within `BOUNDS`."""
    return {
        name: np.minimum(np.maximum(_array(observation, name), -bound), bound)
        for name, bound in BOUNDS.items()
        if tilting or name not in _TILT_OBSERVATIONS
    }


def _array(observation: Observation, name: str) -> Floats:
    prefix = "reference_"
    if name.startswith(prefix):
        array: Floats = getattr(observation.reference, name.removeprefix(prefix))
    else:
        array = getattr(observation, name)
    return array
