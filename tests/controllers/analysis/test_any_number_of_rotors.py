"""What is singular for any number of rotors, from the forces that they make without torque.

Checked without them: as the last row of ``B = [tau; up^T F]`` is linear in ``up``, the determinant
of ``B B^T`` is a quadratic form in ``up``, found from six values of it. Its null space is the set
of singular directions of world up.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tiltsim_controllers.analysis.singularity import force_matrix, singularity_margin, torque_matrix
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


def by_torque_free_forces(force, torque):
    """Rank of tau and an orthonormal basis of V, shape (3, dimension)."""
    _, sizes, rows = np.linalg.svd(torque)
    rank = int((sizes > ZERO * sizes[0]).sum())
    axes, sizes, _ = np.linalg.svd(force @ rows[rank:].T)
    return rank, axes[:, : int((sizes > ZERO).sum())]


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
def test_what_is_singular_follows_from_the_torque_free_forces(kind):
    rng = np.random.default_rng(KINDS.index(kind))
    dimensions = set()
    for _ in range(40):
        force, torque = random_vehicle(rng, kind)
        rank, basis = by_torque_free_forces(force, torque)
        form, scale = by_determinants(force, torque), np.linalg.det(torque @ torque.T)
        if rank < 3:
            assert np.abs(form).max() < ZERO * np.linalg.norm(torque) ** 6  # at every attitude
            continue
        sizes, axes = np.linalg.eigh(form / scale)
        regular = axes[:, sizes > ZERO]
        assert regular.shape == basis.shape  # circle, two directions, none
        dimensions.add(basis.shape[1])
        for up in rng.normal(size=(5, 3)):
            up /= np.linalg.norm(up)
            margin = np.linalg.norm(basis.T @ up)
            assert np.linalg.norm(regular.T @ up) == pytest.approx(margin, abs=1e-7)
        # A direction perpendicular to V is singular, any other one is not.
        across = [] if basis.shape[1] == 3 else [axes[:, 0]]
        for singular, directions in ((True, across), (False, basis.T)):
            for up in directions:
                values = np.linalg.svd(np.vstack([torque, up @ force]), compute_uv=False)
                assert (values[-1] < 1e-6 * values[0]) == singular
    assert dimensions == DIMENSIONS[kind]


@pytest.mark.parametrize("preset", ["ar_drone_2", "luukkonen"])
def test_four_rotors_have_the_margin_of_the_library(preset):
    rng = np.random.default_rng(4)
    for angles in rng.uniform(-1.2, 1.2, (50, 4)):
        rank, basis = by_torque_free_forces(
            force_matrix(angles), torque_matrix(angles, PRESETS[preset])
        )
        assert (rank, basis.shape[1]) == (3, 1)
        margin = singularity_margin(angles, PRESETS[preset])
        assert np.arcsin(abs(basis[2, 0])) == pytest.approx(abs(float(margin)), abs=1e-9)
