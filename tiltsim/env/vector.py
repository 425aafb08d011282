"""Many environments at once as a `gymnasium.vector.VectorEnv`, in JAX; needs both extras."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from tiltsim.arrays.flying import double_precision
from tiltsim.env.environment import TiltrotorEnv
from tiltsim.env.functions import EnvFunctions, Episode
from tiltsim.env.tasks import TASKS
from tiltsim.errors import InputError
from tiltsim.scenario.messages import choose
from tiltsim.system.numbers import is_number
from tiltsim.system.optional import optional_package
from tiltsim.system.text import short_repr

optional_package("gymnasium", "tiltsim.env.VectorEnv", "'tiltsim[rl]'")

import gymnasium  # noqa: E402
from gymnasium import spaces  # noqa: E402
from gymnasium.utils import seeding  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402
from gymnasium.vector.utils import batch_space  # noqa: E402

_TASK_IDS = {f"tiltsim/{name}-v0": arguments for name, arguments in TASKS.items()}


class VectorEnv(gymnasium.vector.VectorEnv):  # type: ignore[misc]
    """Environments that are stepped together, on the equations instead of in MuJoCo.

    Environment ``i`` of ``reset(seed=s)`` draws the same episodes as the single environment does
    with seed ``s + i``, and has the same observations and rewards, but for rounding. An episode
    that has ended begins anew at the next step, whose action is not used.

    Args:
        task: The id of a task, such as ``"tiltsim/Hover-v0"``, or any scenario.
        num_envs: Number of environments.
        precision: "float32" or "float64".
        arrays: Return arrays of JAX, which stay on its device; default: NumPy's.
        **arguments: Those of `tiltsim.env.TiltrotorEnv`, in place of the task's own.

    Attributes:
        functions: One environment as pure functions; see `tiltsim.env.functions.EnvFunctions`.

    Raises:
        InputError: As `TiltrotorEnv` and `EnvFunctions`, and if a package is missing.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012, as in gymnasium

    def __init__(
        self,
        task: Any = "tiltsim/Hover-v0",
        num_envs: int = 1,
        *,
        precision: str = "float32",
        arrays: bool = False,
        **arguments: Any,
    ) -> None:
        if not (isinstance(num_envs, int) and is_number(num_envs) and num_envs > 0):
            shown = short_repr(num_envs)
            raise InputError(f"environment: num_envs = {shown}: must be a whole number above 0")
        if isinstance(task, str) and task.startswith("tiltsim/"):
            if task not in _TASK_IDS:
                raise InputError(f"environment: {task!r}: {choose(task, _TASK_IDS)}")
            arguments = {**_TASK_IDS[task], **arguments}
        else:
            arguments["scenario"] = task
        seed = arguments.get("seed")
        env = TiltrotorEnv(**arguments)
        self.num_envs, self._arrays, self._precision = num_envs, arrays, precision
        with self._numbers():
            self.functions = EnvFunctions(env.task, precision)
        shapes = (self.functions.observations,), (self.functions.actions,)
        boxes = [spaces.Box(-1.0, 1.0, shape, np.float32) for shape in shapes]
        self.single_observation_space, self.single_action_space = boxes
        self.observation_space = batch_space(boxes[0], num_envs)
        self.action_space = batch_space(boxes[1], num_envs)
        self._compile()
        self._generators = [
            seeding.np_random(None if seed is None else seed + row)[0] for row in range(num_envs)
        ]
        self._episodes: Episode | None = None

    def _numbers(self) -> AbstractContextManager[None]:
        return double_precision() if self._precision == "float64" else nullcontext()

    def _compile(self) -> None:
        import jax
        import jax.numpy as jnp

        functions = self.functions

        def one(
            episode: Episode, over: Any, action: Any, numbers: Any
        ) -> tuple[Episode, tuple[Any, ...]]:
            later, outcome = functions.step(episode, action)
            begun, first = functions.reset(numbers)
            choose_new = partial(jnp.where, over)
            observation, reward, terminated, truncated = outcome
            return jax.tree.map(choose_new, begun, later), (
                choose_new(first, observation),
                choose_new(0.0, reward),
                ~over & terminated,
                ~over & truncated,
            )

        self._begin = jax.jit(jax.vmap(functions.reset))
        self._advance = jax.jit(jax.vmap(one), donate_argnums=0)

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Begin all episodes. There are no options.

        Args:
            seed: One for each environment, or that of the first, which others count on from;
                default: go on with the draws.
            options: Not used.
        """
        if seed is not None:
            seeds = range(seed, seed + self.num_envs) if isinstance(seed, int) else seed
            if len(seeds) != self.num_envs:
                raise InputError(f"environment: {len(seeds)} seeds for {self.num_envs} episodes")
            for row, its in enumerate(seeds):
                if its is not None:
                    self._generators[row] = seeding.np_random(its)[0]
        self._fresh = self.functions.draw(self._generators)
        with self._numbers():
            self._episodes, observation = self._begin(self._fresh)
        self._over = np.zeros(self.num_envs, bool)
        self._draw_again(~self._over)
        return self._returned(observation), {}

    def step(self, actions: npt.ArrayLike) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Hold actions, shape (environments, entries), for one control step."""
        if self._episodes is None:
            raise InputError("environment: no episode has begun; call reset() first")
        shape = self.action_space.shape
        if np.shape(actions) != shape:
            raise ValueError(f"actions of shape {np.shape(actions)}; expected {shape}")
        begun = self._over
        with self._numbers():
            self._episodes, outcome = self._advance(self._episodes, begun, actions, self._fresh)
        observation, reward, terminated, truncated = outcome
        self._over = np.asarray(terminated) | np.asarray(truncated)
        self._draw_again(begun)
        returned = map(self._returned, (observation, reward, terminated, truncated))
        return (*returned, {})

    def _draw_again(self, rows: npt.NDArray[np.bool_]) -> None:
        """Draw the next episodes of environments whose last draw is in use."""
        chosen = np.flatnonzero(rows)
        if len(chosen):
            self._fresh[chosen] = self.functions.draw([self._generators[row] for row in chosen])

    def _returned(self, values: Any) -> Any:
        return values if self._arrays else np.asarray(values)
