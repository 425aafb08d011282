"""Environments for learning: `TiltrotorEnv` for dm_env, `tiltsim.env.gymnasium` for Gymnasium."""

from __future__ import annotations

from tiltsim.env.environment import Environment, TiltrotorEnv
from tiltsim.env.task import Reward, Task, hover_reward

__all__ = ["Environment", "Reward", "Task", "TiltrotorEnv", "hover_reward"]
