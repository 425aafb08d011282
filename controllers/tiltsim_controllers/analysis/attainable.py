"""Attainable torques, thrusts and accelerations under rotor-speed limits (ch. 9, Sec. 3).

With the tilt angles fixed, forces and torques are linear in ``w_i = varpi_i |varpi_i|``, and speed
limits confine ``w`` to a box. A condition such as ``tau_N = 0`` intersects the box with a
hyperplane, which leaves a polytope whose vertices lie on faces of the box. They are found exactly,
by solving one small system per face, without sampling or optimization. A linear image of them
(torques, thrust, acceleration) spans the attainable set. All this holds for any number of rotors
(`TiltedRotors`); the sets of ch. 9 are for four.

Two published findings are not reproduced: the body accelerations of +-2 m/s^2 (Figs. 8, 9; see
`attainable_accelerations`), and blue gaits (5 to 8) as a usable design: that their torques are
"linearly coupled" is the rank deficiency of `tiltsim_controllers.analysis.two_color_map`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tiltsim_controllers.analysis.singularity import force_matrix, torque_matrix
from tiltsim_controllers.analysis.torque_free import RANK_TOLERANCE
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle

MIN_TOTAL_THRUST: Final = 3.0
"""N, of four untilted rotors at the lower speed limit (ch. 9, Sec. 3.1)."""

MAX_TOTAL_THRUST: Final = 5.0
"""N, of four untilted rotors at the upper speed limit."""

HOVER_THRUST: Final = 4.2
"""N, the weight as ch. 9 rounds it (Eq. 21)."""

_INSIDE: Final = 1e-9

ALMOST_FLAT: Final = "QJ"
"""Lets Qhull move the points within rounding, so that it accepts sets that are almost flat."""

FORCES: Final = ("F_X (N)", "F_Y (N)", "F_Z (N)")
TORQUES: Final = ("tau_L (N m)", "tau_M (N m)", "tau_N (N m)")


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
    inputs: Floats  # (N, rotors): the w (rad^2/s^2) that reach the vertices
    dimension: int  # affine dimension; -1 for the empty set

    @property
    def is_empty(self) -> bool:
        """Whether no admissible rotor speeds satisfy the conditions."""
        return self.dimension < 0

    @property
    def lower(self) -> Floats:
        """Minimum of each coordinate; NaN if empty."""
        return np.fmin.reduce(self.vertices, axis=0, initial=np.nan)

    @property
    def upper(self) -> Floats:
        """Maximum of each coordinate; NaN if empty."""
        return np.fmax.reduce(self.vertices, axis=0, initial=np.nan)


class TiltedRotors(NamedTuple):
    """Forces, torques and limits of any number N of rotors at given tilt angles.

    Body axes; torques about the center of mass; per unit of ``w_i = varpi_i |varpi_i|``.
    """

    force: Floats  # F, N s^2/rad^2, shape (3, N)
    torque: Floats  # tau, N m s^2/rad^2, shape (3, N)
    lower: Floats  # of w, rad^2/s^2, shape (N,)
    upper: Floats  # of w, rad^2/s^2, shape (N,)
    weight: float  # N

    def without(self, lost: int) -> TiltedRotors:
        """The rotors that remain without the rotor with index ``lost``."""
        force, torque = (np.delete(matrix, lost, axis=1) for matrix in self[:2])
        lower, upper = (np.delete(bound, lost) for bound in self[2:4])
        return TiltedRotors(force, torque, lower, upper, self.weight)


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
    """Vertices of ``{w : lower <= w <= upper, conditions w = values}``, shape (vertices, N).

    A vertex of the slice lies on a face of the box with one free coordinate per condition, the
    others at a bound.

    Args:
        lower, upper: shape (N,)
        conditions, values: independent ones, shapes (k, N) and (k,), k from 0 to N
    """
    count, size = len(conditions), lower.size
    scale = np.abs(np.concatenate([lower, upper])).max()
    slack = _INSIDE * scale
    norms = np.linalg.norm(conditions, axis=1)
    ends = np.array(list(product((False, True), repeat=size - count)), dtype=bool)
    found: list[Floats] = []
    for free in map(list, combinations(range(size), count)):
        bounded = [index for index in range(size) if index not in free]
        matrix = conditions[:, free]
        if count and abs(np.linalg.det(matrix)) < 1e-12 * norms.prod():
            continue  # parallel to the face: lower faces have its vertices
        w = np.empty((len(ends), size))
        w[:, bounded] = np.where(ends, upper[bounded], lower[bounded])
        if count:
            rest = values[:, np.newaxis] - conditions[:, bounded] @ w[:, bounded].T
            w[:, free] = np.linalg.solve(matrix, rest).T
        inside = ((w >= lower - slack) & (w <= upper + slack)).all(axis=1)
        found.append(np.clip(w[inside], lower, upper))
    vertices = np.concatenate(found) if found else np.empty((0, size))
    return np.asarray(np.unique(np.round(vertices / scale, 12), axis=0) * scale)


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
    given = [(torque[2], yaw_torque), (force[2], vertical_thrust)]
    active = [(row, value) for row, value in given if value is not None]
    conditions = (
        np.array([row for row, _ in active]).reshape(-1, 4),
        np.array([value for _, value in active], dtype=float),
    )
    image = np.stack([torque[0], torque[1], force[2]])
    return _image_of_slice(image, (*TORQUES[:2], FORCES[2]), conditions, input_box(speed_limits))


def attainable_accelerations(
    angles: ArrayLike, vehicle: Vehicle, speed_limits: tuple[float, float]
) -> AttainableSet:
    """Attainable ``(F_X, F_Y) / m`` (m/s^2, body axes) in hover without yaw torque.

    With the stated limits gaits 2 and 3 reach about 0.12 m/s^2, not the 2 m/s^2 of ch. 9, Figs. 8
    and 9. See `attainable_torque_thrust` for the arguments.
    """
    torque, force = _wrench(angles, vehicle)
    labels = ("a_X (m/s^2)", "a_Y (m/s^2)")
    conditions = np.stack([torque[2], force[2]]), np.array([0.0, HOVER_THRUST])
    return _image_of_slice(force[:2] / vehicle.mass, labels, conditions, input_box(speed_limits))


def _wrench(angles: ArrayLike, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Torque and force per ``w``, each of shape (3, 4), SI."""
    per_force = vehicle.thrust_coefficient
    torque = torque_matrix(angles, vehicle) * (vehicle.arm_length * per_force)
    return torque, force_matrix(angles) * per_force


