"""Directions without torque that move with the pods, against null spaces and differences."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from scipy.linalg import null_space

from tests.controllers.multirotors import ring, tiltrotor
from tiltsim_controllers.laws.force_directions import (
    moving_direction,
    nearest_in_plane,
    normal_of_plane,
)
from tiltsim_controllers.mathematics.moving import Moving
from tiltsim_controllers.vehicle.rotors import (
    force_and_torque,
    moving_wrench_map,
    rotors_in,
    tilt_of_rotor,
    tilts_of,
)

H = 1e-3


def jets_of(function):
    """Value and first two derivatives of a function of time at 0, shape (components, 3)."""
    far_before, before, now, after, far_after = (function(k * H) for k in range(-2, 3))
    first = (far_before - 8.0 * before + 8.0 * after - far_after) / (12.0 * H)
    second = (-far_before + 16.0 * before - 30.0 * now + 16.0 * after - far_after) / (12.0 * H * H)
    return np.transpose([now, first, second])


def at(jets, time):
    """Jets as polynomials."""
    return np.array(jets) @ (1.0, time, 0.5 * time * time)


def random_jets(rng, count):
    return tuple(map(tuple, rng.uniform(-2.0, 2.0, (count, 3))))


def derivatives(moving):
    """Value and derivatives as columns."""
    return np.transpose([moving.value, moving.rate, moving.acceleration])


def unit(vector):
    return vector / np.linalg.norm(vector)


@pytest.mark.parametrize(("vehicle", "dimension"), [("four", 1), ("five", 2)])
def test_the_direction_turns_as_the_null_space_of_the_torque(vehicle, dimension):
    """With four rotors one force has no torque, with five all forces in a plane."""
    table = tiltrotor().table if vehicle == "four" else ring(5, hinged=True)
    layout = tilt_of_rotor(table)
    rotors = rotors_in(table, 0, layout)
    rng = np.random.default_rng(3)
    for _ in range(5):
        tilts = random_jets(rng, tilts_of(layout))
        up = unit(rng.normal(size=3))
        wrench = moving_wrench_map(rotors, Moving(*np.transpose(tilts)))
        found = derivatives(moving_direction(wrench, up, dimension))

        def without_torque(time, tilts=tilts, found=found):
            force, torque = force_and_torque(table, at(tilts, time))
            forces = (force / 1e-5) @ null_space(torque / 1e-6)
            one = forces[:, 0] if dimension == 1 else np.cross(*forces.T)
            return unit(one) * np.sign(one @ np.array(found)[:, 0])

        expected = jets_of(without_torque)
        turned = jets_of(lambda time, found=found: unit(at(found, time)))
        scale = 1.0 + np.abs(expected).max(axis=0)
        np.testing.assert_allclose(turned / scale, expected / scale, rtol=0.0, atol=1e-5)


def test_the_projection_onto_a_moving_plane_has_the_right_derivatives():
    rng = np.random.default_rng(4)
    for _ in range(5):
        desired, normal = random_jets(rng, 3), random_jets(rng, 3)

        def nearest(time, desired=desired, normal=normal):
            across = unit(at(normal, time))
            vector = at(desired, time)
            return vector - across * (across @ vector)

        pair = (Moving(*np.transpose(jets)) for jets in (desired, normal))
        found, expected = derivatives(nearest_in_plane(*pair)), jets_of(nearest)
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


def test_the_normal_is_perpendicular_to_the_plane_even_if_two_vectors_are_parallel():
    rng = np.random.default_rng(5)
    one, other = rng.normal(size=(2, 3))
    across = unit(np.cross(one, other))
    for vectors in ((one, 2.0 * one, other), (one, other, -other), (other, one, 3.0 * other)):
        found = normal_of_plane(np.transpose(vectors))
        np.testing.assert_allclose(np.sign(found @ across) * np.array(found), across, atol=1e-12)
    # The best conditioned pair decides where all three differ a little.
    for vectors in permutations((one, one + 1e-9 * other, other)):
        found = normal_of_plane(np.transpose(vectors))
        np.testing.assert_allclose(np.cross(found, across), 0.0, atol=1e-12)
