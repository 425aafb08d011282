"""Environments for learning: `TiltrotorEnv` for dm_env, `tiltsim.env.gymnasium` for Gymnasium.

Where Gymnasium is installed, importing this package registers the tasks of `tiltsim.env.tasks`.
"""

from __future__ import annotations

from tiltsim.env.environment import Environment, TiltrotorEnv
from tiltsim.env.registration import register
from tiltsim.env.task import Reward, Task, hover_reward

__all__ = ["Environment", "Reward", "Task", "TiltrotorEnv", "hover_reward"]

register()
