"""Tells Gymnasium, where it is installed, of the environment and the tasks."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Final

from tiltsim.env.tasks import EPISODE_STEPS, TASKS

ID: Final = "tiltsim/Tiltrotor-v0"
"""Of `tiltsim.env.TiltrotorEnv` with its defaults; the tasks are called ``tiltsim/NAME-v0``."""

ENTRY_POINT: Final = "tiltsim.env.gymnasium:GymnasiumEnv"
VECTOR_ENTRY_POINT: Final = "tiltsim.env.vector:task_of_registry"


def register() -> None:
    """Make them known to ``gymnasium.make``; once is enough."""
    if find_spec("gymnasium") is None:
        return
    import gymnasium

    if ID in gymnasium.registry:
        return
    gymnasium.register(ID, entry_point=ENTRY_POINT)
    for name, arguments in TASKS.items():
        gymnasium.register(
            f"tiltsim/{name}-v0",
            entry_point=ENTRY_POINT,
            vector_entry_point=VECTOR_ENTRY_POINT if find_spec("jax") else None,
            kwargs={**arguments, "flat": True},
            max_episode_steps=EPISODE_STEPS,
        )
