"""A Gymnasium environment of a hexarotor with its own reward, and a random linear policy."""

import gymnasium
import numpy as np


def reward(observation, action):
    """1 at the set point at most, less for every N of thrust."""
    error = observation["position_error_body"]  # m
    return 1.0 / (1.0 + error @ error) - 1e-3 * np.linalg.norm(action)


env = gymnasium.make(
    "tiltsim.env:tiltsim/Tiltrotor-v0",  # the module that registers it, and its name
    scenario="fleet/cant_hexarotor#hover",
    control_timestep=0.02,  # s, in which an action is held
    reward=reward,
    observations={
        "position_error_body": 3.0,  # each divided by its bound
        "velocity_error_body": 5.0,
        "up_body": 1.0,
        "body_rates": 10.0,
    },
    flat=True,
)
generator = np.random.default_rng(0)
best = 0.0
for seed in range(20):
    weights = 0.1 * generator.standard_normal((env.action_space.shape[0], 12))
    observation, _ = env.reset(seed=seed)
    score, over = 0.0, False
    while not over:
        action = np.clip(weights @ observation, -1.0, 1.0)
        observation, earned, terminated, truncated, info = env.step(action)
        score, over = score + earned, terminated or truncated
    best = max(best, score)
print(f"actions {env.action_space.shape}, best score {best:.1f}; the last flight: {info}")
