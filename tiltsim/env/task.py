"""The task of an episode: its scenario, arrays, reward and termination."""

from collections.abc import Callable, Mapping, Sequence
from math import dist, pi
from operator import attrgetter
from os import PathLike
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from dm_env import specs

from tiltsim.env.domain import Domain
from tiltsim.errors import InputError
from tiltsim.flight.metrics import End
from tiltsim.models.rotor_table import Multirotor
from tiltsim.plants.command import CheckedCommand, Observation
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.scenario.controller import PythonController
from tiltsim.scenario.loading import as_scenario
from tiltsim.scenario.messages import choose
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.arguments import is_finite, real_array
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.attitude import rotation_of_quaternion
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


def real_action(action: npt.ArrayLike) -> Floats:
    """An action as an array. Raises ValueError for other entries than real numbers."""
    try:
        return real_array(action)
    except TypeError as error:
        raise ValueError(f"action {error}: must be real numbers") from None


def clip_action(action: npt.ArrayLike, spec: specs.BoundedArray) -> Floats:
    """An action within its bounds.

    Raises ValueError for a wrong shape, a non-finite entry, or other entries than real numbers.
    """
    array = real_action(action)
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


Reward = Callable[[Mapping[str, Floats], Floats], float]
"""``(observation, action) -> reward``, called after every step."""

ENVIRONMENT: Final = "tiltsim.env.TiltrotorEnv"  # the controller named in the scenarios of episodes


def hover_reward(observation: Mapping[str, Any], action: Any) -> Any:
    """Between 0 and 1: 1 at rest on the reference, half of it 1 m away.

    ``1 / (1 + e^2 + 0.1 v^2 + 0.01 w^2)`` of the position error e (m), the velocity error v (m/s)
    and the body rates w (rad/s), from observations in world or in body axes; they may be arrays of
    JAX. To the sum come ``0.25 f^2`` of an observed error f (N) of the force of a push and
    ``10 s^2`` of an observed swing s (rad) of a load.
    """
    error, velocity_error = _error(observation, "position"), _error(observation, "velocity")
    rates = observation["body_rates"]
    total = 1.0 + error @ error + 0.1 * (velocity_error @ velocity_error) + 0.01 * (rates @ rates)
    for name, weight in (("force_error_body", 0.25), ("swing_body", 10.0)):
        if name in observation:
            total = total + weight * (observation[name] @ observation[name])
    return 1.0 / total


def _error(observation: Mapping[str, Any], name: str) -> Any:
    error = observation.get(f"{name}_error_body")
    if error is None:
        error = observation[f"reference_{name}"] - observation[name]
    return error


class Task:
    """Follow the scenario's reference: the hooks that an `Environment` calls.

    A subclass may replace any of them.

    It takes the parameters of `tiltsim.env.TiltrotorEnv`, of which ``scenario`` is required;
    ``domain`` may also be a `Domain`.
    """

    def __init__(
        self,
        scenario: Scenario | str | PathLike[str] | Mapping[str, Any],
        *,
        control_timestep: float | None = None,
        domain: Domain | Sequence[Mapping[str, Any]] = (),
        reward: Reward = hover_reward,
        max_position_error: float = 10.0,
        observations: Mapping[str, float] | None = None,
        max_tilt_angle: float | None = None,
    ) -> None:
        scenario = as_scenario(scenario)
        check_bound("max_position_error", max_position_error)
        if not callable(reward):
            raise InputError(f"environment: reward = {short_repr(reward)}: must be a function")
        self._timing = (
            {} if control_timestep is None else {"simulation.control_timestep": control_timestep}
        )
        self.controller = scenario.controller  # replaced by the actions
        self.scenario = self._commanded(scenario)
        self.domain = domain if isinstance(domain, Domain) else None
        varies = not (domain is None or (isinstance(domain, Sequence) and not domain))
        if varies and not isinstance(domain, Domain):
            self.domain = Domain.from_axes(self.scenario, domain)
        vehicle = scenario.vehicle
        self._rotors = vehicle.rotor_count
        self.observed = Observed(observations, rotors=self._rotors, tilts=vehicle.tilt_count)
        self._action_spec = action_spec(self.scenario, max_tilt_angle)
        self.reward = reward
        self._target = np.zeros(3)  # m, of the last observation
        self.max_position_error = max_position_error

    def _commanded(self, scenario: Scenario) -> Scenario:
        commanded = {"controller.law": "python", "controller.function": ENVIRONMENT}
        return scenario.replace({**commanded, **self._timing})

    def _is_commanded(self, scenario: Scenario) -> bool:
        """Whether `_commanded` would change nothing: checking a scenario again takes a ms."""
        controller, step = scenario.controller, scenario.simulation.control_timestep
        return (
            isinstance(controller, PythonController)
            and controller.function == ENVIRONMENT
            and self._timing.get("simulation.control_timestep", step) == step
        )

    def action_spec(self) -> specs.BoundedArray:
        """Shape and bounds of an action, N and rad."""
        return self._action_spec

    def observation_spec(self) -> dict[str, specs.BoundedArray]:
        """Shape and bounds of every array of an observation, by name."""
        return self.observed.spec()

    def initialize_episode(self, generator: np.random.Generator) -> Scenario:
        """The scenario of the next episode. Raises `InputError` where the draw cannot be flown."""
        if self.domain is None:
            return self.scenario
        drawn = self.domain.draw(generator)
        return drawn if self._is_commanded(drawn) else self._commanded(drawn)

    def before_step(self, action: Floats, plant: CommandedPlant) -> None:
        """Send a clipped action to the plant, where it is held for one control step."""
        thrusts, tilts = action[: self._rotors].tolist(), action[self._rotors :].tolist()
        plant.apply(CheckedCommand("thrusts", tuple(thrusts), tuple(tilts) if tilts else None))

    def get_observation(self, plant: CommandedPlant) -> dict[str, Floats]:
        """The observation of the plant's state, through the scenario's sensors."""
        observation = plant.observation()
        self._target = observation.reference.position
        rotation = rotation_of_quaternion(observation.quaternion)
        return self.observed.arrays(observation, rotation)

    def get_reward(self, observation: Mapping[str, Floats], action: Floats) -> float:
        """The reward of a step that took ``action`` to ``observation``.

        Raises `InputError` if it needs an observation that there is not.
        """
        try:
            return float(self.reward(observation, action))
        except KeyError as error:
            if error.args[0] in OBSERVATIONS and error.args[0] not in observation:
                raise InputError(f"environment: observations: the reward needs {error}") from None
            raise

    def get_termination(self, sample: Floats, observation: Mapping[str, Floats]) -> End | None:
        """How the episode ends in a state within the simulation's limits, or None.

        ``sample`` is the true state: time (s), position (m, world), and the rest of the columns.
        """
        target = observation.get("reference_position", self._target)
        error = dist(target.tolist(), sample[1:4].tolist())
        if error <= self.max_position_error:
            return None
        return End("diverged", float(sample[0]), f"{error:.3g} m away from the reference")
