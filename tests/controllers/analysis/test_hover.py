"""Hover and attainable forces of any number of rotors, against linear programs and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from tiltsim_controllers.analysis import singularity
from tiltsim_controllers.analysis.attainable import (
    TiltedRotors,
    attainable_forces,
    attainable_torques,
    input_box,
    level_side_forces,
    side_force_share,
)
from tiltsim_controllers.analysis.hover import RESERVE, hover, rotor_losses
from tiltsim_controllers.analysis.singularity import hover_rotor_speeds
from tiltsim_controllers.vehicle.parameters import PRESETS

WEIGHT, THRUST, FASTEST = 15.0, 8.5e-6, 838.0
AR_DRONE = PRESETS["ar_drone_2"]


def ring(rotors=6, cant=0.0, spins=None):
    """Rotors evenly round the body's z axis, canted about their arms by turns."""
    around = 2.0 * np.pi * np.arange(rotors) / rotors
    by_turns = (-1.0) ** np.arange(rotors)
    spins = -by_turns if spins is None else np.array(spins)
    out = np.stack([np.cos(around), np.sin(around), np.zeros(rotors)])
    side = np.stack([np.sin(around), -np.cos(around), np.zeros(rotors)])
    axes = np.array([[0.0], [0.0], [1.0]]) * np.cos(cant) + side * np.sin(cant) * by_turns
    force = THRUST * spins * axes
    torque = np.cross(0.215 * out, force, axis=0) - 0.016 * spins * force
    ends = np.outer([0.0, FASTEST**2], spins)
    return TiltedRotors(force, torque, ends.min(axis=0), ends.max(axis=0), WEIGHT)


def random_rotors(rng, rotors, *, lift=3.0):
    """Rotors that may turn either way, which can make ``lift`` times the weight."""
    axes, places = rng.normal(size=(2, 3, rotors))
    axes = THRUST * axes / np.linalg.norm(axes, axis=0)
    torque = np.cross(0.3 * places, axes, axis=0) + 0.02 * rng.choice((-1.0, 1.0), rotors) * axes
    upper = np.full(rotors, lift * WEIGHT / (rotors * THRUST))
    return TiltedRotors(axes, torque, -upper * rng.choice((0.0, 1.0), rotors), upper, WEIGHT)


def least_of(rotors, cost, conditions, values):
    """A linear program over the inputs; its optimum, or None where nothing is admissible."""
    unit = np.abs([rotors.lower, rotors.upper]).max()
    size = np.linalg.norm(conditions, axis=1, keepdims=True) * unit
    found = linprog(
        cost * unit,
        A_eq=conditions * unit / size,
        b_eq=values / size[:, 0],
        bounds=np.stack([rotors.lower, rotors.upper], axis=1) / unit,
    )
    return found.fun if found.status == 0 else None


@pytest.mark.parametrize("rotors", [4, 5, 7, 8])
def test_attainable_sets_have_the_support_of_linear_programs(rotors):
    rng = np.random.default_rng(rotors)
    given = random_rotors(rng, rotors)
    up = np.array([0.0, 0.6, 0.8])
    sets = [
        (attainable_forces(given), given.force, given.torque, np.zeros(3)),
        (attainable_torques(given, up), given.torque, (up @ given.force)[None], [WEIGHT]),
    ]
    for found, image, conditions, values in sets:
        for direction in rng.normal(size=(3, 3)):
            reached = -least_of(given, -direction @ image, conditions, np.array(values))
            assert (found.vertices @ direction).max() == pytest.approx(reached, abs=1e-6)


