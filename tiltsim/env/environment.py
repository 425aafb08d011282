"""A vehicle as a `dm_env.Environment`: thrusts and tilt angles in, the state out.

An episode is a scenario flown under commands, on the same plant and with the same limits as any
other flight; `Environment.flight` returns it for metrics, files, figures and Rerun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final, Self

import dm_env
import numpy as np
import numpy.typing as npt
from dm_env import specs

from tiltsim.env.domain import Domain
from tiltsim.env.task import Reward, Task, clip_action, hover_reward
from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import assemble
from tiltsim.plants.command import Command, Observation, check_command
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.plants.mujoco_plant import model_cache_key
from tiltsim.plants.plant import take_sample
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.simulate import TerminationMonitor
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.views.video.rendering import FlightRenderer

HOVER: Final[dict[str, Any]] = {
    "title": "Hover at the origin",
    "simulation": {"duration": 10.0, "timestep": 0.002, "control_timestep": 0.02},
    "initial": {"rotor_speed": 361.3829880001334},
    "controller": {"law": "python", "function": "tiltsim.env.TiltrotorEnv"},
}
"""The default scenario, which starts in hover."""


class Environment(dm_env.Environment):  # type: ignore[misc]
    """Steps a plant for a `Task`; owns the plant, the time and the random numbers.

    Args:
        task: Its scenario, observation, reward and termination make an episode.
        seed: Seed of the draws; default: the ``simulation.seed`` of the task's scenario. Equal
            seeds and equal actions give equal episodes, bit for bit.

    Attributes:
        scenario: The scenario of the present episode.
        end: How and why the episode ended; None during the episode.
        generator: The generator that draws the scenarios of later episodes.
    """

    def __init__(self, task: Task, *, seed: int | None = None) -> None:
        self.task = task
        self.scenario = task.scenario
        self._action_spec = task.action_spec()
        self._observation_spec = task.observation_spec()
        self._plant: CommandedPlant | None = None
        self._model_key: object = None
        self._renderer: FlightRenderer | None = None
        self._rendered = ""
        self._initial_state: Floats | None = None
        self.end: End | None = None
        self.reseed(seed)

    def action_spec(self) -> specs.BoundedArray:
        """Shape and bounds of an action, N and rad."""
        return self._action_spec

    def observation_spec(self) -> dict[str, specs.BoundedArray]:
        """Shape and bounds of every array of an observation."""
        return dict(self._observation_spec)

    def reset(self) -> dm_env.TimeStep:
        """Begin a new episode. Raises `InputError` if its drawn scenario cannot be flown."""
        scenario = self.task.initialize_episode(self.generator)
        if self._plant is None or self._initial_state is None or scenario is not self.scenario:
            self._plant = self._make_plant(scenario)
            self._initial_state = self._plant.state
        else:
            self._plant.state = self._initial_state
        self._steps_left = scenario.simulation.steps
        self._monitor = TerminationMonitor(self._assembly)
        self.end = None
        self._samples = [take_sample(self._plant)]
        self._wall_time = 0.0
        self._observation = self.task.get_observation(self._plant)
        return dm_env.restart(dict(self._observation))

    def _make_plant(self, scenario: Scenario) -> CommandedPlant:
        """The plant of another scenario, on the present model if that is the same."""
        assembly = assemble(scenario)
        key = assembly.loop, len(assembly.setup.knots), model_cache_key(scenario)
        model = self._plant.model if self._plant is not None and key == self._model_key else None
        self.scenario, self._assembly, self._model_key = scenario, assembly, key
        return CommandedPlant(assembly, model)

    def step(self, action: npt.ArrayLike) -> dm_env.TimeStep:
        """Hold an action for one control step; begin a new episode if the last one has ended.

        Raises ValueError if the action has the wrong shape or a non-finite entry.
        """
        if self._plant is None or self.end is not None:
            return self.reset()
        clipped = clip_action(action, self._action_spec)
        steps = min(max(1, self.scenario.simulation.control_steps), self._steps_left)
        start = perf_counter()
        self.task.before_step(clipped, self._plant)
        self._plant.advance(steps)
        self._wall_time += perf_counter() - start
        self._steps_left -= steps
        sample = take_sample(self._plant)
        if np.isfinite(sample).all():
            self._samples.append(sample)
            self._observation = self.task.get_observation(self._plant)
        self.end = self._monitor.check(self._plant, sample)
        if self.end is None:
            self.end = self.task.get_termination(sample, self._observation)
        if self.end is None and self._steps_left == 0:
            self.end = End("completed", self._plant.time)
        observation = dict(self._observation)
        if self.end is not None and self.end.kind != "completed":
            return dm_env.termination(0.0, observation)
        reward = self.task.get_reward(observation, clipped)
        if self.end is None:
            return dm_env.transition(reward, observation)
        return dm_env.truncation(reward, observation)

    def reseed(self, seed: int | np.random.Generator | None = None) -> None:
        """Restart the random draws of later episodes; None takes the scenario's seed."""
        try:
            self.generator = np.random.default_rng(
                self.task.scenario.simulation.seed if seed is None else seed
            )
        except (TypeError, ValueError):
            shown = short_repr(seed)
            raise InputError(
                f"environment: seed = {shown}: must be a whole number from 0"
            ) from None

    def flight(self) -> Flight:
        """The episode so far, with one sample per control step; "interrupted" until it ends.

        Raises `InputError` before the first episode.
        """
        plant = self._begun()
        end = self.end or End("interrupted", plant.time, "the episode has not ended")
        return Flight(self._assembly, np.array(self._samples), end, "python", self._wall_time)

    def render(self) -> npt.NDArray[np.uint8]:
        """A picture of the present state, shape (360, 640, 3), as in the videos of flights.

        Raises `InputError` before the first episode, and if no OpenGL implementation works.
        """
        from tiltsim.views.video.rendering import QUALITIES, FlightRenderer

        flight, shown = self.flight(), repr(self.scenario.vehicle)
        if self._renderer is None or shown != self._rendered:
            self.close()
            self._renderer, self._rendered = FlightRenderer(flight, QUALITIES["draft"]), shown
        else:
            self._renderer.show(flight)
        return self._renderer.frame(len(flight) - 1)

    def close(self) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.canvas.close()
            self._renderer = None

    def observe(self) -> Observation:
        """The observation that `tiltsim.simulate` would pass to a controller now."""
        return self._begun().observation()

    def action(self, command: Command) -> Floats:
        """The action that corresponds to a controller's command of thrusts or rotor speeds.

        Raises `ControllerError` if the command is invalid or gives rotor accelerations.
        """
        plant = self._begun()
        return plant.thrusts_and_tilts(check_command(command, plant.layout))

    def _begun(self) -> CommandedPlant:
        if self._plant is None:
            raise InputError("environment: no episode has begun; call reset() first")
        return self._plant


