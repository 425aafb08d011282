"""The task of an episode: its scenario, observation, reward and termination."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import dist
from os import PathLike
from typing import Any, Final

import numpy as np
from dm_env import specs

from tiltsim.env.arrays import OBSERVATIONS, Observed, action_spec, check_bound
from tiltsim.env.domain import Domain
from tiltsim.errors import InputError
from tiltsim.flight.end import End
from tiltsim.plants.command import CheckedCommand
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.scenario.controller import PythonController
from tiltsim.scenario.loading import as_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.attitude import rotation_of_quaternion
from tiltsim_controllers.mathematics.scalar import Floats

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
