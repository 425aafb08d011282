"""Many environments at once as a `gymnasium.vector.VectorEnv`, in JAX; needs both extras."""

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from tiltsim.arrays.flying import double_precision
from tiltsim.closed_loop.limits import BODY_RATE, MAX_BODY_RATE, MAX_ROTOR_SPEED, ROTOR_SPEED
from tiltsim.env.environment import TiltrotorEnv
from tiltsim.env.functions import NOT_FINITE, EnvFunctions, Episode, check_precision
from tiltsim.env.tasks import TASKS
from tiltsim.errors import InputError
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.messages import choose
from tiltsim.system.arguments import is_number
from tiltsim.system.public import optional_package
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
    that has ended restarts at the next step, whose action is not used. Rewards are float64, as in
    Gymnasium's own vectors, but for ``arrays``, where they have the ``precision``.

    Args:
        task: The id of a task, such as ``"tiltsim/Hover-v0"``, or any scenario.
        num_envs: Number of environments.
        precision: "float32" or "float64".
        arrays: Return arrays of JAX, which stay on its device; default: NumPy's.
        **arguments: Arguments of `tiltsim.env.TiltrotorEnv`, in place of the task's own.

    Attributes:
        functions: One environment as pure functions; see `tiltsim.env.functions.EnvFunctions`.

    Raises:
        InputError: See `TiltrotorEnv` and `EnvFunctions`; also if a package is missing.
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
        check_precision(precision)
        if isinstance(task, str) and task.startswith("tiltsim/"):
            if task not in _TASK_IDS:
                raise InputError(f"environment: {short_repr(task)}: {choose(task, _TASK_IDS)}")
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
            observation, reward, terminated, truncated, *causes = outcome
            return jax.tree.map(choose_new, begun, later), (
                choose_new(first, observation),
                choose_new(0.0, reward),
                ~over & terminated,
                ~over & truncated,
                *causes,
            )

        self._begin = jax.jit(jax.vmap(functions.reset))
        self._advance = jax.jit(jax.vmap(one), donate_argnums=0)

    def reset(
        self,
        *,
        seed: int | np.integer[Any] | list[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Begin all episodes. There are no options.

        Args:
            seed: One for each environment, or the first one's, from which the others count on;
                default: go on with the draws.
            options: Not used.
        """
        if seed is not None:
            seeds: Any = seed
            if isinstance(seed, int | np.integer):
                seeds = range(int(seed), int(seed) + self.num_envs)
            if len(seeds) != self.num_envs:
                raise InputError(f"environment: {len(seeds)} seeds for {self.num_envs} episodes")
            for row, its in enumerate(seeds):
                if its is not None:
                    self._generators[row] = seeding.np_random(int(its))[0]
        self._fresh = self.functions.draw(self._generators)
        with self._numbers():
            self._episodes, observation = self._begin(self._fresh)
        self._over = np.zeros(self.num_envs, bool)
        self._draw_again(~self._over)
        return self._returned(observation), {}

    def step(self, actions: npt.ArrayLike) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Hold actions, shape (environments, entries), for one control step.

        ``infos["cause"]`` has the causes of terminations, None for the other environments.

        Raises ValueError if the actions have the wrong shape or one that is used is not finite.
        """
        if self._episodes is None:
            raise InputError("environment: no episode has begun; call reset() first")
        shape = self.action_space.shape
        if np.shape(actions) != shape:
            raise ValueError(f"actions of shape {np.shape(actions)}; expected {shape}")
        begun = self._over
        wrong = ~np.isfinite(np.asarray(actions)) & ~begun[:, None]
        if wrong.any():
            row, entry = np.argwhere(wrong)[0]
            shown = np.asarray(actions)[row, entry]
            raise ValueError(f"actions[{row}, {entry}] = {shown}: must be finite")
        with self._numbers():
            self._episodes, outcome = self._advance(self._episodes, begun, actions, self._fresh)
        observation, reward, terminated, truncated, limit, distance = outcome
        lost = np.asarray(terminated)
        self._over = lost | np.asarray(truncated)
        self._draw_again(begun)
        if not self._arrays:
            reward = np.asarray(reward, np.float64)
        returned = map(self._returned, (observation, reward, terminated, truncated))
        return (*returned, _infos(lost, limit, distance) if lost.any() else {})

    def _draw_again(self, rows: npt.NDArray[np.bool_]) -> None:
        """Draw the next episodes of environments whose last draw is in use."""
        chosen = np.flatnonzero(rows)
        if len(chosen):
            self._fresh[chosen] = self.functions.draw([self._generators[row] for row in chosen])

    def _returned(self, values: Any) -> Any:
        return values if self._arrays else np.asarray(values)


def _infos(lost: npt.NDArray[np.bool_], limit: Any, distance: Any) -> dict[str, Any]:
    """The causes of terminations as Gymnasium's own vectors have them, with a mask."""
    causes = np.full(len(lost), None, dtype=object)
    codes, distances = np.asarray(limit), np.asarray(distance)
    for row in np.flatnonzero(lost):
        causes[row] = _cause(int(codes[row]), float(distances[row]))
    return {"cause": causes, "_cause": lost}


def _cause(code: int, distance: float) -> str:
    """Why an episode terminated, by the code of a limit and the distance (m) from the reference."""
    if code == NOT_FINITE:
        return "the state is no longer finite"
    if code >= ROTOR_SPEED:
        return f"rotor {code - ROTOR_SPEED + 1} faster than {MAX_ROTOR_SPEED:g} rad/s"
    if code >= BODY_RATE:
        return f"body rate {'pqr'[code - BODY_RATE]} above {MAX_BODY_RATE:g} rad/s"
    return f"{distance:.3g} m away from the reference"


def task_of_registry(
    num_envs: int = 1, *, scenario: Any, flat: bool, max_episode_steps: int, **arguments: Any
) -> VectorEnv:
    """A registered task for ``gymnasium.make_vec``, which knows its arguments.

    Args:
        num_envs, **arguments: See `VectorEnv`.
        scenario: Scenario of the task.
        flat: Whether observations are vectors, as they are here.
        max_episode_steps: Control steps after which an episode is over, if its time is not before.

    Raises:
        InputError: See `VectorEnv`; also if observations are not to be flat.
    """
    if not flat:
        raise InputError("environment: flat = False: arrays have flat observations only")
    scenario = load_scenario(scenario)
    step = arguments.get("control_timestep") or scenario.simulation.control_timestep
    duration = min(scenario.simulation.duration, max_episode_steps * step)
    return VectorEnv(scenario.replace({"simulation.duration": duration}), num_envs, **arguments)
