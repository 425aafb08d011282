"""Attainable torques, thrusts and accelerations under rotor-speed limits (ch. 9, Sec. 3).

With the tilt angles fixed, forces and torques are linear in ``w_i = varpi_i |varpi_i|``, and speed
limits confine ``w`` to a box. A condition such as ``tau_N = 0`` intersects the box with a
hyperplane, which leaves a polytope whose vertices lie on faces of the box. They are found exactly,
by solving one small system per face, without sampling or optimization. A linear image of them
(torques, thrust, acceleration) spans the attainable set.

Two published findings are not reproduced: the body accelerations of +-2 m/s^2 (Figs. 8, 9; see
`attainable_accelerations`), and blue gaits (5 to 8) as a usable design: that their torques are
"linearly coupled" is the rank deficiency of `tiltsim_controllers.analysis.two_color_map`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product
from typing import TYPE_CHECKING, Final

import numpy as np

from tiltsim_controllers.analysis.singularity import force_matrix, torque_matrix
from tiltsim_controllers.vehicle.parameters import SPIN

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from tiltsim_controllers.mathematics.scalar import Floats
    from tiltsim_controllers.vehicle.parameters import Vehicle

MIN_TOTAL_THRUST: Final = 3.0
"""N, of four untilted rotors at the lower speed limit (ch. 9, Sec. 3.1)."""

MAX_TOTAL_THRUST: Final = 5.0
"""N, of four untilted rotors at the upper speed limit."""

HOVER_THRUST: Final = 4.2
"""N, the weight as ch. 9 rounds it (Eq. 21)."""

_INSIDE: Final = 1e-9


def rotor_speed_for_thrust(total_thrust: float, vehicle: Vehicle) -> float:
    """Rotor speed (rad/s) at which four untilted rotors produce ``total_thrust`` (N)."""
    return float(np.sqrt(total_thrust / (4.0 * vehicle.thrust_coefficient)))


def published_speed_limits(vehicle: Vehicle) -> tuple[float, float]:
    """Minimum and maximum rotor speed of ch. 9: 305.27 and 394.10 rad/s for its vehicle."""
    return (
        rotor_speed_for_thrust(MIN_TOTAL_THRUST, vehicle),
        rotor_speed_for_thrust(MAX_TOTAL_THRUST, vehicle),
    )


@dataclass(frozen=True)
class AttainableSet:
    """A convex set: the hull of its vertices."""

    labels: tuple[str, ...]  # names of the coordinates, with units
    vertices: Floats  # (N, len(labels)); hull vertices where the set has an interior
    inputs: Floats  # (N, 4): the w (rad^2/s^2) that reach the vertices
    dimension: int  # affine dimension; -1 for the empty set

    @property
    def is_empty(self) -> bool:
        """Whether no admissible rotor speeds satisfy the conditions."""
        return self.dimension < 0

    @property
    def lower(self) -> Floats:
        """Minimum of each coordinate; NaN if empty."""
        return np.min(self.vertices, axis=0) if not self.is_empty else self._nan

    @property
    def upper(self) -> Floats:
        """Maximum of each coordinate; NaN if empty."""
        return np.max(self.vertices, axis=0) if not self.is_empty else self._nan

    @property
    def _nan(self) -> Floats:
        return np.full(len(self.labels), np.nan)


def input_box(speed_limits: tuple[float, float]) -> tuple[Floats, Floats]:
    """Bounds of ``w`` (rad^2/s^2), each (4,), under limits of ``|varpi|`` (rad/s; Eq. 11).

    Raises:
        ValueError: If the limits are not ``0 <= minimum < maximum``.
    """
    low, high = speed_limits
    if not 0.0 <= low < high < np.inf:
        raise ValueError(f"rotor speed limits {low}, {high}: must satisfy 0 <= minimum < maximum")
    ends = np.outer([low**2, high**2], SPIN)
    return ends.min(axis=0), ends.max(axis=0)


def box_slice_vertices(lower: Floats, upper: Floats, conditions: Floats, values: Floats) -> Floats:
    """Vertices of ``{w : lower <= w <= upper, conditions w = values}``, shape (N, 4).

    A vertex of the slice lies on a face of the box with as many free coordinates as there are
    conditions, the others at a bound.

    Args:
        lower, upper: shape (4,)
        conditions, values: shapes (k, 4) and (k,), k from 0 to 4
    """
    count = len(conditions)
    size = lower.size
    scale = np.abs(np.concatenate([lower, upper])).max()
    found: list[Floats] = []
    for free in combinations(range(size), count):
        bounded = [index for index in range(size) if index not in free]
        matrix = conditions[:, list(free)]
        norms = np.linalg.norm(conditions, axis=1)
        if count and abs(np.linalg.det(matrix)) < 1e-12 * norms.prod():
            continue  # parallel to the face, whose vertices are those of its faces
        for ends in product((0, 1), repeat=len(bounded)):
            w = np.empty(size)
            w[bounded] = [
                (lower, upper)[end][index] for end, index in zip(ends, bounded, strict=True)
            ]
            if count:
                w[list(free)] = np.linalg.solve(
                    matrix, values - conditions[:, bounded] @ w[bounded]
                )
            slack = _INSIDE * scale
            if (w >= lower - slack).all() and (w <= upper + slack).all():
                found.append(np.clip(w, lower, upper))
    if not found:
        return np.empty((0, size))
    return np.asarray(np.unique(np.round(np.array(found) / scale, 12), axis=0) * scale)


def attainable_torque_thrust(
    angles: ArrayLike,
    vehicle: Vehicle,
    speed_limits: tuple[float, float],
    *,
    yaw_torque: float | None = 0.0,
    vertical_thrust: float | None = None,
) -> AttainableSet:
    """Attainable ``(tau_L, tau_M, F_Z)`` (N m, N m, N; body axes; ch. 9, Figs. 2-7).

    Args:
        angles: tilt angles, shape (4,), rad
        vehicle: the tiltrotor
        speed_limits: minimum and maximum rotor speed, rad/s
        yaw_torque: condition (Eq. 20), N m; None for none
        vertical_thrust: condition (slices of the figures), N; None for none
    """
    torque, force = _wrench(angles, vehicle)
    image = np.stack([torque[0], torque[1], force[2]])
    labels = ("tau_L (N m)", "tau_M (N m)", "F_Z (N)")
    conditions = [(torque[2], yaw_torque), (force[2], vertical_thrust)]
    return _attainable(image, labels, conditions, speed_limits)


def attainable_accelerations(
    angles: ArrayLike,
    vehicle: Vehicle,
    speed_limits: tuple[float, float],
    *,
    yaw_torque: float | None = 0.0,
    vertical_thrust: float | None = HOVER_THRUST,
) -> AttainableSet:
    """Attainable ``(F_X, F_Y) / m`` (m/s^2, body axes; ch. 9, Figs. 8, 9).

    With the stated limits gaits 2 and 3 reach about 0.12 m/s^2, not the published 2 m/s^2.

    Args:
        angles, vehicle, speed_limits, yaw_torque, vertical_thrust: as for
            `attainable_torque_thrust`
    """
    torque, force = _wrench(angles, vehicle)
    labels = ("a_X (m/s^2)", "a_Y (m/s^2)")
    conditions = [(torque[2], yaw_torque), (force[2], vertical_thrust)]
    return _attainable(force[:2] / vehicle.mass, labels, conditions, speed_limits)


def _wrench(angles: ArrayLike, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Torque and force per ``w``, each of shape (3, 4), SI."""
    per_force = vehicle.thrust_coefficient
    torque = torque_matrix(angles, vehicle) * (vehicle.arm_length * per_force)
    return torque, force_matrix(angles) * per_force


