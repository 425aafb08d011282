"""Train a policy for tiltsim/Hover-v0 by gradients through the simulator, in JAX.

    python examples/train_hover_by_gradients.py --out policy.npz

The task is a pure function in JAX, so the rewards of an episode have a gradient with respect to the
weights of the policy. Every update flies new starts and follows that gradient with Adam (Kingma and
Ba, 2015, https://arxiv.org/abs/1412.6980). The policy is scored on the equations and in MuJoCo,
which it has not seen. The result depends on the seed alone.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from itertools import pairwise
from time import perf_counter
from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np

from tiltsim.env import EPISODE_STEPS, EnvFunctions, VectorEnv

TASK = "tiltsim/Hover-v0"
STARTS, STEPS = 128, 100
"""Episodes per update, and their control steps: 2 s are enough to settle."""

NEAR, FAR = 0.8, 0.99
"""Discount of the rewards per step in the first update, and from half of the updates on."""

HIDDEN, RATE = 32, 0.005
"""Units of each of two hidden layers, and Adam's step size, which falls to zero."""

Weights = list[tuple[Any, Any]]
"""Matrix and offset of every layer."""


def initial_weights(sizes: list[int], seed: int) -> Weights:
    """A network whose last layer is zero: it hovers without feedback."""
    generator, weights = np.random.default_rng(seed), []
    for inputs, outputs in pairwise(sizes):
        matrix = generator.standard_normal((outputs, inputs)) * inputs**-0.5
        weights.append((jnp.asarray(matrix, "float32"), jnp.zeros(outputs)))
    weights[-1] = (jnp.zeros_like(weights[-1][0]), weights[-1][1])
    return weights


def act(weights: Weights, observation: Any) -> Any:
    """The action of a policy, from -1 to 1; NumPy's or JAX's, as the weights are."""
    for matrix, offset in weights:
        values = matrix @ observation + offset
        observation = np.tanh(values) if isinstance(values, np.ndarray) else jnp.tanh(values)
    return observation


def make_update(functions: EnvFunctions) -> Callable[..., Any]:
    """One step of Adam along the gradient of the mean discounted reward."""

    def value(weights: Weights, numbers: jax.Array, discounts: jax.Array) -> jax.Array:
        def one(carry: Any, _: None) -> Any:
            episode, observation, alive = carry
            episode, outcome = functions.step(episode, act(weights, observation))
            alive = alive & ~outcome.terminated
            return (episode, outcome.observation, alive), jnp.where(alive, outcome.reward, 0.0)

        _, rewards = jax.lax.scan(one, (*functions.reset(numbers), True), length=STEPS)
        return (discounts * rewards).sum() / discounts.sum()

    def mean_value(weights: Weights, numbers: jax.Array, discount: float) -> jax.Array:
        discounts = discount ** jnp.arange(STEPS)
        return jax.vmap(value, (None, 0, None))(weights, numbers, discounts).mean()

    @jax.jit
    def update(weights, moments, numbers, count, rate, discount):  # type: ignore[no-untyped-def]
        reward, slopes = jax.value_and_grad(mean_value)(weights, numbers, discount)
        mean = jax.tree.map(lambda m, s: 0.9 * m + 0.1 * s, moments[0], slopes)
        square = jax.tree.map(lambda m, s: 0.999 * m + 0.001 * s * s, moments[1], slopes)
        step = rate * jnp.sqrt(1.0 - 0.999**count) / (1.0 - 0.9**count)
        moved = jax.tree.map(
            lambda w, m, s: w + step * m / (jnp.sqrt(s) + 1e-8), weights, mean, square
        )
        return moved, (mean, square), reward

    return update


def train(updates: int, seed: int) -> Weights:
    """The weights of the policy."""
    functions, start = VectorEnv(TASK).functions, perf_counter()
    sizes = [functions.observations, HIDDEN, HIDDEN, functions.actions]
    weights, generator = initial_weights(sizes, seed), np.random.default_rng(seed)
    zeros = jax.tree.map(jnp.zeros_like, weights)
    moments, update = (zeros, zeros), make_update(functions)
    for count in range(updates):
        done = count / updates
        numbers = functions.draw([generator] * STARTS).astype("float32")
        discount = 1.0 - (1.0 - NEAR) * ((1.0 - FAR) / (1.0 - NEAR)) ** min(1.0, 2.0 * done)
        weights, moments, reward = update(
            weights, moments, numbers, count + 1.0, RATE * (1.0 - done), discount
        )
        if count % 20 == 19 or count in (0, updates - 1):
            print(f"update {count + 1}: reward {reward:.3f}, {perf_counter() - start:.0f} s")
    return jax.tree.map(np.asarray, weights)


def scores_on_equations(weights: Weights, episodes: int) -> np.ndarray:
    """Total rewards of the episodes with seeds from zero on, in JAX."""
    env = VectorEnv(TASK, episodes)
    (observations, _), alive, scores = env.reset(seed=0), np.ones(episodes, bool), 0.0
    for _ in range(EPISODE_STEPS):
        actions = np.array([act(weights, observation) for observation in observations])
        observations, rewards, terminated, truncated, _ = env.step(actions)
        scores = scores + alive * rewards
        alive &= ~(terminated | truncated)
    return np.asarray(scores)


def scores_in_mujoco(weights: Weights, episodes: int) -> np.ndarray:
    """The same in MuJoCo."""
    env, scores = gymnasium.make(TASK), np.zeros(episodes)
    for seed in range(episodes):
        (observation, _), over = env.reset(seed=seed), False
        while not over:
            observation, reward, lost, late, _ = env.step(act(weights, observation))
            scores[seed], over = scores[seed] + reward, lost or late
    return scores


def load(file: str) -> Weights:
    """The weights in a file that ``--out`` has named."""
    arrays = [*np.load(file).values()]
    return list(zip(arrays[::2], arrays[1::2], strict=True))


def main() -> None:
    """Train, and print the score on starts that the training has not seen."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--updates", type=int, default=300, help="of the weights; default: 300")
    parser.add_argument("--seed", type=int, default=0, help="of weights and starts; default: 0")
    parser.add_argument("--out", help="file for the weights, .npz; default: none")
    arguments = parser.parse_args()
    start = perf_counter()
    weights = train(arguments.updates, arguments.seed)
    seconds, used = perf_counter() - start, sum(os.times()[:4])
    print(f"trained for {seconds:.0f} s, {used:.0f} s of processor time")
    for plant, score in (("equations", scores_on_equations), ("MuJoCo", scores_in_mujoco)):
        scores = score(weights, 20)
        print(f"{plant}: score {scores.mean():.1f}, standard deviation {scores.std():.1f}")
    if arguments.out:
        np.savez(arguments.out, *(array for layer in weights for array in layer))


if __name__ == "__main__":
    main()
