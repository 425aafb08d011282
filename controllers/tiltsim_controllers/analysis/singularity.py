"""Where the decoupling matrix is singular: rank, residuals and margin for arrays of gaits.

On arrays of the tilt angles of `tiltsim_controllers.vehicle.cross`, shape ``(..., 4)``; roll and
pitch broadcast against the leading shape; angles are in rad.

Ch. 3 and 6 write the condition for an invertible matrix as ``R cos(roll) cos(pitch) + R_phi
sin(roll) cos(pitch) + R_theta sin(pitch) != 0``, which is ``n . r3 != 0`` with the torque-free
force ``n = (-R_theta, R_phi, R)`` and world up seen from the body ``r3``. The coefficients printed
in ch. 3, Eqs. (17) and (19), and ch. 12, Eqs. (4)-(8), equal `residuals` at the respective drag
ratio, with these misprints: the term ``-2.880 s1 s2 c3 s4 sin(roll) cos(pitch)`` of ch. 3, Eq.
(17), should read ``s1 s2 c3 c4``, and the last term of ch. 5, Eq. (15), ``s1 s2 c3 s4``. Ch. 12
scales everything by the constant 1.025.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import atan, atan2, cos, inf, pi
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tiltsim_controllers.analysis.torque_free import RANK_TOLERANCE
from tiltsim_controllers.mathematics.scalar import Floats, Quad
from tiltsim_controllers.vehicle.cross import (
    cross_force,
    cross_torque,
    torque_free_force,
    torque_free_inputs,
)
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle, drag_ratio


class Residuals(NamedTuple):
    """Coefficients of the determinant (ch. 6, Eqs. 4-6), normalized as in ch. 3."""

    R: Floats  # of cos(roll) cos(pitch); 4 for an untilted vehicle
    R_phi: Floats  # of sin(roll) cos(pitch)
    R_theta: Floats  # of sin(pitch)


def world_up(roll: ArrayLike, pitch: ArrayLike) -> Floats:
    """World up in body axes, ``r3``, shape (..., 3) (ch. 3, third row of Eq. 2)."""
    roll, pitch = np.broadcast_arrays(np.asarray(roll, float), np.asarray(pitch, float))
    cosine = np.cos(pitch)
    return np.stack([-np.sin(pitch), np.sin(roll) * cosine, np.cos(roll) * cosine], axis=-1)


def torque_matrix(angles: ArrayLike, vehicle: Vehicle) -> Floats:
    """``tau(alpha) / (L K_f)``, shape (..., 3, 4), dimensionless (ch. 3, Eq. 5)."""
    return _matrices_last(cross_torque(_by_rotor(angles), drag_ratio(vehicle)))


def force_matrix(angles: ArrayLike) -> Floats:
    """``F(alpha) / K_f``, shape (..., 3, 4), dimensionless (ch. 3, Eq. 3)."""
    return _matrices_last(cross_force(_by_rotor(angles)))


def _by_rotor(angles: ArrayLike) -> Floats:
    return np.moveaxis(np.asarray(angles, float), -1, 0)


def _matrices_last(matrices: Floats) -> Floats:
    return np.ascontiguousarray(np.moveaxis(matrices, (0, 1), (-2, -1)))


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
    nx, ny, nz = map(np.asarray, torque_free_force(_by_rotor(angles), drag_ratio(vehicle)))
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
    tilts, ratio = _by_rotor(angles), drag_ratio(vehicle)
    torque = cross_torque(tilts, ratio)
    force = np.stack(torque_free_force(tilts, ratio), axis=-1)
    length = np.linalg.norm(force, axis=-1, keepdims=True)
    inputs = np.linalg.norm(torque_free_inputs(torque), axis=0)
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
    frobenius = np.linalg.norm(torque, axis=(0, 1))
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


def hover_rotor_speeds(tilts: ArrayLike, vehicle: Vehicle) -> Quad | None:
    """Rotor speeds (rad/s) along the spins with which fixed ``tilts`` (rad) support the weight.

    Their torque is zero and their force as large as the weight, upward at level attitude or as
    nearly as the tilts allow (ch. 4, Remark 6). Negative where a rotor would have to turn
    backwards, which the singularity margin does not show. None where there is no such force or it
    has no upward part.
    """
    if not torque_free_direction(tilts, vehicle)[2] > 0.0:
        return None
    inputs = torque_free_inputs(cross_torque(np.asarray(tilts), drag_ratio(vehicle)))
    force = force_matrix(tilts) @ inputs
    weight = vehicle.mass * vehicle.gravity / vehicle.thrust_coefficient
    w = np.copysign(weight / np.linalg.norm(force), force[2]) * inputs * SPIN
    a, b, c, d = np.copysign(np.sqrt(np.abs(w)), w).tolist()
    return a, b, c, d


CurveKind = Literal["graph", "vertical", "none", "everywhere"]


@dataclass(frozen=True)
class AttitudeCurve:
    """The singular attitudes of one gait with ``|roll| < pi/2``.

    ``kind`` is their shape: ``graph`` (one pitch for each roll), ``vertical`` (one roll, any
    pitch; ``R_theta = 0``), ``none`` (only at ``|roll| = pi/2``; ``R_phi = R_theta = 0``) or
    ``everywhere`` (``n = 0``). ``roll`` and ``pitch`` are samples, shape (N,), empty for the last
    two kinds.
    """

    kind: CurveKind
    roll: Floats
    pitch: Floats


def unacceptable_attitudes(
    angles: ArrayLike, vehicle: Vehicle, samples: int = 181
) -> AttitudeCurve:
    """The unacceptable-attitude curve of a gait, in ``samples`` points.

    Sampled evenly along the great circle, not in roll, so that steep and vertical curves are also
    resolved.
    """
    empty = np.empty(0)
    direction = torque_free_direction(angles, vehicle)
    if np.isnan(direction).any():
        return AttitudeCurve("everywhere", empty, empty)
    nx, ny, nz = (float(value) for value in direction)
    lean = float(np.hypot(nx, ny))
    if lean <= np.finfo(float).eps:
        return AttitudeCurve("none", empty, empty)
    # Two unit vectors that span the plane across n: one level, one pointing up.
    level = np.array([-ny, nx, 0.0]) / lean
    upward = np.array([-nx * nz, -ny * nz, lean * lean]) / lean
    turn = np.linspace(0.0, pi, samples + 2)[1:-1, np.newaxis]
    ux, uy, uz = (np.cos(turn) * level + np.sin(turn) * upward).T
    kind: CurveKind = "vertical" if nx == 0.0 else "graph"
    return AttitudeCurve(kind, np.arctan2(uy, uz), np.arctan2(-ux, np.hypot(uy, uz)))


def acceptable_share(angles: ArrayLike, vehicle: Vehicle, half_width: float = pi / 2) -> float:
    """Fraction of the square ``|roll|, |pitch| < half_width`` (rad) reachable from level attitude.

    That is the part where the determinant has the same sign as at level attitude; it is connected,
    as the curve crosses each line of constant roll at most once. Zero if level is singular.

    Raises:
        ValueError: If ``half_width`` is not in (0, pi/2].
    """
    if not 0.0 < half_width <= pi / 2:
        raise ValueError(f"half_width = {half_width}: must be in (0, pi/2]")
    if np.isnan(torque_free_direction(angles, vehicle)).any():
        return 0.0
    R, R_phi, R_theta = (float(value) for value in residuals(angles, vehicle))
    if R == 0.0:
        return 0.0
    if R < 0.0:
        R, R_phi, R_theta = -R, -R_phi, -R_theta
    amplitude, centre = float(np.hypot(R, R_phi)), atan2(R_phi, R)

    def reachable(roll: float) -> float:
        """Length of the acceptable interval of pitch: tan(pitch) R_theta > -lift."""
        lift = amplitude * cos(roll - centre)
        steepness = lift / abs(R_theta) if R_theta else (inf if lift > 0.0 else -inf)
        return half_width + min(half_width, max(-half_width, atan(steepness)))

    from scipy.integrate import quad  # takes a third of a second to import

    # The integrand has corners where the curve leaves the square or crosses level pitch.
    bends = {-half_width, half_width}
    for level in (0.0, abs(R_theta) * np.tan(half_width), -abs(R_theta) * np.tan(half_width)):
        if abs(level) <= amplitude:
            offset = float(np.arccos(level / amplitude))
            bends |= {centre + offset, centre - offset}
    inside = sorted(bend for bend in bends if -half_width <= bend <= half_width)
    area = sum(quad(reachable, lower, upper)[0] for lower, upper in pairwise(inside))
    return float(area) / (2.0 * half_width) ** 2


def published_determinant(roll: ArrayLike, pitch: ArrayLike) -> Floats:
    """The surface ``S(theta, phi)`` as published (ch. 2, Eqs. 44-46); angles in rad."""
    roll, pitch = np.asarray(roll, dtype=float), np.asarray(pitch, dtype=float)
    surface = np.cos(pitch) ** 2 * np.cos(roll) * (np.cos(roll) - np.sin(roll)) - 1.0
    return np.asarray(surface)


def published_singular_curve() -> tuple[Floats, Floats]:
    """The closed curve ``S = 0`` of ch. 2, Fig. 3: roll and pitch in rad.

    ``cos(theta)^2 = 1 / (cos(phi) (cos(phi) - sin(phi)))`` has a solution only for
    ``-pi/4 <= phi <= 0``. The curve passes through level attitude and ``(-pi/4, 0)``.
    Pitch is positive on the first half of the points, negative on the second.
    """
    # Evenly spaced in the angle about the curve's center: pitch grows like the square root of the
    # distance from either end.
    roll = -np.pi / 8.0 * (1.0 - np.cos(np.linspace(0.0, np.pi, 181)))
    cosine = 1.0 / np.sqrt(np.cos(roll) * (np.cos(roll) - np.sin(roll)))
    pitch = np.arccos(np.minimum(cosine, 1.0))
    return np.concatenate([roll, roll[::-1]]), np.concatenate([pitch, -pitch[::-1]])


def exact_determinant(
    roll: ArrayLike, pitch: ArrayLike, thrust: ArrayLike, vehicle: Vehicle
) -> Floats:
    """The determinant of ``Delta``, Eq. (42) without its errors, in SI units.

    Args:
        roll, pitch: Attitudes in rad.
        thrust: Total thrust ``zeta`` in N.
        vehicle: the quadrotor; ``d`` is its arm length
    """
    roll, pitch = np.asarray(roll, dtype=float), np.asarray(pitch, dtype=float)
    inertia = vehicle.inertia_xx * vehicle.inertia_yy * vehicle.inertia_zz
    scale = vehicle.arm_length**3 / (inertia * vehicle.mass**3)
    return np.asarray(-scale * np.square(thrust) * np.cos(roll) / np.cos(pitch))


def normalized_determinant(
    roll: ArrayLike, pitch: ArrayLike, thrust: ArrayLike, vehicle: Vehicle
) -> Floats:
    """`exact_determinant` over its value in level hover: 1 there, 0 where singular.

    Args:
        roll, pitch: Attitudes in rad.
        thrust: Total thrust ``zeta`` in N.
        vehicle: the quadrotor
    """
    hover = vehicle.mass * vehicle.gravity
    level = exact_determinant(0.0, 0.0, hover, vehicle)
    return np.asarray(exact_determinant(roll, pitch, thrust, vehicle) / level)
