"""Least squares within bounds, against general solvers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from tiltsim_controllers.laws.allocation import bounded_least_squares

SOFTNESS = np.array([1e-3, 1e-3, 1e-8, 1e-10, 1e-10, 1e-9])


def example(seed, size):
    random = np.random.default_rng(seed)
    matrix, demand = random.normal(size=(6, size)), random.normal(size=6)
    return matrix, demand, random.uniform(0.5, 2.0, size), 0.1 * random.normal(size=size)


@pytest.mark.parametrize("size", [4, 8, 16])
def test_without_limits_it_is_the_least_squares_solution(size):
    matrix, demand, weights, start = example(size, size)
    wide = np.full(size, 1e6)
    found = bounded_least_squares(matrix, demand, SOFTNESS, weights, start, -wide, wide)
    rows = np.vstack([matrix / np.sqrt(SOFTNESS)[:, None], np.diag(np.sqrt(weights))])
    values = np.hstack([demand / np.sqrt(SOFTNESS), np.sqrt(weights) * start])
    np.testing.assert_allclose(found, np.linalg.lstsq(rows, values)[0], atol=2e-6)


@pytest.mark.parametrize("seed", range(40))
def test_within_limits_it_is_the_optimum(seed):
    """Inputs that stopped are let go again where the gradient leads inward."""
    size = (4, 6, 8, 16)[seed % 4]
    matrix, demand, weights, start = example(seed, size)
    low, high = np.full(size, -0.5), np.full(size, 0.7)
    low[seed % size] = high[seed % size] = 0.1  # one cannot move
    found = bounded_least_squares(matrix, demand, SOFTNESS, weights, start, low, high)
    rows = np.vstack([matrix / np.sqrt(SOFTNESS)[:, None], np.diag(np.sqrt(weights))])
    values = np.hstack([demand / np.sqrt(SOFTNESS), np.sqrt(weights) * start])
    bounds = (low - 1e-15, high)  # the solver's limits differ
    best = lsq_linear(rows, values, bounds, method="bvls", tol=1e-15).x
    least, cost = (((rows @ x - values) ** 2).sum() for x in (best, found))
    assert ((found >= low) & (found <= high)).all()
    assert ((found == low) | (found == high)).sum() > 1 or size == 16
    assert cost <= least * (1.0 + 1e-9)
