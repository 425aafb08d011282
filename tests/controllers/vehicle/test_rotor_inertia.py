"""The torques of the rotors' spin against derivatives of their angular momentum."""

from __future__ import annotations

import numpy as np
import pytest

from tests.controllers.vehicle.test_craft import each_case
from tiltsim_controllers.vehicle.craft import (
    accelerations_within_limits,
    hinge_torques,
    spin_torque,
)

H = 1e-4


@each_case
def test_the_spin_torque_is_minus_the_rate_of_angular_momentum(case):
    craft, axes, tilts = case.craft, case.axes, case.tilts
    rotors, rng = len(case.thrusts), np.random.default_rng(1)
    for _ in range(5):
        angles, rates = rng.uniform(-2.0, 2.0, (2, tilts))
        speeds, faster = rng.uniform(-2.0, 2.0, (2, rotors))
        omega = rng.uniform(-2.0, 2.0, 3)

        def momentum(time, angles=angles, rates=rates, speeds=speeds, faster=faster):
            return (speeds + time * faster) @ axes(angles + time * rates)

        found = spin_torque(craft, angles, rates, speeds, faster, omega)
        lost = -(momentum(H) - momentum(-H)) / (2.0 * H) - np.cross(omega, momentum(0.0))
        np.testing.assert_allclose(found, lost, rtol=0.0, atol=1e-6)


@each_case
def test_the_torque_about_the_hinges(case):
    """By virtual work: ``d/d alpha (varpi omega . d)``, and the reaction along the hinges."""
    craft, axes, tilts = case.craft, case.axes, case.tilts
    rotors, rng = len(case.thrusts), np.random.default_rng(2)
    for _ in range(5):
        angles, (speeds, faster) = (
            rng.uniform(-2.0, 2.0, tilts),
            rng.uniform(-2.0, 2.0, (2, rotors)),
        )
        omega = rng.uniform(-2.0, 2.0, 3)
        found = hinge_torques(craft, angles, speeds, faster, omega)
        for tilt, (hinge, one) in enumerate(zip(case.hinges, np.eye(tilts), strict=True)):
            beyond, before = axes(angles + H * one), axes(angles - H * one)
            turns = np.any(beyond != before, axis=1)
            expected = speeds @ (beyond - before) @ omega / (2.0 * H)
            expected -= turns * faster @ axes(angles) @ hinge
            assert found[tilt] == pytest.approx(expected, rel=0.0, abs=1e-6)
        assert len(found) == tilts


@pytest.mark.parametrize(
    ("speed", "acceleration", "expected"),
    [
        (5.0, 0.5, 0.5),
        (5.0, -0.5, -0.5),
        (10.0, 0.5, 0.0),
        (11.0, 0.5, 0.0),
        (10.0, -0.5, -0.5),
        (1.0, -0.5, 0.0),
        (0.5, -0.5, 0.0),
        (1.0, 0.5, 0.5),
    ],
)
def test_no_rotor_accelerates_beyond_a_limit(speed, acceleration, expected):
    for spins in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)):  # limits are along the spin
        signs = np.array(spins)
        found = accelerations_within_limits(signs, signs * speed, signs * acceleration, 1.0, 10.0)
        np.testing.assert_array_equal(found, signs * expected)
