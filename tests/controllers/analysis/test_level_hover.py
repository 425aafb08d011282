"""Tilts that hold any multirotor level against an acceleration."""

from __future__ import annotations

import numpy as np
import pytest

from tiltsim_controllers.analysis.balance import balanced_gait
from tiltsim_controllers.analysis.hover import BALANCED, LEVEL_RESERVE, level_hover
from tiltsim_controllers.vehicle.parameters import PRESETS
from tiltsim_controllers.vehicle.rotors import force_and_torque, rotor_entries

AR_DRONE = PRESETS["ar_drone_2"]
WIDE = 1e6


def arms(count, *, pods=None, hinged=True):
    """Equal arms evenly round, each tilting about itself; ``pods`` gives the tilt of each rotor."""
    table = []
    for i in range(count):
        angle = 2.0 * np.pi * i / count
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        place, spin = AR_DRONE.arm_length * out, (-1.0) ** (i + 1)
        tilt = i if pods is None else pods[i]
        hinge = {"tilt": tilt, "hinge": place, "hinge_axis": out} if hinged else {}
        thrust, drag = AR_DRONE.thrust_coefficient, AR_DRONE.drag_coefficient
        table += rotor_entries(place, (0.0, 0.0, 1.0), thrust, drag, spin, **hinge)
    return tuple(table)


def box(count, highest=WIDE):
    spins = (-1.0) ** (np.arange(count) + 1)
    ends = np.outer([0.0, highest], spins)
    return ends.min(axis=0), ends.max(axis=0)


def needed(acceleration):
    return AR_DRONE.mass * (np.array([0.0, 0.0, AR_DRONE.gravity]) - acceleration)


@pytest.mark.parametrize("rotors", [4, 6, 7])
@pytest.mark.parametrize("acceleration", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (-0.5, 1.5, 0.3)])
def test_the_tilts_balance_and_every_rotor_keeps_its_reserve(rotors, acceleration):
    table, force = arms(rotors), needed(acceleration)
    tilts, w = level_hover(table, force, box(rotors))
    made, torque = (matrix @ w for matrix in force_and_torque(table, tilts))
    weight = np.linalg.norm(force)
    np.testing.assert_allclose(made, force, atol=10.0 * BALANCED * weight)
    np.testing.assert_allclose(torque, 0.0, atol=10.0 * BALANCED * weight * AR_DRONE.arm_length)
    least = LEVEL_RESERVE * weight / AR_DRONE.thrust_coefficient / rotors
    assert np.abs(w).min() > 0.999999 * least
    if acceleration == (0.0, 0.0, 0.0):
        np.testing.assert_allclose(tilts, 0.0, atol=1e-6)


def test_four_rotors_tilt_as_the_closed_form_says():
    tilts, _ = level_hover(arms(4), needed((1.0, 0.0, 0.0)), box(4))
    np.testing.assert_allclose(tilts, balanced_gait((1.0, 0.0, 0.0), AR_DRONE), atol=1e-5)


def test_two_rotors_on_a_pod_tilt_together():
    tilts, _ = level_hover(arms(6, pods=(0, 1, 2, 0, 1, 2)), needed((0.0, 0.5, 0.0)), box(6))
    assert tilts.shape == (3,)


def test_without_a_balance_the_result_is_none():
    sideways = needed((1.0, 0.0, 0.0))
    assert level_hover(arms(6, hinged=False), sideways, box(6)) is None
    assert level_hover(arms(6), sideways, box(6), max_tilt=0.01) is None
    assert level_hover(arms(6), sideways, box(6, highest=100.0)) is None
