"""Singular attitudes for any number of rotors, from the forces that they make without torque.

Checked without them: as the last row of ``B = [tau; up^T F]`` is linear in ``up``, the determinant
of ``B B^T`` is a quadratic form in ``up``, found from six values of it. Its null space is the set
of singular directions of world up.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tiltsim_controllers.analysis import singularity
from tiltsim_controllers.analysis.torque_free import (
    SINGULAR_ATTITUDES,
    TorqueFreeForces,
    controlled_axes,
    hover_direction,
    margin_over_flight,
    singularity_margin,
    torque_free_forces,
)
from tiltsim_controllers.vehicle.parameters import PRESETS

ZERO = 1e-9
DIMENSIONS = {
    "any": {1, 2, 3},
    "parallel": {0, 1},  # 0 where drag and lift are proportional
    "axes in a plane": {1, 2},
    "coaxial pairs": {0, 1, 2, 3},
    "torques in a plane": set(),
}
"""Dimensions of the torque-free forces that occur, by the kind of vehicle."""
KINDS = tuple(DIMENSIONS)


def random_vehicle(rng, kind):
    """F and tau, each of shape (3, N), of 4 to 12 rotors."""
    rotors = int(rng.integers(4, 7 if kind == "torques in a plane" else 13))
    places, axes = 0.3 * rng.normal(size=(rotors, 3)), rng.normal(size=(rotors, 3))
    if kind == "parallel":
        axes = np.outer(rng.choice((-1.0, 1.0), rotors), rng.normal(size=3))
    elif kind == "axes in a plane":
        axes = rng.normal(size=(rotors, 2)) @ rng.normal(size=(2, 3))
    elif kind == "coaxial pairs":
        pairs = rotors // 2 * 2
        axes[1:pairs:2] = axes[:pairs:2]
        places[1:pairs:2] = places[:pairs:2] + 0.1 * axes[:pairs:2]
    axes /= np.linalg.norm(axes, axis=1)[:, np.newaxis]
    drag = rng.choice((-1.0, 1.0), rotors) * rng.uniform(0.01, 0.05)
    torque = (np.cross(places, axes) - drag[:, np.newaxis] * axes).T
    if kind == "torques in a plane":
        torque[2] = 0.3 * torque[0] - 0.8 * torque[1]
    return axes.T, torque


def by_determinants(force, torque):
    """The quadratic form det(B B^T) of world up, shape (3, 3)."""

    def value(up):
        matrix = np.vstack([torque, up @ force])
        return np.linalg.det(matrix @ matrix.T)

    axes = np.eye(3)
    form = np.diag([value(axis) for axis in axes])
    for i, j in itertools.combinations(range(3), 2):
        form[i, j] = form[j, i] = 0.5 * (value(axes[i] + axes[j]) - form[i, i] - form[j, j])
    return form


@pytest.mark.parametrize("kind", KINDS)
def test_singularity_follows_from_the_torque_free_forces(kind):
    rng = np.random.default_rng(KINDS.index(kind))
    dimensions = set()
    for _ in range(40):
        force, torque = random_vehicle(rng, kind)
        found = torque_free_forces(force, torque)
        assert found.rank == np.linalg.matrix_rank(torque, tol=ZERO)
        form, scale = by_determinants(force, torque), np.linalg.det(torque @ torque.T)
        if found.rank < 3:
            assert found.dimension == 0
            assert np.abs(form).max() < ZERO * np.linalg.norm(torque) ** 6  # at every attitude
            continue
        sizes, axes = np.linalg.eigh(form / scale)
        regular = axes[:, sizes > ZERO]
        dimension = int(found.dimension)
        assert regular.shape[1] == dimension  # circle, two directions, none
        assert dimension == np.linalg.matrix_rank(np.vstack([torque, force]), tol=ZERO) - 3
        dimensions.add(dimension)
        for up in rng.normal(size=(5, 3)):
            up /= np.linalg.norm(up)
            sine = np.sin(singularity_margin(found, up))
            assert np.linalg.norm(regular.T @ up) == pytest.approx(sine, abs=1e-7)
        # A direction perpendicular to V is singular, any other one is not.
        across = [] if dimension == 3 else [axes[:, 0]]
        for singular, directions in ((True, across), (False, regular.T)):
            for up in directions:
                values = np.linalg.svd(np.vstack([torque, up @ force]), compute_uv=False)
                assert (values[-1] < 1e-6 * values[0]) == singular
    assert dimensions == DIMENSIONS[kind]


@pytest.mark.parametrize("preset", ["ar_drone_2", "luukkonen"])
def test_four_rotors_have_the_margin_of_the_library(preset):
    vehicle = PRESETS[preset]
    angles = np.random.default_rng(4).uniform(-1.2, 1.2, (50, 4))
    torque = singularity.torque_matrix(angles, vehicle)
    found = torque_free_forces(singularity.force_matrix(angles), torque)
    assert (found.rank == 3).all()
    assert (found.dimension == 1).all()
    margin = np.abs(singularity.singularity_margin(angles, vehicle))
    np.testing.assert_allclose(singularity_margin(found), margin, rtol=0.0, atol=1e-9)
    direction = singularity.torque_free_direction(angles, vehicle)
    np.testing.assert_allclose(hover_direction(found), direction, rtol=0.0, atol=1e-9)


def random_unit(rng, *shape):
    vectors = rng.normal(size=(*shape, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def smallest_singular_value(matrices, up):
    """Smallest singular values of ``[tau; up^T F]`` for directions of world up, shape (..., 3)."""
    force, torque = matrices
    last = up[..., np.newaxis, :] @ force
    rows = np.concatenate([np.broadcast_to(torque, (*up.shape[:-1], *torque.shape)), last], axis=-2)
    return np.linalg.svd(rows, compute_uv=False)[..., -1]


def zeros_over_attitudes(matrices, rng, starts):
    """Directions of world up where the decoupling matrix is singular, by pattern search."""
    at, reach = random_unit(rng, starts), np.full(starts, 0.3)
    value = smallest_singular_value(matrices, at)
    while reach.max() > 1e-8:
        steps = random_unit(rng, 12, starts) * reach[:, np.newaxis]
        tried = at + steps
        tried /= np.linalg.norm(tried, axis=-1, keepdims=True)
        values = smallest_singular_value(matrices, tried)
        best = values.argmin(axis=0), np.arange(starts)
        better = values[best] < value
        at = np.where(better[:, np.newaxis], tried[best], at)
        value = np.where(better, values[best], value)
        reach = np.where(better, 1.3, 0.7) * reach
    return at[value < 1e-6]


def by_brute_force(zeros, starts, up):
    """The class of the set of singular directions and the least angle from ``up`` to it."""
    if not len(zeros):
        return "none", np.pi / 2.0
    sizes, axes = np.linalg.svd(zeros)[1:]
    spread = (sizes > 1e-4 * np.sqrt(len(zeros))).sum()
    if spread == 1:
        return "two directions", np.arccos(np.abs(zeros @ up).max())
    if spread == 2:  # a plane through the origin
        return "great circle", np.arcsin(np.abs(axes[2] @ up))
    assert len(zeros) == starts
    return "all", 0.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_classes_and_margins_agree_with_a_search_over_attitudes(kind):
    rng, starts = np.random.default_rng(100 + KINDS.index(kind)), 16
    for _ in range(15):
        force, torque = random_vehicle(rng, kind)
        matrices = force, torque / np.linalg.norm(torque, axis=0).max()
        found, up = torque_free_forces(force, torque), random_unit(rng)
        searched, angle = by_brute_force(zeros_over_attitudes(matrices, rng, starts), starts, up)
        assert SINGULAR_ATTITUDES[found.dimension] == searched
        assert singularity_margin(found, up) == pytest.approx(angle, abs=1e-4)


def test_many_tilt_angles_at_once_are_one_after_another():
    rng = np.random.default_rng(5)
    force, torque = rng.normal(size=(2, 7, 5, 3, 6))
    torque[2, :, 2] = torque[2, :, 0]  # loses rank
    found = torque_free_forces(force, torque)
    assert sorted(np.unique(found.dimension)) == [0, 3]
    alone = torque_free_forces(force[2, 4], torque[2, 4])
    for every, one in zip(found, alone, strict=True):
        np.testing.assert_allclose(every[2, 4], one, atol=1e-12)
    assert np.isnan(hover_direction(alone)).all()
    assert singularity_margin(alone) == 0.0


def test_controlled_axes_are_up_and_across_it_among_the_torque_free_forces():
    rng = np.random.default_rng(20)
    for _ in range(10):
        basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        up = rng.normal(size=3)
        up /= np.linalg.norm(up)
        plane = TorqueFreeForces(np.array(3), np.array(2), basis[:, :2] @ basis[:, :2].T)
        found = controlled_axes(plane, up, 2)
        np.testing.assert_allclose(found @ found.T, np.eye(2), atol=1e-12)
        np.testing.assert_allclose(found[0], up)
        assert abs(found[1] @ basis[:, 2]) < 1e-12
        everything = TorqueFreeForces(np.array(3), np.array(3), np.eye(3))
        forward = controlled_axes(everything, up, 2)[1]
        assert forward[1] == 0.0
        assert forward @ up == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_array_equal(controlled_axes(plane, up, 1), [up])
        np.testing.assert_array_equal(controlled_axes(plane, up, 3), np.eye(3))


def test_over_a_flight_the_margin_changes_its_sign_at_a_great_circle():
    """The only torque-free force turns with the tilts; each flight begins on the positive side."""
    lean = np.linspace(0.0, 0.8 * np.pi, 9)  # past pi/2, perpendicular to up
    axes = np.stack([np.sin(lean), 0.0 * lean, np.cos(lean)], axis=-1)
    whole = np.concatenate([axes, -axes[::-1]])  # the second flight: the axis reversed
    projector = whole[:, :, np.newaxis] * whole[:, np.newaxis, :]
    count = len(whole)
    forces = TorqueFreeForces(np.full(count, 3), np.full(count, 1), projector)
    begins = np.zeros(count, bool)
    begins[[0, 9]] = True
    up = np.tile((0.0, 0.0, 1.0), (count, 1))
    expected = np.r_[0.5 * np.pi - lean, -(0.5 * np.pi - lean[::-1])]
    found = margin_over_flight(forces, up, begins)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    # The direction read from the projector may point down where a flight begins.
    aside = np.array([0.8, 0.0, -0.6])
    still = TorqueFreeForces(np.array([3]), np.array([1]), np.outer(aside, aside)[np.newaxis])
    assert margin_over_flight(still, up[:1], begins[9:10]) == pytest.approx(np.arcsin(0.6))
    # A flight of two dimensions goes past its two directions.
    plane = forces._replace(dimension=np.where(np.arange(count) < 9, 1, 2))
    mixed = margin_over_flight(plane, up, begins)
    np.testing.assert_allclose(mixed, np.r_[expected[:9], np.abs(expected[9:])], atol=1e-9)
