"""Any body's inertia against NumPy, its rotational equation of motion against differences."""

from __future__ import annotations

import numpy as np
import pytest

from tiltsim_controllers.vehicle.body import (
    angular_acceleration,
    body_of,
    inertia_matrix,
    inverse_inertia_matrix,
    torque_rate,
)

INERTIA = np.array([[2.0e-3, 3.0e-4, -4.0e-4], [3.0e-4, 3.0e-3, 5.0e-4], [-4.0e-4, 5.0e-4, 4.0e-3]])
BODY = body_of(0.5, INERTIA, 9.81)
CASES = 5


def random_triples(seed, count):
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (CASES, count, 3))


def test_products_of_inertia_are_included():
    np.testing.assert_array_equal(inertia_matrix(BODY), INERTIA)
    np.testing.assert_allclose(inverse_inertia_matrix(BODY) @ INERTIA, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("gyroscopic", [0.0, 0.5, 1.0])
def test_angular_acceleration_and_torque_rate_obey_the_equation_of_motion(gyroscopic):
    """Along ``omega(t) = omega + t omega' + t^2 omega'' / 2``, by central differences."""
    h = 1e-4

    def torque(t, omega, rate, jerk):
        now = omega + t * rate + 0.5 * t * t * jerk
        return INERTIA @ (rate + t * jerk) + gyroscopic * np.cross(now, INERTIA @ now)

    for omega, rate, jerk in random_triples(1, 3):
        needed = tuple(torque(0.0, omega, rate, jerk))
        found = angular_acceleration(BODY, np.array(needed), omega, gyroscopic)
        np.testing.assert_allclose(found, rate, rtol=1e-12)
        expected = (torque(h, omega, rate, jerk) - torque(-h, omega, rate, jerk)) / (2.0 * h)
        found = torque_rate(BODY, omega, rate, jerk, gyroscopic)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)