def attainable_forces(rotors: TiltedRotors) -> AttainableSet:
    """The forces without torque (N, body axes)."""
    conditions = rotors.torque, np.zeros(3)
    return _image_of_slice(rotors.force, FORCES, conditions, rotors[2:4])


def attainable_torques(rotors: TiltedRotors, up: Floats) -> AttainableSet:
    """The torques (N m, body axes) while the lift along world ``up``, (3,), carries the weight."""
    conditions = (up @ rotors.force)[np.newaxis], np.array([rotors.weight])
    return _image_of_slice(rotors.torque, TORQUES, conditions, rotors[2:4])


def level_side_forces(rotors: TiltedRotors) -> AttainableSet:
    """The side forces (N, body axes) in level hover: without torque, the lift equal to the weight.

    Empty where the rotors cannot hover level.
    """
    rows = np.vstack([rotors.torque, rotors.force[2]])
    conditions = rows, np.array([0.0, 0.0, 0.0, rotors.weight])
    return _image_of_slice(rotors.force[:2], FORCES[:2], conditions, rotors[2:4])


def side_force_share(rotors: TiltedRotors) -> float:
    """The side force that level hover leaves in every direction, as a share of the weight."""
    from scipy.spatial import ConvexHull

    found = level_side_forces(rotors)
    if found.dimension < 2:
        return 0.0
    share = (
        -ConvexHull(found.vertices, qhull_options=ALMOST_FLAT).equations[:, -1].max()
        / rotors.weight
    )
    return max(0.0, float(share))


def _image_of_slice(
    image: Floats,
    labels: tuple[str, ...],
    conditions: tuple[Floats, Floats],
    box: tuple[Floats, Floats],
) -> AttainableSet:
    """``{image w : rows w = values, w in the box}``, with the conditions rows and values."""
    independent = _independent(*conditions)
    inputs = (
        box_slice_vertices(*box, *independent) if independent else np.empty((0, image.shape[1]))
    )
    points = inputs @ image.T
    reach = np.abs(image) @ np.abs(box).max(axis=0)
    keep, dimension = _hull(points, _INSIDE * reach)
    return AttainableSet(labels, points[keep], inputs[keep], dimension)


def _independent(rows: Floats, values: Floats) -> tuple[Floats, Floats] | None:
    """Independent conditions with the same solutions; None where they contradict each other."""
    sizes = np.linalg.norm(rows, axis=1)
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    axes, factors, base = np.linalg.svd(rows / sizes[:, np.newaxis])
    rank = int((factors > RANK_TOLERANCE).sum())
    if rank == len(rows):
        return rows, values
    along = axes.T @ (values / sizes)
    if np.abs(along[rank:]).max() > _INSIDE * np.abs(along).max():
        return None
    return base[:rank], along[:rank] / factors[:rank]


def _hull(points: Floats, rounding: Floats) -> tuple[NDArray[np.int_], int]:
    """Indices of the hull's vertices and the affine dimension of a set of points (N, d).

    Coordinates that nowhere exceed ``rounding``, shape (d,), are zero.
    """
    from scipy.spatial import ConvexHull

    if not len(points):
        return np.empty(0, dtype=int), -1
    centred = points - points.mean(axis=0)
    spread = np.abs(points).max(axis=0)
    scaled = centred / np.where(spread > rounding, spread, np.inf)
    _, values, axes = np.linalg.svd(scaled, full_matrices=False)
    dimension = int((values > 1e-9 * np.sqrt(len(points))).sum())
    flat = scaled @ axes[:dimension].T
    if dimension == 0:
        return np.array([0]), 0
    if dimension == 1:
        return np.array([flat[:, 0].argmin(), flat[:, 0].argmax()]), 1
    return np.asarray(ConvexHull(flat).vertices), dimension
