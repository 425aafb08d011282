"""Euler's equations against NumPy and against their own derivative."""

from __future__ import annotations

import numpy as np
import pytest

from tiltsim_controllers.vehicle.rigid_body import angular_acceleration, cross, torque_rate

INERTIA = (2.0e-3, 3.0e-3, 5.0e-3)
CASES = 10


def random_triples(seed, count):
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (CASES, count, 3))


def test_the_cross_product_is_numpys():
    for a, b in random_triples(0, 2):
        np.testing.assert_allclose(cross(tuple(a), tuple(b)), np.cross(a, b), rtol=1e-12)


@pytest.mark.parametrize("gyroscopic", [0.0, 0.5, 1.0])
def test_eulers_equations_with_and_without_the_gyroscopic_torque(gyroscopic):
    matrix = np.diag(INERTIA)
    for torque, omega in random_triples(1, 2):
        found = angular_acceleration(tuple(torque), tuple(omega), INERTIA, gyroscopic)
        left = torque - gyroscopic * np.cross(omega, matrix @ omega)
        np.testing.assert_allclose(matrix @ found, left, rtol=1e-12)


@pytest.mark.parametrize("gyroscopic", [0.0, 0.5, 1.0])
def test_the_torque_changes_as_the_motion_needs(gyroscopic):
    """Along ``omega(t) = omega + t omega' + t^2 omega'' / 2``, by central differences."""
    matrix, h = np.diag(INERTIA), 1e-4

    def torque(t, omega, rate, jerk):
        now = omega + t * rate + 0.5 * t * t * jerk
        return matrix @ (rate + t * jerk) + gyroscopic * np.cross(now, matrix @ now)

    for motion in random_triples(2, 3):
        expected = (torque(h, *motion) - torque(-h, *motion)) / (2 * h)
        found = torque_rate(*map(tuple, motion), INERTIA, gyroscopic)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
