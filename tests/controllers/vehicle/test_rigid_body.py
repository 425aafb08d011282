"""Products of vectors against NumPy."""

from __future__ import annotations

import numpy as np

from tiltsim_controllers.vehicle.rigid_body import cross

CASES = 10


def random_triples(seed, count):
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (CASES, count, 3))


def test_the_cross_product_is_numpys():
    for a, b in random_triples(0, 2):
        np.testing.assert_allclose(cross(tuple(a), tuple(b)), np.cross(a, b), rtol=1e-12)
