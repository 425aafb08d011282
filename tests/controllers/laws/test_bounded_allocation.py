"""Least squares within bounds, against general solvers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from tiltsim_controllers.laws.allocation import bounded_least_squares

SOFTNESS = np.array([1e-3, 1e-3, 1e-10, 1e-12, 1e-12, 1e-9])


def example(seed, size):
    random = np.random.default_rng(seed)
    matrix, demand = random.normal(size=(6, size)), random.normal(size=6)
    return matrix, demand, random.uniform(0.5, 2.0, size), 0.1 * random.normal(size=size)


def cost(x, matrix, demand, weights, start):
    return ((matrix @ x - demand) ** 2 / SOFTNESS).sum() + (weights * (x - start) ** 2).sum()


@pytest.mark.parametrize("size", [4, 8, 16])
def test_without_limits_it_is_the_least_squares_solution(size):
    matrix, demand, weights, start = example(size, size)
    wide = np.full(size, 1e6)
    found = bounded_least_squares(matrix, demand, SOFTNESS, weights, start, -wide, wide)
    rows = np.vstack([matrix / np.sqrt(SOFTNESS)[:, None], np.diag(np.sqrt(weights))])
    values = np.hstack([demand / np.sqrt(SOFTNESS), np.sqrt(weights) * start])
    np.testing.assert_allclose(found, np.linalg.lstsq(rows, values)[0], atol=2e-6)


@pytest.mark.parametrize("seed", range(20))
def test_within_limits_it_is_close_to_the_optimum(seed):
    """Inputs that left are not taken back, so that the optimum may be lower, never higher."""
    matrix, demand, weights, start = example(seed, 8)
    low, high = np.full(8, -0.5), np.full(8, 0.7)
    found = bounded_least_squares(matrix, demand, SOFTNESS, weights, start, low, high)
    assert (found >= low).all()
    assert (found <= high).all()
    rows = np.vstack([matrix / np.sqrt(SOFTNESS)[:, None], np.diag(np.sqrt(weights))])
    values = np.hstack([demand / np.sqrt(SOFTNESS), np.sqrt(weights) * start])
    best = lsq_linear(rows, values, (low, high), tol=1e-14).x
    clipped = np.clip(np.linalg.lstsq(rows, values)[0], low, high)
    costs = [cost(x, matrix, demand, weights, start) for x in (best, found, clipped)]
    assert costs[0] <= costs[1] * (1.0 + 1e-6)
    assert costs[1] <= costs[2] * (1.0 + 1e-12)
