"""Policies to compare a learner with on the tasks, and their scores.

    python -m tiltsim.env.baselines

prints the table of docs/environment.md.
"""

import sys
from collections.abc import Callable, Iterable
from typing import Any, Final

import numpy as np

from tiltsim.env.gymnasium import GymnasiumEnv
from tiltsim.env.tasks import TASKS
from tiltsim.plants.built_in import BuiltInController
from tiltsim.plants.command import Command
from tiltsim_controllers.mathematics.scalar import Floats

Policy = Callable[[Any], Floats]  # from the observation to the action, both scaled to -1 .. 1.
EPISODES: Final = range(20)  # the seeds of the episodes that make a score
CANDIDATES: Final = 200  # policies that the random search tries, each on one episode
UNSEEN: Final = 1000  # the seed of that episode, which no score is made of
SLOWEST: Final = 100.0
"""Rotor speed (rad/s) below which no rotor is commanded: the law is singular where one stops."""


def zeros(env: GymnasiumEnv) -> Policy:
    """The middle of every action: the thrusts of hover, no tilt."""
    action = np.zeros(env.action_space.shape)
    return lambda _: action


class BuiltInPolicy:
    """The built-in controller of a task's scenario, through the same actions as any policy.

    It reads the observation of a controller, `tiltsim.Observation`, which a learner's vector
    is made of, and knows the reference. An action holds the rotor speeds that its rotor
    accelerations lead to by the end of the step.

    Args:
        env: A task that nothing is wrapped around.
    """

    def __init__(self, env: GymnasiumEnv) -> None:
        self._env, self._scale = env.env, env.action

    def reset(self) -> None:
        """Begin an episode, after the environment has."""
        drawn, controller = self._env.scenario, self._env.task.controller
        self._controller = BuiltInController(drawn.model_copy(update={"controller": controller}))
        self._period = drawn.simulation.control_steps * drawn.simulation.timestep

    def __call__(self, _: object) -> Floats:
        """The action in the environment's present state."""
        seen = self._env.observe()
        command = self._controller(seen)
        if command.rotor_accelerations is not None:
            ahead = seen.rotor_speeds + self._period * np.asarray(command.rotor_accelerations)
            speeds = np.maximum(ahead, SLOWEST)
            command = Command(rotor_speeds=speeds, tilt_angles=command.tilt_angles)
        return self._scale(command)


def random_search(env: GymnasiumEnv, candidates: int = CANDIDATES, seed: int = 0) -> Policy:
    """The best of some random linear policies on one episode each, all from the same start.

    The standard deviation of a policy's weights is drawn from 0.01 to 1.
    """
    generator = np.random.default_rng(seed)
    shape = env.action_space.shape[0], env.observation_space.shape[0]
    sizes = 10.0 ** generator.uniform(-2.0, 0.0, candidates)
    tried = [size * generator.standard_normal(shape) for size in sizes]
    scores = [score(env, linear(weights), UNSEEN) for weights in tried]
    return linear(tried[int(np.argmax(scores))])


def linear(weights: Floats) -> Policy:
    """Actions that are linear in the observation, ``weights`` of shape (actions, observations)."""
    return lambda observation: np.clip(weights @ observation, -1.0, 1.0)


def score(env: GymnasiumEnv, policy: Policy, seed: int) -> float:
    """The total reward of the episode that a seed begins; a policy may have ``reset()``."""
    observation, _ = env.reset(seed=seed)
    getattr(policy, "reset", lambda: None)()
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, _ = env.step(policy(observation))
        total, over = total + reward, terminated or truncated
    return total


BASELINES: Final[dict[str, Callable[[GymnasiumEnv], Policy]]] = {
    "zero actions": zeros,
    "random search": random_search,
    "built-in controller": BuiltInPolicy,
}


def table(tasks: Iterable[str] = TASKS) -> str:
    """Mean score and standard deviation of every baseline on some tasks, as a Markdown table."""
    lines = [f"| task | {' | '.join(BASELINES)} |", f"| --- |{' --- |' * len(BASELINES)}"]
    for task in tasks:
        env = GymnasiumEnv(**TASKS[task], flat=True)
        cells = []
        for make in BASELINES.values():
            policy = make(env)
            scores = [score(env, policy, seed) for seed in EPISODES]
            cells.append(f"{np.mean(scores):.1f} ± {np.std(scores):.1f}")
        lines.append(f"| `tiltsim/{task}-v0` | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(f"{table()}\n")
