"""The task of an episode: its scenario, observation, reward and termination."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from dm_env import specs

from tiltsim.env.arrays import action_spec, has_tilts, observation_arrays, observation_spec
from tiltsim.env.domain import Domain
from tiltsim.errors import InputError
from tiltsim.flight.end import End
from tiltsim.plants.command import CheckedCommand
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.scenario.scenario import Scenario
from tiltsim_controllers.mathematics.scalar import Floats

Reward = Callable[[Mapping[str, Floats], Floats], float]
"""``(observation, action) -> reward``, called after every step."""

ENVIRONMENT: Final = "tiltsim.env.TiltrotorEnv"
"""The controller named in the scenarios of episodes."""


def hover_reward(observation: Mapping[str, Floats], action: Floats) -> float:
    """Between 0 and 1: 1 at rest on the reference, half of it 1 m away."""
    error = observation["reference_position"] - observation["position"]
    velocity_error = observation["reference_velocity"] - observation["velocity"]
    rates = observation["body_rates"]
    return float(
        1.0
        / (1.0 + error @ error + 0.1 * (velocity_error @ velocity_error) + 0.01 * (rates @ rates))
    )


class Task:
    """Follow the scenario's reference: the hooks that an `Environment` calls.

    A subclass may replace any of them.

    Its parameters are those of `tiltsim.env.TiltrotorEnv`; ``domain`` may be a `Domain`, too.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        control_timestep: float | None = None,
        domain: Domain | Sequence[Mapping[str, Any]] = (),
        reward: Reward = hover_reward,
        max_position_error: float = 10.0,
    ) -> None:
        self._timing = (
            {} if control_timestep is None else {"simulation.control_timestep": control_timestep}
        )
        self.scenario = self._commanded(scenario)
        self._domain = domain if isinstance(domain, Domain) else None
        if domain and not isinstance(domain, Domain):
            self._domain = Domain.from_axes(self.scenario, domain)
        if not max_position_error > 0.0:
            raise InputError(
                f"environment: max_position_error = {max_position_error}: must be greater than 0"
            )
        self._tilting = has_tilts(scenario)
        self._reward = reward
        self._max_position_error = max_position_error

    def _commanded(self, scenario: Scenario) -> Scenario:
        commanded = {"controller.law": "python", "controller.function": ENVIRONMENT}
        return scenario.replace({**commanded, **self._timing})

    def action_spec(self) -> specs.BoundedArray:
        """Shape and bounds of an action, N and rad."""
        return action_spec(self.scenario)

    def observation_spec(self) -> dict[str, specs.BoundedArray]:
        """Shape and bounds of every array of an observation, by name."""
        return observation_spec(self.scenario)

    def initialize_episode(self, generator: np.random.Generator) -> Scenario:
        """The scenario of the next episode. Raises `InputError` where the draw cannot be flown."""
        if self._domain is None:
            return self.scenario
        return self._commanded(self._domain.draw(generator))

    def before_step(self, action: Floats, plant: CommandedPlant) -> None:
        """Send a clipped action to the plant, where it is held for one control step."""
        thrusts, tilts = action[:4].tolist(), action[4:].tolist()
        plant.apply(CheckedCommand("thrusts", tuple(thrusts), tuple(tilts) if tilts else None))

    def get_observation(self, plant: CommandedPlant) -> dict[str, Floats]:
        """The observation of the plant's state, through the scenario's sensors."""
        return observation_arrays(plant.observation(), tilting=self._tilting)

    def get_reward(self, observation: Mapping[str, Floats], action: Floats) -> float:
        """The reward of a step that took ``action`` to ``observation``."""
        return float(self._reward(observation, action))

    def get_termination(self, sample: Floats, observation: Mapping[str, Floats]) -> End | None:
        """How the episode ends in a state within the simulation's limits, or None.

        ``sample`` is the true state: time (s), position (m, world), and the rest of the columns.
        """
        offset = observation["reference_position"] - sample[1:4]
        error = float(offset @ offset) ** 0.5
        if error <= self._max_position_error:
            return None
        return End("diverged", float(sample[0]), f"{error:.3g} m away from the reference")
