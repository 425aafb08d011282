"""Conversions between a vehicle's quantities and the environment's arrays with their bounds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import pi
from operator import attrgetter
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from dm_env import specs

from tiltsim.errors import InputError
from tiltsim.models.rotor_table import Multirotor
from tiltsim.plants.command import Observation
from tiltsim.scenario.messages import choose
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.numbers import is_finite, real_array
from tiltsim.system.text import short_repr
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
"""Observations by default, and their largest absolute value, wider than any episode reaches."""

_TILT_OBSERVATIONS: Final = ("tilt_angles", "tilt_rates")

Rotation = npt.NDArray[np.float64]  # (3, 3), body to world; ``vector @ rotation`` is in body axes

Reader = Callable[[Observation, Rotation], Floats]


def _field(name: str) -> Reader:
    """The reader of a field of a controller's observation."""
    read = attrgetter(name.replace("reference_", "reference."))
    return lambda seen, _: read(seen)


OBSERVATIONS: Final[dict[str, Reader]] = {
    **{name: _field(name) for name in BOUNDS},
    "position_error_body": lambda seen, rotation: (
        (seen.reference.position - seen.position) @ rotation
    ),
    "velocity_error_body": lambda seen, rotation: (
        (seen.reference.velocity - seen.velocity) @ rotation
    ),
    "reference_acceleration_body": lambda seen, rotation: seen.reference.acceleration @ rotation,
    "contact_force_body": lambda seen, rotation: seen.contact_force @ rotation,
    "force_error_body": lambda seen, rotation: (
        (seen.reference.force - seen.contact_force) @ rotation
    ),
    "swing_body": lambda seen, rotation: np.append(seen.swing, 0.0) @ rotation,
    "up_body": lambda _, rotation: rotation[2],
}
"""All observations. Errors are reference minus actual; ``_body`` is along the body's axes."""


def action_spec(scenario: Scenario, max_tilt_angle: float | None = None) -> specs.BoundedArray:
    """Shape and bounds of an action: a thrust (N) by rotor, then a tilt angle (rad) by servo.

    ``max_tilt_angle`` (rad) narrows the tilt angles, whose bounds are otherwise the servos' or
    `TILT_RANGE`. Raises `InputError` if it is not above 0 or beyond them, or there are no tilts.
    """
    tilting = scenario.vehicle.has_tilting_rotors
    if max_tilt_angle is not None and not tilting:
        raise InputError("environment: max_tilt_angle: the vehicle has no tilt servos")
    table = scenario.any_rotorcraft
    vehicle, name = table.resolve(), "thrusts"
    coefficients = np.array(table.thrust_coefficients)
    share = THRUST_TO_WEIGHT * vehicle.mass * vehicle.gravity / table.rotor_count
    high = np.full(table.rotor_count, share)
    if table.max_rotor_speed is not None:
        high = coefficients * table.max_rotor_speed**2
    low = coefficients * (table.min_rotor_speed or 0.0) ** 2
    if isinstance(vehicle, Multirotor) and table.min_rotor_speed is None:
        reversing = [slowest < 0.0 < fastest for slowest, fastest in vehicle.speed_ranges]
        low = np.where(reversing, -high, low)
    if tilting:
        tilt = table.tilt_servo.max_angle or TILT_RANGE
        if max_tilt_angle is not None:
            check_bound("max_tilt_angle", max_tilt_angle, tilt)
            tilt = max_tilt_angle
        ends, name = np.full(table.tilt_count, tilt), "thrusts, tilt_angles"
        low, high = np.concatenate([low, -ends]), np.concatenate([high, ends])
    return specs.BoundedArray((len(low),), np.float64, low, high, name)


def clip_action(action: npt.ArrayLike, spec: specs.BoundedArray) -> Floats:
    """An action within its bounds.

    Raises ValueError for a wrong shape, a non-finite entry, or other entries than real numbers.
    """
    try:
        array = real_array(action)
    except TypeError as error:
        raise ValueError(f"action {error}: must be real numbers") from None
    if array.shape != spec.shape:
        raise ValueError(f"action of shape {array.shape}; expected {spec.shape} ({spec.name})")
    if not np.isfinite(array).all():
        index = int(np.flatnonzero(~np.isfinite(array))[0])
        raise ValueError(f"action[{index}] = {array[index]}: must be finite")
    return np.asarray(np.minimum(np.maximum(array, spec.minimum), spec.maximum))


def check_bound(name: str, value: object, most: float = np.inf) -> None:
    """Raise `InputError` unless an argument is a number above 0 and not beyond ``most``."""
    if not (is_finite(value) and 0.0 < value <= most):
        allowed = "a number above 0" + (f", at most {most:.6g}" if most < np.inf else "")
        raise InputError(f"environment: {name} = {short_repr(value)}: must be {allowed}")


class Observed:
    """The observed arrays of a vehicle.

    Args:
        bounds: Names of `OBSERVATIONS` and the largest absolute value of each; default: `BOUNDS`,
            for a vehicle without tilt servos less the tilts.
        rotors, tilts: Numbers of rotors and tilt servos.

    Raises:
        InputError: If there is no such observation of this vehicle, or a bound is invalid.
    """

    def __init__(self, bounds: Mapping[str, float] | None, *, rotors: int, tilts: int) -> None:
        known = [name for name in OBSERVATIONS if tilts or name not in _TILT_OBSERVATIONS]
        self._widths = {"quaternion": 4, "rotor_speeds": rotors}
        self._widths |= dict.fromkeys(_TILT_OBSERVATIONS, tilts)
        self.bounds = {name: BOUNDS[name] for name in known if name in BOUNDS}
        if bounds is not None:
            _check_bounds(bounds, known)
            self.bounds = dict(bounds)
        self._readers = [OBSERVATIONS[name] for name in self.bounds]
        widths = [self._widths.get(name, 3) for name in self.bounds]
        self._high = np.repeat([*self.bounds.values()], widths).astype(np.float64)
        ends = np.cumsum(widths).tolist()
        places = zip(self.bounds, widths, ends)
        self._slices = {name: slice(end - width, end) for name, width, end in places}

    def spec(self) -> dict[str, specs.BoundedArray]:
        """Shape and bounds of every array, by name."""
        return {
            name: specs.BoundedArray((self._widths.get(name, 3),), np.float64, -bound, bound, name)
            for name, bound in self.bounds.items()
        }

    def arrays(self, observation: Observation, rotation: Any, numpy: Any = np) -> dict[str, Any]:
        """A controller's observation as a flat dict of arrays, clipped to their bounds.

        ``rotation``, (3, 3), is from body to world; ``numpy`` may be ``jax.numpy``.
        """
        every = numpy.concatenate([read(observation, rotation) for read in self._readers])
        clipped = numpy.minimum(numpy.maximum(every, -self._high), self._high)
        return {name: clipped[place] for name, place in self._slices.items()}


def _check_bounds(bounds: object, known: list[str]) -> None:
    if not isinstance(bounds, Mapping) or not bounds:
        raise InputError(
            f"environment: observations = {short_repr(bounds)}: must be a dict from names to bounds"
        )
    for name, bound in bounds.items():
        if name not in known:
            raise InputError(f"environment: observations: {name!r}: {choose(name, known)}")
        check_bound(f"observations[{name!r}]", bound)
