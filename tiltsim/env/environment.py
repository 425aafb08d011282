"""The vehicle as a `dm_env.Environment`: thrusts and tilt angles in, the state out.

An episode is a scenario flown under commands, on the same plant and with the same limits as any
other flight; `TiltrotorEnv.flight` hands it over for metrics, files, figures and Rerun.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import pi
from pathlib import Path
from time import perf_counter
from typing import Any, Final

import dm_env
import numpy as np
import numpy.typing as npt
from dm_env import specs

from tiltsim.env.domain import Domain
from tiltsim.errors import InputError
from tiltsim.flight.end import End
from tiltsim.flight.flight import Flight
from tiltsim.plants.command import CheckedCommand, Command, Observation, checked
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.plants.user_controller import with_external_commands
from tiltsim.scenario.loading import load_scenario, parse_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.monitor import TerminationMonitor
from tiltsim_controllers.mathematics.scalar import Floats

Observed = dict[str, Floats]
Reward = Callable[[Mapping[str, Floats], Floats], float]
"""``(observation, action) -> reward``, asked after every step."""

HOVER: Final[dict[str, Any]] = {
    "title": "Hover at the origin",
    "simulation": {"duration": 10.0, "timestep": 0.002, "control_timestep": 0.02},
    "initial": {"rotor_speed": 361.3829880001334},
    "controller": {"law": "python", "function": "tiltsim.env.TiltrotorEnv"},
}
"""The scenario of an environment that is given none, from hover."""

THRUST_TO_WEIGHT: Final = 2.0
"""The largest thrusts carry this many weights, where the scenario has no `max_rotor_speed`."""

TILT_RANGE: Final = pi / 2
"""Tilt angles either way (rad), where the scenario has no `tilt_servo.max_angle`."""

BOUNDS: Final = {
    "position": 1e4,  # m
    "velocity": 1e4,  # m/s
    "attitude": pi,
    "quaternion": 1.0,
    "body_rates": 1e4,  # rad/s
    "tilt_angles": 1e3,  # rad: a pod without a stop may turn around
    "tilt_rates": 1e5,  # rad/s
    "rotor_speeds": 1e5,  # rad/s
    "reference_position": 1e6,
    "reference_velocity": 1e6,
    "reference_attitude": pi,
}
"""Observations by name and their largest absolute value, wider than what an episode survives."""

_WIDTHS: Final = {"quaternion": 4, "tilt_angles": 4, "tilt_rates": 4, "rotor_speeds": 4}
_OF_TILTS: Final = ("tilt_angles", "tilt_rates")


def hover_reward(observation: Mapping[str, Floats], action: Floats) -> float:
    """Between 0 and 1: 1 at rest on the reference, half of it 1 m away."""
    away = observation["reference_position"] - observation["position"]
    slip = observation["reference_velocity"] - observation["velocity"]
    turn = observation["body_rates"]
    return float(1.0 / (1.0 + away @ away + 0.1 * (slip @ slip) + 0.01 * (turn @ turn)))


class TiltrotorEnv(dm_env.Environment):  # type: ignore[misc]
    """A tiltrotor, or a quadrotor, that is told thrusts and tilt angles step by step.

    Actions are the thrusts of rotors 1 to 4 (N), then the tilt angles (rad), clipped to the bounds
    of `action_spec`; a quadrotor's are the thrusts alone. Each is held for
    ``simulation.control_timestep``. Observations are a flat dict of arrays, see `BOUNDS`. An
    episode ends after ``simulation.duration`` with a discount of 1, or with a discount and a
    reward of 0 where the flight is lost.

    Parameters
    ----------
    scenario
        What to fly, by itself, its file or its name in the library; its own law is left out.
        Default: `HOVER`.
    control_timestep
        How long (s) an action is held, in place of the scenario's ``simulation.control_timestep``;
        where both are 0, one physics step.
    reward
        See `Reward`.
    domain
        Axes as in a sweep file, such as ``{"key": "vehicle.mass", "type": "uniform", "low": 0.9,
        "high": 1.1, "relative": True}``, drawn anew for every episode.
    seed
        Of what is drawn; default: the scenario's ``simulation.seed``. The same seed and the same
        actions give the same episodes, bit for bit.
    max_position_error
        Distance from the reference (m) at which a flight counts as lost.

    Raises
    ------
    InputError
        If the scenario cannot be flown under commands, or an axis is invalid.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path | None = None,
        *,
        control_timestep: float | None = None,
        reward: Reward = hover_reward,
        domain: Sequence[Mapping[str, Any]] = (),
        seed: int | None = None,
        max_position_error: float = 10.0,
    ) -> None:
        if scenario is None:
            scenario = parse_scenario(HOVER, "environment")
        elif not isinstance(scenario, Scenario):
            scenario = load_scenario(scenario)
        base = self._commanded(scenario, control_timestep)
        self._start(base, Domain(base, domain) if domain else None, reward, max_position_error)
        self._control_timestep = control_timestep
        self.reseed(seed)

    @classmethod
    def from_sweep(
        cls,
        path: str | Path,
        *,
        control_timestep: float | None = None,
        reward: Reward = hover_reward,
        seed: int | None = None,
        max_position_error: float = 10.0,
    ) -> TiltrotorEnv:
        """An environment whose episodes are drawn from the axes of a sweep file.

        Raises `InputError` where there is none.
        """
        domain, scenario = Domain.of_sweep(path)
        env = cls.__new__(cls)
        base = env._commanded(scenario, control_timestep)
        env._start(base, domain, reward, max_position_error)
        env._control_timestep = control_timestep
        env.reseed(seed)
        return env

    @staticmethod
    def _commanded(scenario: Scenario, control_timestep: float | None) -> Scenario:
        name = "tiltsim.env.TiltrotorEnv"
        if control_timestep is None:
            return with_external_commands(scenario, name)
        simulation = {"control_timestep": control_timestep}
        return with_external_commands(scenario, name, simulation)

    def _start(
        self, base: Scenario, domain: Domain | None, reward: Reward, max_position_error: float
    ) -> None:
        if not max_position_error > 0.0:
            raise InputError(
                f"environment: max_position_error = {max_position_error}: must be greater than 0"
            )
        self._base, self._domain, self._reward = base, domain, reward
        self._max_position_error = max_position_error
        self._tilting = base.vehicle.model == "tiltrotor"
        self._action_spec = self._make_action_spec()
        names = [name for name in BOUNDS if self._tilting or name not in _OF_TILTS]
        self._observation_spec = {
            name: specs.BoundedArray(
                (_WIDTHS.get(name, 3),), np.float64, -BOUNDS[name], BOUNDS[name], name
            )
            for name in names
        }
        self._scenario = base
        self._plant: CommandedPlant | None = None
        self._initial_state: Floats | None = None
        self._end: End | None = None

    def _make_action_spec(self) -> specs.BoundedArray:
        table = self._base.rotorcraft
        vehicle = table.resolve()
        fastest = table.max_rotor_speed
        highest = THRUST_TO_WEIGHT * vehicle.mass * vehicle.gravity / 4.0
        if fastest is not None:
            highest = vehicle.thrust_coefficient * fastest**2
        lowest = vehicle.thrust_coefficient * (table.min_rotor_speed or 0.0) ** 2
        tilt = table.tilt_servo.max_angle or TILT_RANGE
        low, high = [lowest] * 4, [highest] * 4
        name = "thrusts"
        if self._tilting:
            low, high, name = [*low, *[-tilt] * 4], [*high, *[tilt] * 4], "thrusts, tilt_angles"
        return specs.BoundedArray((len(low),), np.float64, low, high, name)

    def action_spec(self) -> specs.BoundedArray:
        """Shape and bounds of an action, N and rad."""
        return self._action_spec

    def observation_spec(self) -> dict[str, specs.BoundedArray]:
        """Shape and bounds of every array of an observation."""
        return dict(self._observation_spec)

    def reset(self) -> dm_env.TimeStep:
        """Begin a new episode. Raises `InputError` where one was drawn that cannot be flown."""
        if self._domain is not None:
            drawn = self._domain.draw(self._generator)
            self._scenario = self._commanded(drawn, self._control_timestep)
        if self._plant is None or self._initial_state is None or self._domain is not None:
            self._plant = CommandedPlant(self._scenario)
            self._initial_state = self._plant.state
        else:
            self._plant.state = self._initial_state
        simulation = self._scenario.simulation
        self._steps_left = simulation.steps
        self._steps_each = max(1, simulation.control_steps)
        self._watch = TerminationMonitor(self._scenario)
        self._end = None
        self._samples = [self._sample(self._plant)]
        self._wall_time = 0.0
        self._observation = self._observed(self._plant.seen())
        return dm_env.restart(dict(self._observation))

    def step(self, action: npt.ArrayLike) -> dm_env.TimeStep:
        """Hold an action for one control step; a new episode where the last one has ended.

        Raises ValueError where the action has the wrong shape or an entry that is no finite number.
        """
        if self._plant is None or self._end is not None:
            return self.reset()
        told = self._clipped(action)
        rotors, tilts = told[:4].tolist(), told[4:].tolist()
        steps = min(self._steps_each, self._steps_left)
        start = perf_counter()
        self._plant.apply(CheckedCommand("thrusts", tuple(rotors), tuple(tilts) if tilts else None))
        self._plant.advance(steps)
        self._wall_time += perf_counter() - start
        self._steps_left -= steps
        sample = self._sample(self._plant)
        finite = bool(np.isfinite(sample).all())
        if finite:
            self._samples.append(sample)
            self._observation = self._observed(self._plant.seen())
        self._end = self._judged(self._plant, sample, self._observation)
        if self._end is None and self._steps_left == 0:
            self._end = End("completed", self._plant.time)
        observation = dict(self._observation)
        if self._end is None:
            return dm_env.transition(float(self._reward(observation, told)), observation)
        if self._end.kind == "completed":
            return dm_env.truncation(float(self._reward(observation, told)), observation)
        return dm_env.termination(0.0, observation)

    def reseed(self, seed: int | np.random.Generator | None = None) -> None:
        """Start the draws of the episodes to come anew; None takes the scenario's seed."""
        self._generator = np.random.default_rng(
            self._base.simulation.seed if seed is None else seed
        )

    @property
    def scenario(self) -> Scenario:
        """What the present episode flies."""
        return self._scenario

    @property
    def end(self) -> End | None:
        """How and why the episode ended; None while it goes on."""
        return self._end

    def flight(self) -> Flight:
        """The episode so far, with a sample a control step. Raises `InputError` before the first.

        An episode that goes on is "interrupted".
        """
        if self._plant is None:
            raise InputError("environment: no episode has begun; call reset() first")
        end = self._end or End("interrupted", self._plant.time, "the episode goes on")
        return Flight(self._scenario, np.array(self._samples), end, "python", self._wall_time)

    def observe(self) -> Observation:
        """What a controller sees, for one written for `tiltsim.simulate`."""
        if self._plant is None:
            raise InputError("environment: no episode has begun; call reset() first")
        return self._plant.seen()

    def action(self, command: Command) -> Floats:
        """The action for a controller's command of thrusts or rotor speeds.

        Raises `tiltsim.plants.command.ControllerError` where it is invalid or of another kind.
        """
        if self._plant is None:
            raise InputError("environment: no episode has begun; call reset() first")
        return self._plant.thrusts_and_tilts(checked(command, tilting=self._tilting))

    @staticmethod
    def _sample(plant: CommandedPlant) -> Floats:
        return np.array([plant.time, *plant.observe()])

    def _clipped(self, action: npt.ArrayLike) -> Floats:
        spec = self._action_spec
        told = np.asarray(action, dtype=np.float64)
        if told.shape != spec.shape:
            raise ValueError(f"action of shape {told.shape}; {spec.shape} is wanted ({spec.name})")
        if not np.isfinite(told).all():
            index = int(np.flatnonzero(~np.isfinite(told))[0])
            raise ValueError(f"action[{index}] = {told[index]}; it must be finite")
        return np.asarray(np.minimum(np.maximum(told, spec.minimum), spec.maximum))

    def _observed(self, seen: Observation) -> Observed:
        reference = seen.reference
        arrays = {
            "position": seen.position,
            "velocity": seen.velocity,
            "attitude": seen.attitude,
            "quaternion": seen.quaternion,
            "body_rates": seen.body_rates,
            "tilt_angles": seen.tilt_angles,
            "tilt_rates": seen.tilt_rates,
            "rotor_speeds": seen.rotor_speeds,
            "reference_position": reference.position,
            "reference_velocity": reference.velocity,
            "reference_attitude": reference.attitude,
        }
        return {
            name: np.minimum(np.maximum(arrays[name], -BOUNDS[name]), BOUNDS[name])
            for name in self._observation_spec
        }

    def _judged(self, plant: CommandedPlant, sample: Floats, seen: Observed) -> End | None:
        end = self._watch.judge(plant, sample)
        if end is not None:
            return end
        away = seen["reference_position"] - sample[1:4]  # not where noisy sensors say
        error = float(away @ away) ** 0.5
        if error <= self._max_position_error:
            return None
        return End("diverged", plant.time, f"{error:.3g} m away from the reference")