def _attainable(
    image: Floats,
    labels: tuple[str, ...],
    conditions: list[tuple[Floats, float | None]],
    speed_limits: tuple[float, float],
) -> AttainableSet:
    lower, upper = input_box(speed_limits)
    active = [(row, value) for row, value in conditions if value is not None]
    rows = np.array([row for row, _ in active]).reshape(-1, 4)
    values = np.array([value for _, value in active], dtype=float)
    inputs = box_slice_vertices(lower, upper, rows, values)
    points = inputs @ image.T
    keep, dimension = _hull(points)
    return AttainableSet(labels, points[keep], inputs[keep], dimension)


def _hull(points: Floats) -> tuple[NDArray[np.int_], int]:
    """Indices of the hull's vertices and the affine dimension of a set of points (N, d)."""
    from scipy.spatial import ConvexHull

    if not len(points):
        return np.empty(0, dtype=int), -1
    centred = points - points.mean(axis=0)
    spread = np.abs(points).max(axis=0)
    scaled = centred / np.where(spread > 0.0, spread, 1.0)
    _, values, axes = np.linalg.svd(scaled, full_matrices=False)
    dimension = int((values > 1e-9 * np.sqrt(len(points))).sum())
    flat = scaled @ axes[:dimension].T
    if dimension == 0:
        return np.array([0]), 0
    if dimension == 1:
        return np.array([flat[:, 0].argmin(), flat[:, 0].argmax()]), 1
    return np.asarray(ConvexHull(flat).vertices), dimension
