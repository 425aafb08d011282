"""Environments for learning.

`TiltrotorEnv` is for dm_env, `tiltsim.env.gymnasium` for Gymnasium, `VectorEnv` for many in JAX.
Where Gymnasium is installed, importing this package registers the tasks of `tiltsim.env.tasks`.
"""

from typing import TYPE_CHECKING, Any

from tiltsim.env.environment import Environment, TiltrotorEnv
from tiltsim.env.task import Reward, Task, hover_reward
from tiltsim.env.tasks import EPISODE_STEPS, register

if TYPE_CHECKING:
    from tiltsim.env.functions import EnvFunctions
    from tiltsim.env.vector import VectorEnv

__all__ = [
    "EPISODE_STEPS",
    "EnvFunctions",
    "Environment",
    "Reward",
    "Task",
    "TiltrotorEnv",
    "VectorEnv",
    "hover_reward",
]


def __getattr__(name: str) -> Any:
    """`VectorEnv` and `EnvFunctions` on first use, as they need JAX and Gymnasium."""
    if name not in ("EnvFunctions", "VectorEnv"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from tiltsim.env import vector

    return getattr(vector, name)


register()
