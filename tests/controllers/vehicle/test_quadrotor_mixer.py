"""The quadrotor's mixer against ch. 3's force and torque matrices without tilt."""

from __future__ import annotations

import numpy as np
import pytest

from tests.thesis import force_matrix, torque_matrix
from tiltsim_controllers.vehicle.cross import speed_along_spin, thrust_controls
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN

WRENCHES = np.random.default_rng(4).uniform(-1.0, 1.0, (20, 4)) * (6.0, 0.5, 0.5, 0.1)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("wrench", WRENCHES)
def test_the_rotors_make_the_requested_thrust_and_torques(preset, wrench):
    vehicle = PRESETS[preset]
    speeds = [
        sign * speed_along_spin(control)
        for sign, control in zip(SPIN, thrust_controls(tuple(wrench), vehicle))
    ]
    w = np.array([speed * abs(speed) for speed in speeds])
    force = force_matrix(vehicle, (0.0, 0.0, 0.0, 0.0)) @ w
    torque = torque_matrix(vehicle, (0.0, 0.0, 0.0, 0.0)) @ w
    np.testing.assert_allclose(force, [0.0, 0.0, wrench[0]], atol=1e-12)
    np.testing.assert_allclose(torque, wrench[1:], atol=1e-13)


def test_hover_takes_the_hover_speed():
    vehicle = PRESETS["ar_drone_2"]
    controls = thrust_controls((vehicle.mass * vehicle.gravity, 0.0, 0.0, 0.0), vehicle)
    speeds = [speed_along_spin(control) for control in controls]
    np.testing.assert_allclose(speeds, vehicle.hover_rotor_speed)


def test_a_rotor_that_must_pull_turns_against_its_spin():
    assert speed_along_spin(-4.0) == -2.0
