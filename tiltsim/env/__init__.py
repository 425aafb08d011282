"""Environments for learning: `TiltrotorEnv` for dm_env, `tiltsim.env.gymnasium` for Gymnasium."""

from __future__ import annotations

from tiltsim.env.environment import Reward, TiltrotorEnv, hover_reward

__all__ = ["Reward", "TiltrotorEnv", "hover_reward"]
