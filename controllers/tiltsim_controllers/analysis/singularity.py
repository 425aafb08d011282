"""Where the decoupling matrix is singular: rank, residuals and margin for arrays of gaits.

Floats-shaped companions of `tiltsim_controllers.vehicle.decoupling_matrix`, for any vehicle. Tilt
angles have the shape ``(..., 4)``; roll and pitch broadcast against the leading shape; angles are
in rad.

Ch. 3 and 6 write the condition for an invertible matrix as ``R cos(roll) cos(pitch) + R_phi
sin(roll) cos(pitch) + R_theta sin(pitch) != 0``, which is ``n . r3 != 0`` with the torque-free
force ``n = (-R_theta, R_phi, R)`` and world up seen from the body ``r3``. The coefficients printed
in ch. 3, Eqs. (17) and (19), and ch. 12, Eqs. (4)-(8), equal `residuals` at the respective drag
ratio, with these misprints: the term ``-2.880 s1 s2 c3 s4 sin(roll) cos(pitch)`` of ch. 3, Eq.
(17), should read ``s1 s2 c3 c4``, and the last term of ch. 5, Eq. (15), ``s1 s2 c3 s4``. Ch. 12
scales everything by the constant 1.025.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tiltsim_controllers.analysis.torque_free import RANK_TOLERANCE
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.decoupling_matrix import (
    torque_entries,
    torque_free_force,
    torque_free_inputs,
    vertical_force_entries,
)
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio


class Residuals(NamedTuple):
    """Coefficients of the determinant (ch. 6, Eqs. 4-6), normalized as in ch. 3."""

    R: Floats  # of cos(roll) cos(pitch); 4 for an untilted vehicle
    R_phi: Floats  # of sin(roll) cos(pitch)
    R_theta: Floats  # of sin(pitch)


def tilt_trigonometry(angles: ArrayLike) -> Any:
    """``(sin alpha_1, cos alpha_1, ..., cos alpha_4)`` of tilt angles of shape (..., 4).

    Eight arrays of shape (...), typed as Any because scalar code declares floats.
    """
    angles = np.asarray(angles, dtype=float)
    sines, cosines = np.sin(angles), np.cos(angles)
    return tuple(part[..., rotor] for rotor in range(4) for part in (sines, cosines))


def world_up(roll: ArrayLike, pitch: ArrayLike) -> Floats:
    """World up in body axes, ``r3``, shape (..., 3) (ch. 3, third row of Eq. 2)."""
    roll, pitch = np.broadcast_arrays(np.asarray(roll, float), np.asarray(pitch, float))
    cosine = np.cos(pitch)
    return np.stack([-np.sin(pitch), np.sin(roll) * cosine, np.cos(roll) * cosine], axis=-1)


def torque_matrix(angles: ArrayLike, vehicle: Vehicle) -> Floats:
    """``tau(alpha) / (L K_f)``, shape (..., 3, 4), dimensionless (ch. 3, Eq. 5)."""
    trig = tilt_trigonometry(angles)
    x2, x4, y1, y3, z1, z2, z3, z4 = torque_entries(trig, drag_ratio(vehicle))
    zero = np.zeros_like(x2)
    rows: Any = [[zero, x2, zero, x4], [y1, zero, y3, zero], [z1, z2, z3, z4]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def force_matrix(angles: ArrayLike) -> Floats:
    """``F(alpha) / K_f``, shape (..., 3, 4), dimensionless (ch. 3, Eq. 3)."""
    trig = tilt_trigonometry(angles)
    rows = [vertical_force_entries(trig, *axis) for axis in np.eye(3)]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def decoupling_matrix(
    angles: ArrayLike, roll: ArrayLike, pitch: ArrayLike, vehicle: Vehicle
) -> Floats:
    """``[tau(alpha); r3^T F(alpha)]`` in SI units, shape (..., 4, 4) (ch. 3, Eqs. 16, 18).

    Args:
        angles: tilt angles, shape (..., 4), rad
        roll, pitch: rad
        vehicle: the tiltrotor
    """
    torque = torque_matrix(angles, vehicle) * vehicle.arm_length * vehicle.thrust_coefficient
    force = force_matrix(angles) * vehicle.thrust_coefficient
    lift = np.einsum("...i,...ij->...j", world_up(roll, pitch), force)
    torque = np.broadcast_to(torque, (*lift.shape[:-1], 3, 4))
    lift = lift[..., np.newaxis, :]
    return np.concatenate([torque, lift], axis=-2)


def singular_values(angles: ArrayLike, vehicle: Vehicle) -> Floats:
    """Singular values of ``tau / (L K_f)``, largest first, shape (..., 3)."""
    return np.asarray(np.linalg.svd(torque_matrix(angles, vehicle), compute_uv=False), float)


def rank(angles: ArrayLike, vehicle: Vehicle) -> NDArray[np.int_]:
    """Rank of ``tau(alpha)``, shape (...), within `RANK_TOLERANCE`."""
    values = singular_values(angles, vehicle)
    return np.asarray((values > RANK_TOLERANCE * values[..., :1]).sum(axis=-1))


def residuals(angles: ArrayLike, vehicle: Vehicle) -> Residuals:
    """``R``, ``R_phi`` and ``R_theta`` of tilt angles, each of shape (...)."""
    trig, ratio = tilt_trigonometry(angles), drag_ratio(vehicle)
    nx, ny, nz = map(np.asarray, torque_free_force(trig, torque_entries(trig, ratio), ratio))
    return Residuals(R=nz, R_phi=ny, R_theta=-nx)


def determinant(angles: ArrayLike, roll: ArrayLike, pitch: ArrayLike, vehicle: Vehicle) -> Floats:
    """The determinant ``n . r3``, normalized as in ch. 3, shape (...) (ch. 3, Eq. 17).

    That of `decoupling_matrix`, whose arguments it takes, is ``2 L^2 K_f^3 K_m`` times this.

    Args:
        angles, roll, pitch, vehicle: as for `decoupling_matrix`
    """
    R, R_phi, R_theta = residuals(angles, vehicle)
    up = world_up(roll, pitch)
    return R * up[..., 2] + R_phi * up[..., 1] - R_theta * up[..., 0]


def torque_free_direction(angles: ArrayLike, vehicle: Vehicle) -> Floats:
    """Unit vector along the force at zero torque, body axes, z >= 0; shape (..., 3).

    NaN where there is no such direction: ``tau`` is rank-deficient, or the torque-free rotor inputs
    produce no force (`torque_free_force`).
    """
    trig = tilt_trigonometry(angles)
    ratio = drag_ratio(vehicle)
    torque = torque_entries(trig, ratio)
    force = np.stack(torque_free_force(trig, torque, ratio), axis=-1)
    length = np.linalg.norm(force, axis=-1, keepdims=True)
    inputs = np.linalg.norm(np.stack(torque_free_inputs(torque), axis=-1), axis=-1)
    full_rank = _has_full_rank(np.asarray(angles, float), torque, inputs, vehicle)
    pushes = 2.0 * ratio * length[..., 0] > RANK_TOLERANCE * inputs
    with np.errstate(invalid="ignore", divide="ignore"):
        direction = force / length * np.where(force[..., 2:] < 0.0, -1.0, 1.0)
    return np.where((full_rank & pushes)[..., np.newaxis], direction, np.nan)


def _has_full_rank(angles: Floats, torque: Any, inputs: Floats, vehicle: Vehicle) -> Any:
    """``rank(angles, vehicle) == 3``, by singular values only where a bound does not decide.

    The torque-free inputs are the 3 x 3 minors of ``tau``, so their norm is the product of its
    three singular values and, divided by the cube of its Frobenius norm, at most the smallest over
    the largest.
    """
    frobenius = np.linalg.norm(np.stack(torque, axis=-1), axis=-1)
    full = np.asarray(inputs > 2.0 * RANK_TOLERANCE * frobenius**3)
    if not full.all():
        unsure = ~full
        values = (np.broadcast_to(value, full.shape)[unsure] for value in vehicle)
        full[unsure] = rank(angles[unsure], Vehicle(*values)) == 3
    return full


def singularity_margin(
    angles: ArrayLike, vehicle: Vehicle, roll: ArrayLike = 0.0, pitch: ArrayLike = 0.0
) -> Floats:
    """Smallest rotation (rad) from the attitude to a singular one, shape (...).

    At singular attitudes world up is perpendicular to ``n``, so the margin is ``asin(n . r3 /
    |n|)``: pi/2 at most, zero where the matrix is singular at every attitude. It is positive on the
    side of the level attitude and negative beyond the unacceptable-attitude curve. At level
    attitude it is the gait's robustness in the sense of ch. 5 and 6.

    Args:
        angles, vehicle, roll, pitch: as for `decoupling_matrix`
    """
    direction = torque_free_direction(angles, vehicle)
    sine = np.einsum("...i,...i->...", direction, world_up(roll, pitch))
    margin = np.arcsin(np.clip(sine, -1.0, 1.0))
    return np.where(np.isnan(margin), 0.0, margin)


def margin_over_gait(
    angles: ArrayLike,
    vehicle: Vehicle,
    roll: ArrayLike = 0.0,
    pitch: ArrayLike = 0.0,
    flights: int = 1,
) -> Floats:
    """Margin (rad) along a gait that must not cross a singularity, shape (N,).

    `singularity_margin` with the sign of ``R`` relative to the start of the gait: a gait whose
    determinant changes sign passes a singularity even if no sample is zero, and its margin is
    negative from there on.

    Args:
        angles: shape (N, 4), in order of time, rad
        vehicle, roll, pitch: as for `decoupling_matrix`
        flights: how many gaits, of equal length, follow one another
    """
    sign = np.sign(residuals(angles, vehicle).R)
    margin = singularity_margin(angles, vehicle, roll, pitch)
    if not sign.size:
        return margin
    signs = sign.reshape(flights, -1)
    started = (signs != 0.0).argmax(axis=-1)
    side = np.take_along_axis(signs, started[:, np.newaxis], axis=-1)
    side = np.where(side == 0.0, 1.0, side)
    sides = np.broadcast_to(side, signs.shape).ravel()
    return np.asarray(margin * sign * sides + 0.0)  # no negative zeros
