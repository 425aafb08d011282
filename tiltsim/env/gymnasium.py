"""`tiltsim.env.TiltrotorEnv` as a Gymnasium environment; needs the extra ``tiltsim[rl]``.

Importing this module registers ``tiltsim/Tiltrotor-v0``, so that ``gymnasium.make`` finds it; its
keyword arguments are those of `TiltrotorEnv`.
"""

from __future__ import annotations

from typing import Any, ClassVar, Final

import numpy as np

from tiltsim.env.environment import Environment, TiltrotorEnv
from tiltsim_controllers.mathematics.scalar import Floats

try:
    import gymnasium
    from gymnasium import spaces
except ModuleNotFoundError:
    raise ModuleNotFoundError(
        "tiltsim.env.gymnasium needs Gymnasium, which is not installed: pip install 'tiltsim[rl]'"
    ) from None

ID: Final = "tiltsim/Tiltrotor-v0"


class GymnasiumEnv(gymnasium.Env):  # type: ignore[misc]
    """An `Environment` under Gymnasium's interface.

    Actions are scaled to -1 .. 1, each entry between the bounds of `Environment.action_spec`, so
    that zeros are the middle: for the default scenario, hover. Observations are the same flat dict;
    ``gymnasium.wrappers.FlattenObservation`` makes one vector of it. An episode terminates when the
    vehicle is lost, and is truncated at the end of the scenario.

    Args:
        env: The environment to adapt; default: a `TiltrotorEnv` with the other arguments.
        **arguments: Those of `TiltrotorEnv`. Without ``seed``, and without one in `reset`, episodes
            are drawn anew in every process, as Gymnasium has it; those of an ``env`` by its own.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(self, env: Environment | None = None, **arguments: Any) -> None:
        self.env: Environment = TiltrotorEnv(**arguments) if env is None else env
        if env is not None or arguments.get("seed") is not None:
            self.np_random = self.env.generator
        self.render_mode = None
        self._flying = False
        spec = self.env.action_spec()
        self._middle = 0.5 * (spec.maximum + spec.minimum)
        self._half = 0.5 * (spec.maximum - spec.minimum)
        self.action_space = spaces.Box(-1.0, 1.0, spec.shape, np.float32)
        self.observation_space = spaces.Dict(
            {name: _box(entry) for name, entry in self.env.observation_spec().items()}
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Floats], dict[str, Any]]:
        """Begin an episode; a seed restarts the random draws. There are no options.

        Args:
            seed: Default: go on with the draws, from the constructor's seed if it had one.
            options: Not used.
        """
        super().reset(seed=seed)
        self.env.reseed(self.np_random)
        observation = dict(self.env.reset().observation)
        self._flying = True
        return observation, {}

    def step(self, action: Floats) -> tuple[dict[str, Floats], float, bool, bool, dict[str, Any]]:
        """Hold an action for one control step; ``info["cause"]`` is that of a termination."""
        if not self._flying:
            raise RuntimeError("the episode has ended: call reset()")
        array = np.asarray(action, dtype=np.float64)
        if array.shape != self._middle.shape:
            raise ValueError(f"action of shape {array.shape}; expected {self._middle.shape}")
        step = self.env.step(self._middle + self._half * array)
        self._flying = not step.last()
        lost = bool(step.last() and step.discount == 0.0)
        info = {"cause": self.env.end.cause} if lost and self.env.end is not None else {}
        return dict(step.observation), float(step.reward), lost, step.last() and not lost, info


def _box(entry: Any) -> spaces.Box:
    low, high = (np.broadcast_to(bound, entry.shape) for bound in (entry.minimum, entry.maximum))
    return spaces.Box(low, high, dtype=np.float64)


if ID not in gymnasium.registry:
    gymnasium.register(ID, entry_point="tiltsim.env.gymnasium:GymnasiumEnv")
