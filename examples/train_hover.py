"""Train a linear policy for tiltsim/Hover-v0 by augmented random search; NumPy is all it takes.

    python examples/train_hover.py --out policy.npy

The search perturbs the policy's weights in random directions, flies each perturbation and its
opposite from the same start, and moves the weights along the directions whose scores differ (Mania,
Guy and Recht, 2018, https://arxiv.org/abs/1803.07055). The result depends on the seed alone, not on
the number of processes.
"""

from __future__ import annotations

import argparse
import os
from functools import cache
from multiprocessing import get_context
from time import perf_counter

import gymnasium
import numpy as np

from tiltsim.env import EPISODE_STEPS  # importing it registers the tasks

TASK = "tiltsim/Hover-v0"
TRAINING_STEPS = 250
"""Control steps of the episodes for training: half of the task's own are enough to settle."""

DIRECTIONS = 16
BEST = 8
"""Directions per update, and how many of them count: those with the best scores."""

NOISE, STEP = 0.15, 0.12
"""Standard deviation of the perturbations, and step size; both shrink to a fifth in the end."""


@cache
def environment(steps: int) -> gymnasium.Env:
    """The environment of this process."""
    return gymnasium.make(TASK, max_episode_steps=steps)


def fly(weights: np.ndarray, seed: int, steps: int) -> float:
    """The score of a policy, the total reward of one episode from the start that the seed draws."""
    env = environment(steps)
    observation, _ = env.reset(seed=seed)
    score, over = 0.0, False
    while not over:
        action = np.clip(weights[:, :-1] @ observation + weights[:, -1], -1.0, 1.0)
        observation, reward, terminated, truncated, _ = env.step(action.astype(np.float32))
        score, over = score + reward, terminated or truncated
    return score


def train(updates: int, seed: int, processes: int) -> np.ndarray:
    """The weights of the policy: a row for each action, its last entry the constant term."""
    env = environment(TRAINING_STEPS)
    shape = env.action_space.shape[0], env.observation_space.shape[0] + 1
    weights, generator, start = np.zeros(shape), np.random.default_rng(seed), perf_counter()
    with get_context("spawn").Pool(processes) as pool:
        for update in range(updates):
            scale = 1.0 - 0.8 * update / updates
            directions = generator.standard_normal((DIRECTIONS, *shape))
            starts = generator.integers(2**31, size=DIRECTIONS).tolist()
            flights = [
                (weights + sign * scale * NOISE * direction, begin, TRAINING_STEPS)
                for direction, begin in zip(directions, starts, strict=True)
                for sign in (1.0, -1.0)
            ]
            scores = np.array(pool.starmap(fly, flights, chunksize=1)).reshape(-1, 2)
            best = np.argsort(scores.max(axis=1))[-BEST:]
            slopes = (scores[best, 0] - scores[best, 1]) / (scores[best].std() * BEST)
            weights = weights + scale * STEP * np.tensordot(slopes, directions[best], axes=1)
            if (update + 1) % max(1, updates // 8) == 0:
                print(f"update {update + 1}: {scores.mean():.1f}, {perf_counter() - start:.0f} s")
    return weights


def main() -> None:
    """Train, and print the score on starts that the training has not seen."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--updates", type=int, default=80, help="of the weights; default: 80")
    parser.add_argument("--seed", type=int, default=0, help="of all that is drawn; default: 0")
    parser.add_argument("--processes", type=int, default=2, help="that fly; default: 2")
    parser.add_argument("--out", help="file for the weights, .npy; default: none")
    arguments = parser.parse_args()
    start = perf_counter()
    weights = train(arguments.updates, arguments.seed, arguments.processes)
    seconds, used = perf_counter() - start, sum(os.times()[:4])
    scores = [fly(weights, seed, EPISODE_STEPS) for seed in range(20)]
    print(f"score {np.mean(scores):.1f}, standard deviation {np.std(scores):.1f}, over 20 starts")
    print(f"trained for {seconds:.0f} s, {used:.0f} s of processor time")
    if arguments.out:
        np.save(arguments.out, weights)


if __name__ == "__main__":
    main()