class TiltrotorEnv(Environment):
    """Any rotorcraft, commanded by thrusts and tilt angles, following a reference.

    Actions are the thrusts of the rotors (N), then the tilt angles (rad), clipped to the bounds of
    `action_spec`; without tilt servos, the thrusts alone. Each is held for
    ``simulation.control_timestep``. Observations are a flat dict of arrays, see
    `tiltsim.env.task.BOUNDS`. An episode ends after ``simulation.duration`` with a discount of
    1, or with a discount and a reward of 0 when the vehicle is lost.

    Args:
        scenario: Anything that `tiltsim.load_scenario` takes; its own controller is not used.
            Default: `HOVER`.
        control_timestep: How long (s) an action is held, in place of the scenario's
            ``simulation.control_timestep``; where both are 0, one physics step.
        reward: See `Reward`.
        domain: Axes as in a sweep file, such as ``{"key": "vehicle.mass", "type": "uniform", "low":
            0.9, "high": 1.1, "relative": True}``, drawn again for every episode.
        seed: Seed of the draws; default: the scenario's ``simulation.seed``.
        max_position_error: Distance from the reference (m) beyond which the vehicle counts as lost.
        observations: Names of `tiltsim.env.task.OBSERVATIONS` and the largest absolute value of
            each, in their order; default: `tiltsim.env.task.BOUNDS`.
        max_tilt_angle: Largest tilt angle (rad) of an action, if less than the vehicle's own.

    Raises:
        InputError: If the scenario cannot be flown under commands, or an axis is invalid.
    """

    def __init__(
        self,
        scenario: Scenario | str | PathLike[str] | Mapping[str, Any] | None = None,
        *,
        control_timestep: float | None = None,
        reward: Reward = hover_reward,
        domain: Domain | Sequence[Mapping[str, Any]] = (),
        seed: int | None = None,
        max_position_error: float = 10.0,
        observations: Mapping[str, float] | None = None,
        max_tilt_angle: float | None = None,
    ) -> None:
        task = Task(
            load_scenario(HOVER if scenario is None else scenario),
            control_timestep=control_timestep,
            domain=domain,
            reward=reward,
            max_position_error=max_position_error,
            observations=observations,
            max_tilt_angle=max_tilt_angle,
        )
        super().__init__(task, seed=seed)

    @classmethod
    def from_sweep(cls, path: str | Path, **arguments: Any) -> Self:
        """An environment whose episodes are drawn along the axes of a sweep file.

        Args:
            path: A TOML file or the name of a sweep in the library.
            **arguments: Arguments of `TiltrotorEnv`, without ``scenario`` and ``domain``.

        Raises:
            InputError: If there is no such sweep, or it is a search.
        """
        domain = Domain.from_sweep(path)
        return cls(domain.base, domain=domain, **arguments)
