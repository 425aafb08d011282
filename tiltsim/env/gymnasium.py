"""The environments and learning tasks under Gymnasium; needs the extra ``tiltsim[rl]``.

Importing `tiltsim.env` registers ``tiltsim/Hover-v0`` and the other tasks of `tiltsim.env.tasks`,
and ``tiltsim/Tiltrotor-v0``, a `TiltrotorEnv` with its defaults; ``gymnasium.make`` takes the
arguments of `GymnasiumEnv` in place of a task's own.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from tiltsim.env.environment import Environment, TiltrotorEnv
from tiltsim.env.task import real_action
from tiltsim.errors import InputError
from tiltsim.plants.command import Command
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats

try:
    import gymnasium
    from gymnasium import spaces
except ModuleNotFoundError:
    raise ModuleNotFoundError(
        "tiltsim.env.gymnasium needs Gymnasium, which is not installed: pip install 'tiltsim[rl]'"
    ) from None

Observed = dict[str, Floats] | npt.NDArray[np.float32]


class GymnasiumEnv(gymnasium.Env):  # type: ignore[misc]
    """An `Environment` under Gymnasium's interface.

    Actions are scaled to -1 .. 1, each entry between the bounds of `Environment.action_spec`, so
    that zeros are the middle: for the default scenario, hover. Observations are the same flat dict,
    or ``flat``. An episode terminates when the vehicle is lost, and is truncated at the end of the
    scenario.

    Args:
        env: The environment to adapt; default: a `TiltrotorEnv` with the other arguments.
        flat: Observe one vector: the arrays in their order, each divided by its bound, so that its
            entries are from -1 to 1.
        render_mode: ``"rgb_array"``, for `render`, or None.
        **arguments: Arguments of `TiltrotorEnv`. Without ``seed``, here and in `reset`, every
            process draws other episodes, as in Gymnasium; an ``env`` keeps its own draws.

    Raises:
        InputError: If there is no such render mode, and as `TiltrotorEnv`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012, as in gymnasium.Env

    def __init__(
        self,
        env: Environment | None = None,
        *,
        flat: bool = False,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        if not isinstance(render_mode, str | None) or render_mode not in (None, "rgb_array"):
            shown = short_repr(render_mode)
            raise InputError(f"environment: render_mode = {shown}: must be 'rgb_array' or None")
        self.env: Environment = TiltrotorEnv(**arguments) if env is None else env
        if env is not None or arguments.get("seed") is not None:
            self.np_random = self.env.generator
        self.render_mode = render_mode
        simulation = self.env.scenario.simulation
        period = max(1, simulation.control_steps) * simulation.timestep
        self.metadata = self.metadata | {"render_fps": round(1.0 / period)}
        self._flying = False
        spec = self.env.action_spec()
        self._middle = 0.5 * (spec.maximum + spec.minimum)
        self._half = 0.5 * (spec.maximum - spec.minimum)
        self.action_space = spaces.Box(-1.0, 1.0, spec.shape, np.float32)
        boxes = {name: _box(entry) for name, entry in self.env.observation_spec().items()}
        self._bounds = (
            np.concatenate([box.high.ravel() for box in boxes.values()]) if flat else None
        )
        self.observation_space = spaces.Dict(boxes)
        if self._bounds is not None:
            self.observation_space = spaces.Box(-1.0, 1.0, self._bounds.shape, np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode; a seed restarts the random draws. There are no options.

        Args:
            seed: Default: go on with the draws, from the constructor's seed if it had one.
            options: Not used.
        """
        super().reset(seed=seed)
        self.env.reseed(self.np_random)
        observation = self._observed(self.env.reset().observation)
        self._flying = True
        return observation, {}

    def step(self, action: npt.ArrayLike) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Hold an action for one control step; ``info["cause"]`` explains a termination."""
        if not self._flying:
            raise RuntimeError("the episode has ended: call reset()")
        array = real_action(action)
        if array.shape != self._middle.shape:
            raise ValueError(f"action of shape {array.shape}; expected {self._middle.shape}")
        step = self.env.step(self._middle + self._half * array)
        self._flying = not step.last()
        lost = bool(step.last() and step.discount == 0.0)
        info = {"cause": self.env.end.cause} if lost and self.env.end is not None else {}
        observation = self._observed(step.observation)
        return observation, float(step.reward), lost, step.last() and not lost, info

    def action(self, command: Command) -> Floats:
        """A controller's command as an action; see `Environment.action`.

        Raises `ControllerError` if the command is invalid or gives rotor accelerations.
        """
        return np.asarray((self.env.action(command) - self._middle) / self._half)

    def render(self) -> npt.NDArray[np.uint8] | None:
        """A picture of the present state, shape (360, 640, 3); None without ``render_mode``.

        Raises `tiltsim.InputError` before the first episode, and if no OpenGL implementation works.
        """
        return self.env.render() if self.render_mode else None

    def close(self) -> None:
        """Free the renderer."""
        self.env.close()

    def _observed(self, arrays: dict[str, Floats]) -> Observed:
        if self._bounds is None:
            return dict(arrays)
        return np.asarray(np.concatenate([*arrays.values()]) / self._bounds, dtype=np.float32)


def _box(entry: Any) -> spaces.Box:
    low, high = (np.broadcast_to(bound, entry.shape) for bound in (entry.minimum, entry.maximum))
    return spaces.Box(low, high, dtype=np.float64)
