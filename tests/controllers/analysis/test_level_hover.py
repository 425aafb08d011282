"""Tilts that hold any multirotor level against an acceleration."""

from __future__ import annotations

from math import atan

import numpy as np
import pytest

from tiltsim_controllers.analysis.hover import BALANCED, LEVEL_RESERVE, level_hover
from tiltsim_controllers.vehicle.cross import torque_free_force
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio
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


def factors(tilts):
    """``A`` and ``B``, the yaw levers of rotors 1 and 3 and of 2 and 4 relative to no tilt."""
    twist = 2.0 * atan(drag_ratio(AR_DRONE))
    sums = twist - tilts[0] - tilts[2], twist + tilts[1] + tilts[3]
    return np.sin(sums) / np.sin(twist)


def test_the_torque_free_force_of_four_rotors_factors():
    """``n = (A sin D24, -B sin D13, ...)`` of sums E and differences D of opposite tilts."""
    ratio = drag_ratio(AR_DRONE)
    delta = atan(ratio)
    for tilts in np.random.default_rng(0).uniform(-1.5, 1.5, (20, 4)):
        (e13, e24), (d13, d24), (a, b) = (
            tilts[:2] + tilts[2:],
            tilts[:2] - tilts[2:],
            factors(tilts),
        )
        n = (
            a * np.sin(d24),
            -b * np.sin(d13),
            a * (np.cos(e24 + delta) / np.cos(delta) + np.cos(d24))
            + b * (np.cos(e13 - delta) / np.cos(delta) + np.cos(d13)),
        )
        np.testing.assert_allclose(n, torque_free_force(tilts, ratio), rtol=0, atol=1e-13)


@pytest.mark.parametrize("vertical", [-3.0, 0.0, 5.0])
def test_a_vertical_acceleration_needs_no_tilt(vertical):
    tilts, _ = level_hover(arms(4), needed((0.0, 0.0, vertical)), box(4))
    np.testing.assert_array_equal(tilts, 0.0)


@pytest.mark.parametrize(
    "acceleration", [(1, 0, 0), (1, 1, 0), (1.2, 0.5, -1), (-2, 0.7, 0), (-2, 1, 0.5)]
)
def test_four_rotors_balance_an_acceleration_with_the_least_tilts(acceleration):
    """The force along ``n`` opposes it; along the balanced tilts no step shortens their sum."""
    desired, ratio = needed(acceleration), drag_ratio(AR_DRONE)
    tilts, _ = level_hover(arms(4), desired, box(4))

    def side(point):
        n = torque_free_force(point, ratio)
        return n[:2] - desired[:2] / desired[2] * n[2]

    np.testing.assert_allclose(side(tilts), 0.0, atol=1e-8)
    slopes = [(side(tilts + h) - side(tilts - h)) / 2e-6 for h in 1e-6 * np.eye(4)]
    along = tilts - slopes @ np.linalg.lstsq(slopes, tilts, rcond=None)[0]
    np.testing.assert_allclose(along, 0.0, atol=1e-6)


def test_mirrored_accelerations_have_mirrored_gaits():
    """Half a revolution about the vertical exchanges rotors 1 and 3, and 2 and 4."""
    there, back = (
        level_hover(arms(4), needed((s * 1.3, s * 0.4, 0.0)), box(4))[0] for s in (1, -1)
    )
    np.testing.assert_allclose(back, there[[2, 3, 0, 1]], rtol=0, atol=1e-6)


def test_the_gust_of_chapter_1():
    """1 m/s^2 along +x: our own figures, the thesis prints none."""
    tilts, w = level_hover(arms(4), needed((1.0, 0.0, 0.0)), box(4))
    np.testing.assert_allclose(tilts, (-0.0346, -0.2258, -0.0346, 0.0725), atol=1e-4)
    loads = np.abs(w) / np.abs(w).mean()
    np.testing.assert_allclose(loads, (0.63, 1.35, 0.63, 1.39), atol=0.01)
    even = (0.0, -0.20557, 0.0, 0.20557)  # loads all rotors alike
    assert np.linalg.norm(tilts) < 0.85 * np.linalg.norm(even)


def test_two_rotors_on_a_pod_tilt_together():
    tilts, _ = level_hover(arms(6, pods=(0, 1, 2, 0, 1, 2)), needed((0.0, 0.5, 0.0)), box(6))
    assert tilts.shape == (3,)


def test_without_a_balance_the_result_is_none():
    sideways = needed((1.0, 0.0, 0.0))
    assert level_hover(arms(6, hinged=False), sideways, box(6)) is None
    assert level_hover(arms(6), sideways, box(6), max_tilt=0.01) is None
    assert level_hover(arms(6), sideways, box(6, highest=100.0)) is None