@pytest.mark.parametrize("dimension", [0, 1, 2, 3])
def test_the_hover_leans_least_of_all_directions(dimension):
    """A linear program says for each of many directions whether the rotors can hover along it."""
    rng = np.random.default_rng(dimension)
    hovers = 0
    for _ in range(4):
        given = random_rotors(rng, 3 + dimension, lift=4.0)
        found = hover(given)
        if found is not None and found.controllable:
            reserve = RESERVE * WEIGHT / (given.lower.size * THRUST)
            given = given._replace(lower=given.lower + reserve, upper=given.upper - reserve)
        rows = np.vstack([given.torque, given.force])
        directions = rng.normal(size=(15, 3)) @ np.linalg.svd(given.force)[0]
        directions = [up / np.linalg.norm(up) for up in directions]
        if found is not None:
            hovers += 1
            w = found.rotor_speeds * np.abs(found.rotor_speeds)
            np.testing.assert_allclose(given.torque @ w, 0.0, atol=1e-6)
            np.testing.assert_allclose(given.force @ w, found.force, atol=1e-6)
            assert np.linalg.norm(found.force) == pytest.approx(WEIGHT, rel=1e-6)
            assert np.cos(found.lean) == pytest.approx(found.force[2] / WEIGHT, abs=1e-6)
            directions = [up for up in directions if up[2] > np.cos(found.lean) + 1e-6]
        for up in directions:
            values = np.concatenate([np.zeros(3), WEIGHT * up])
            assert least_of(given, np.zeros(3 + dimension), rows, values) is None
    assert (hovers > 0) == (dimension > 0)


def test_a_planar_hexarotor_without_a_rotor_hovers_on_four_and_cannot_be_controlled():
    intact, losses = hover(ring()), rotor_losses(ring())
    even = np.sqrt(WEIGHT / (6.0 * THRUST))
    np.testing.assert_allclose(np.abs(intact.rotor_speeds), even, rtol=1e-6)
    assert (intact.lean, intact.controllable) == (0.0, True)
    for lost, found in enumerate(losses):
        expected = np.full(6, np.sqrt(1.5) * even)
        expected[[lost, (lost + 3) % 6]] = 0.0
        np.testing.assert_allclose(np.abs(found.rotor_speeds), expected, atol=0.2)
        assert (found.lean, found.controllable) == (0.0, False)


def test_a_hexarotor_with_spins_in_pairs_survives_some_losses():
    """The order of spins + + - - + - keeps control without rotor 1, 2, 3 or 4."""
    losses = rotor_losses(ring(spins=(1.0, 1.0, -1.0, -1.0, 1.0, -1.0)))
    survived = [found is not None and found.controllable for found in losses]
    assert survived == [True] * 4 + [False] * 2


def test_side_force_of_a_fixed_cant_hexarotor():
    """Without torque and at constant lift the three pairs of neighbors share the side force."""
    assert side_force_share(ring()) == 0.0
    assert level_side_forces(ring()).dimension == 0
    share = side_force_share(ring(cant=np.radians(25.0)))
    assert share == pytest.approx(0.2332, abs=1e-3)
    reversible = ring(cant=np.radians(25.0))
    weak = reversible._replace(lower=0.7 * reversible.lower, upper=0.7 * reversible.upper)
    assert 0.0 < side_force_share(weak) < share
    heavy = weak._replace(weight=2.0 * WEIGHT)
    assert level_side_forces(heavy).is_empty
    assert (side_force_share(heavy), hover(heavy)) == (0.0, None)


@pytest.mark.parametrize("tilts", [(0.0,) * 4, (0.3, -0.2, 0.3, -0.2), (-0.3, 0.4, 0.1, 0.2)])
def test_four_rotors_hover_as_the_closed_forms_say(tilts):
    factor = AR_DRONE.thrust_coefficient
    torque = singularity.torque_matrix(tilts, AR_DRONE) * factor * AR_DRONE.arm_length
    force, box = singularity.force_matrix(tilts) * factor, input_box((0.0, 900.0))
    rotors = TiltedRotors(force, torque, *box, AR_DRONE.mass * AR_DRONE.gravity)
    spins = np.array([-1.0, 1.0, -1.0, 1.0])
    found, expected = hover(rotors), np.array(hover_rotor_speeds(tilts, AR_DRONE))
    np.testing.assert_allclose(found.rotor_speeds, spins * expected, rtol=1e-6)
    assert np.sin(found.lean) == pytest.approx(
        np.cos(singularity.singularity_margin(tilts, AR_DRONE)), abs=1e-6
    )
