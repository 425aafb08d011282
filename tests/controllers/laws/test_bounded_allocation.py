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


@pytest.mark.parametrize("softest", [1e-2, 1e-1])
@pytest.mark.parametrize("size", [4, 8, 16])
def test_within_limits_it_is_the_optimum(size, softest):
    """Without the release of limits that no longer hold, half of the cases miss it."""
    softness = softest * np.array([1.0, 1.0, 1e-4, 1e-5, 1e-5, 1e-4])
    released = 0
    for seed in range(40):
        matrix, demand, weights, start = example(seed, size)
        low, high = np.full(size, -0.3), np.full(size, 0.4)
        low[0] = high[0] = 0.1  # one cannot move
        found = bounded_least_squares(matrix, demand, softness, weights, start, low, high)
        rows = np.vstack([matrix / np.sqrt(softness)[:, None], np.diag(np.sqrt(weights))])
        values = np.hstack([demand / np.sqrt(softness), np.sqrt(weights) * start])
        rows, values = rows[:, 1:], values - 0.1 * rows[:, 0]
        bounds = low[1:], high[1:]
        best = lsq_linear(rows, values, bounds, method="bvls", tol=1e-15, max_iter=999).x
        np.testing.assert_allclose(found[1:], best, atol=1e-9)
        released += abs(np.clip(np.linalg.lstsq(rows, values)[0], *bounds) - best).max() > 1e-6
    assert released > 20
