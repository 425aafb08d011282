"""Hover with fixed tilt angles against ch. 3's force and torque matrices."""

from __future__ import annotations

from math import atan, pi

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.statics import hover_attitude
from tests.thesis import force_matrix, torque_matrix
from tiltsim_controllers.analysis.singularity import hover_rotor_speeds
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN, drag_ratio

VEHICLE = PRESETS["ar_drone_2"]
TILTS = [(-0.65, -0.65, 0.65, 0.65), (-0.2, -0.3, 0.4, 0.1), (0.3, -0.1, 0.2, -0.3), (0.0,) * 4]


def squares(speeds):
    """``w``: rotor speeds along the spins, squared with their signs."""
    return np.multiply(SPIN, np.multiply(speeds, np.abs(speeds)))


@pytest.mark.parametrize("tilts", TILTS)
def test_the_rotors_carry_the_weight_without_torque(tilts):
    w = squares(hover_rotor_speeds(tilts, VEHICLE))
    weight = VEHICLE.mass * VEHICLE.gravity
    torque, force = torque_matrix(VEHICLE, tilts) @ w, force_matrix(VEHICLE, tilts) @ w
    np.testing.assert_allclose(torque, 0.0, atol=1e-12 * weight)
    assert np.linalg.norm(force) == pytest.approx(weight, rel=1e-12)
    assert force[2] > 0.0


@pytest.mark.parametrize("tilts", TILTS)
def test_at_the_attitude_of_hover_the_force_is_vertical(tilts):
    force = force_matrix(VEHICLE, tilts) @ squares(hover_rotor_speeds(tilts, VEHICLE))
    roll, pitch = hover_attitude(tilts, VEHICLE)
    world = Rotation.from_euler("ZYX", [0.0, pitch, roll]).apply(force)
    expected = [0.0, 0.0, VEHICLE.mass * VEHICLE.gravity]
    np.testing.assert_allclose(world, expected, atol=1e-12 * expected[2])


def test_without_tilt_all_rotors_turn_alike():
    assert hover_rotor_speeds((0.0,) * 4, VEHICLE) == pytest.approx([VEHICLE.hover_rotor_speed] * 4)


def test_there_is_no_hover_without_a_direction_free_of_torque_that_points_up():
    delta = atan(drag_ratio(VEHICLE))  # the torque matrix loses its rank
    assert hover_rotor_speeds((delta, -delta, delta, -delta), VEHICLE) is None
    level = (pi / 2, pi / 2, -pi / 2, -pi / 2)
    force = force_matrix(VEHICLE, level)
    assert np.abs(force[2]).max() < 1e-20  # no thrust has a vertical part
    assert hover_rotor_speeds(level, VEHICLE) is None
