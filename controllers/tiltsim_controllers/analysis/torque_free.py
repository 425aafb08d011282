"""Singular attitudes of any number of rotors, from the forces that they make without torque.

With the tilt angles fixed, N rotors make the force ``F w`` and the torque ``tau w`` of their inputs
``w_i = varpi_i |varpi_i|``. The decoupling matrix ``[tau; r3^T F]``, with world up seen from the
body ``r3``, has rank 4 exactly where ``tau`` has rank 3 and ``r3`` is not perpendicular to the
torque-free forces ``V = F ker tau``. So the dimension of V decides which attitudes are singular:

- 1: attitudes with world up in the plane perpendicular to V, a great circle of directions. Rotors
  with parallel thrust axes are of this kind, and all vehicles of four rotors (ch. 3);
- 2: two opposite directions of world up;
- 3: none; force and torque are independent of each other;
- 0, and wherever ``tau`` has lost rank: all.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tiltsim_controllers.mathematics.scalar import Floats

SINGULAR_ATTITUDES: Final = ("all", "great circle", "two directions", "none")
"""The set of singular directions of world up, by the dimension of the torque-free forces."""

RANK_TOLERANCE: Final = 1e-8
"""A singular value below this fraction of the largest counts as zero.

Rounding is 1e-16, but gaits are given in decimals: with tilt angles accurate to 1e-8 rad the
smallest singular value of a rank-deficient ``tau`` is near that fraction.
"""

LEVEL: Final = (0.0, 0.0, 1.0)
"""World up in body axes at level attitude."""


class TorqueFreeForces(NamedTuple):
    """The torque-free forces V of tilt angles, or of many: every field has their shape first."""

    rank: NDArray[np.int_]  # of tau
    dimension: NDArray[np.int_]  # of V; 0 where tau has lost rank
    projector: Floats  # on V, body axes, shape (..., 3, 3)


def torque_free_forces(force: ArrayLike, torque: ArrayLike) -> TorqueFreeForces:
    """Rank of ``tau`` and the space of torque-free forces.

    Effectiveness F and tau have shape (..., 3, N), any unit, with zeros for a rotor that is lost.
    """
    force, torque = np.asarray(force, float), np.asarray(torque, float)
    _, sizes, rows = np.linalg.svd(torque)
    rank = (sizes > RANK_TOLERANCE * sizes[..., :1]).sum(axis=-1)
    in_kernel = np.arange(force.shape[-1]) >= rank[..., np.newaxis]
    kernel = np.swapaxes(rows * in_kernel[..., np.newaxis], -1, -2)
    strongest = np.linalg.norm(force, axis=-2).max(axis=-1)
    axes, sizes, _ = np.linalg.svd(force @ kernel)
    used = (sizes > RANK_TOLERANCE * strongest[..., np.newaxis]) & (rank == 3)[..., np.newaxis]
    basis = axes[..., : used.shape[-1]] * used[..., np.newaxis, :]
    return TorqueFreeForces(rank, used.sum(axis=-1), basis @ np.swapaxes(basis, -1, -2))


def singularity_margin(forces: TorqueFreeForces, up: ArrayLike = LEVEL) -> Floats:
    """Smallest rotation (rad) that brings world up to a singular direction: ``asin |P_V r3|``.

    Zero where every attitude is singular; pi/2, the largest value, also where none is. World up is
    in body axes, shape (..., 3).
    """
    along = np.einsum("...ij,...j->...i", forces.projector, np.asarray(up, float))
    return np.asarray(np.arcsin(np.minimum(1.0, np.linalg.norm(along, axis=-1))))


def margin_over_flight(
    forces: TorqueFreeForces, up: ArrayLike, begins: NDArray[np.bool_]
) -> Floats:
    """Margin (rad) along flights, shape (N,), negative beyond a singularity.

    A great circle of singular directions has two sides, and world up begins on the positive one:
    the side of level attitude then. Elsewhere a flight goes past the singular directions, and this
    is `singularity_margin`. A rotor that is lost may leave a great circle where there was none.

    Args:
        forces: in order of time
        up: world up in body axes, unit vectors of shape (N, 3)
        begins: shape (N,), true where a flight begins, and where it goes on without a rotor
    """
    margin = singularity_margin(forces, up)
    starts, part = np.flatnonzero(begins), np.cumsum(begins) - 1
    one_circle = np.logical_and.reduceat(forces.dimension == 1, starts)[part]
    if not one_circle.any():
        return margin
    square = np.diagonal(forces.projector, axis1=-2, axis2=-1)
    along = square.argmax(axis=-1)[:, np.newaxis, np.newaxis]
    direction = np.take_along_axis(forces.projector, along, axis=-1)[..., 0]
    cosines = np.einsum("ki,ki->k", direction, np.roll(direction, 1, axis=0))
    cosines[starts] = direction[starts, 2]  # from upward
    turns = np.where(cosines < 0.0, -1.0, 1.0)
    sides = np.cumprod(turns)
    sides *= (turns * sides)[starts][part]  # of those since the part began
    crossed = one_circle & (sides * np.einsum("ki,ki->k", direction, np.asarray(up, float)) < 0.0)
    return np.where(crossed, -margin, margin)


def controlled_axes(forces: TorqueFreeForces, up: ArrayLike, dimension: int) -> Floats:
    """Directions of force that a controller of k components controls, shape (..., k, 3).

    With ``dimension`` 1 along world up (body axes, shape (..., 3)); with 2 also across it within
    the torque-free forces, or in the x-z plane where these are all; with 3 all.
    """
    up = np.asarray(up, float)
    if dimension == 3:
        return np.broadcast_to(np.eye(3), (*up.shape, 3))
    if dimension == 1:
        return up[..., np.newaxis, :]
    least = np.linalg.eigh(forces.projector)[1][..., 0]
    normal = np.where(forces.dimension[..., np.newaxis] == 3, (0.0, 1.0, 0.0), least)
    across = np.cross(normal, up)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    return np.stack([up, across / np.where(length > 0.0, length, 1.0)], axis=-2)


def decoupling_condition(force: ArrayLike, torque: ArrayLike, axes: ArrayLike) -> Floats:
    """Smallest over largest singular value of ``[tau; axes F]``, of shape (...).

    Forces count in units of the strongest rotor's, torques in units of a rotor's force at the
    longest lever. F and tau have shape (..., 3, N), with zeros for a rotor that is lost, the axes
    of the force that are controlled (..., k, 3), body axes.
    """
    force, torque = np.asarray(force, float), np.asarray(torque, float)
    thrusts = np.linalg.norm(force, axis=-2)
    works = np.where(thrusts > 0.0, thrusts, 1.0)
    levers = np.linalg.norm(np.cross(force, torque, axis=-2), axis=-2) / works
    scaled = torque / levers.max(axis=-1)[..., np.newaxis, np.newaxis]
    lifts = np.asarray(axes, float) @ (force / thrusts.max(axis=-1)[..., np.newaxis, np.newaxis])
    values = np.linalg.svd(np.concatenate([scaled, lifts], axis=-2), compute_uv=False)
    return np.asarray(values[..., -1] / values[..., 0])


def hover_direction(forces: TorqueFreeForces) -> Floats:
    """The torque-free direction nearest to the body's z axis, shape (..., 3); NaN where none is.

    The vehicle that hovers with this direction upward leans least.
    """
    along = forces.projector[..., 2]
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(length > RANK_TOLERANCE, along / length, np.nan)
