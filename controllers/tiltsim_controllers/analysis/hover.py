"""Hover of any number of rotors within their limits: with fixed tilts, or with the tilts to find.

Static hover means zero torque and a force as large as the weight. Its direction in the body is up
in the world: the vehicle leans by the angle between it and the body's z axis. The torque-free
forces within the rotors' limits are a polytope (`tiltsim_controllers.analysis.attainable`); the
hovers are its points at the distance of the weight from the origin. The one of least lean is level,
or on a face or an edge of the polytope, so it is found without search.

`level_hover` finds the tilt angles that hold a vehicle level against a constant acceleration: the
rotors make no torque and a force that balances weight and acceleration. Tilt angles for which rotor
speeds within the limits do so, with the least sum of squares, are found by sequential quadratic
programming over tilts and rotor inputs together, from several starts. Without a reserve the least
tilts would load some rotors fully and stop others.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from math import acos, radians
from typing import Final, NamedTuple

import numpy as np

from tiltsim_controllers.analysis.attainable import (
    ALMOST_FLAT,
    AttainableSet,
    TiltedRotors,
    attainable_forces,
)
from tiltsim_controllers.analysis.torque_free import RANK_TOLERANCE, torque_free_forces
from tiltsim_controllers.laws.full_pose import input_matrix
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.rotors import (
    ROTOR_FLOATS,
    SPIN_SIGN,
    by_tilt,
    rotors_in,
    tilt_of_rotor,
    wrench_map,
    wrench_slope,
)

INSIDE: Final = 1e-7
"""Share of the weight that counts as none; the linear programs are as accurate."""

RESERVE: Final = 0.01
"""Share of the mean thrust in hover that every rotor keeps from its limits to control with."""


class Hover(NamedTuple):
    """A static hover, with the smallest largest rotor speed in its attitude."""

    lean: float  # between the body's z axis and the vertical, rad
    force: Floats  # body axes, N, shape (3,)
    rotor_speeds: Floats  # varpi, signed, rad/s, shape (N,)
    controllable: bool  # torque and lift can change in every direction; see `hover`

    @property
    def max_rotor_speed(self) -> float:
        """The largest rotor speed (rad/s)."""
        return float(np.abs(self.rotor_speeds).max())


def hover(rotors: TiltedRotors) -> Hover | None:
    """The hover of least lean within the rotors' limits; None if there is none.

    If one of them is controllable, it is the controllable one of least lean: ``tau`` has rank 3 and
    every rotor has a `RESERVE`, so that torque and lift can grow and fall. Among the rotor speeds
    that make its force, the set with the smallest maximum is chosen.
    """
    mean = rotors.weight / np.linalg.norm(rotors.force, axis=0).sum()
    lower, upper = rotors.lower + RESERVE * mean, rotors.upper - RESERVE * mean
    if (lower < upper).all() and torque_free_forces(rotors.force, rotors.torque).rank == 3:
        found = _least_lean(rotors._replace(lower=lower, upper=upper), controllable=True)
        if found is not None:
            return found
    return _least_lean(rotors, controllable=False)


def _least_lean(rotors: TiltedRotors, *, controllable: bool) -> Hover | None:
    for force in _candidates(rotors):
        w = evenest_inputs(rotors, force)
        if w is not None:
            lean = acos(min(1.0, max(-1.0, float(force[2]) / rotors.weight)))
            return Hover(lean, force, np.copysign(np.sqrt(np.abs(w)), w), controllable)
    return None


def rotor_losses(rotors: TiltedRotors) -> list[Hover | None]:
    """The hover without each rotor in turn, at the same tilt angles; None where there is none.

    The lost rotor has speed zero.
    """
    losses = []
    for lost in range(rotors.lower.size):
        found = hover(rotors.without(lost))
        if found is not None:
            found = found._replace(rotor_speeds=np.insert(found.rotor_speeds, lost, 0.0))
        losses.append(found)
    return losses


def _candidates(rotors: TiltedRotors) -> list[Floats]:
    """Forces as large as the weight among which is the hover of least lean, least lean first."""
    points = [np.array([0.0, 0.0, rotors.weight])]
    found = attainable_forces(rotors)
    for corners in _faces(found):
        points += _highest_on_sphere(corners, rotors.weight)
    return sorted(points, key=lambda force: -float(force[2]))


def _faces(found: AttainableSet) -> Iterator[Floats]:
    """Vertices of the edges of a set of forces and, where it has an area, of its triangles."""
    from scipy.spatial import ConvexHull

    if found.dimension < 1:
        return
    if found.dimension == 1:
        yield found.vertices
        return
    if found.dimension == 2:  # its vertices are in order
        triangles = [(0, i, i + 1) for i in range(1, len(found.vertices) - 1)]
    else:
        triangles = ConvexHull(found.vertices, qhull_options=ALMOST_FLAT).simplices.tolist()
    yield from (found.vertices[list(triangle)] for triangle in triangles)
    edges = {tuple(sorted(edge)) for triangle in triangles for edge in combinations(triangle, 2)}
    yield from (found.vertices[list(edge)] for edge in edges)


def _highest_on_sphere(corners: Floats, radius: float) -> list[Floats]:
    """Where the plane or line through corners meets a sphere around the origin: the highest point.

    Both points of a line.
    """
    along = np.linalg.svd(corners[1:] - corners[0], full_matrices=False)[2]
    center = corners[0] - along.T @ (along @ corners[0])
    square = radius * radius - center @ center
    if square < -INSIDE * radius * radius:
        return []
    reach = np.sqrt(max(0.0, square))
    if len(along) == 1:
        return [center + reach * along[0], center - reach * along[0]]
    uphill = along.T @ along[:, 2]
    length = np.linalg.norm(uphill)
    return [center + reach * uphill / length] if length > INSIDE else []


def evenest_inputs(rotors: TiltedRotors, force: Floats) -> Floats | None:
    """The w of a torque-free force within the limits whose largest is smallest; None if none."""
    from scipy.optimize import linprog  # a third of a second to import

    unit = rotors.weight / np.linalg.norm(rotors.force, axis=0).max()
    arm = np.linalg.norm(rotors.torque, axis=0).max() * unit or 1.0
    rows = np.vstack([rotors.torque * unit / arm, rotors.force * unit / rotors.weight])
    ones = np.ones((rotors.lower.size, 1))
    identity = np.eye(rotors.lower.size)
    found = linprog(
        [0.0] * rotors.lower.size + [1.0],
        A_ub=np.block([[identity, -ones], [-identity, -ones]]),
        b_ub=np.zeros(2 * rotors.lower.size),
        A_eq=np.column_stack([rows, np.zeros(6)]),
        b_eq=np.concatenate([np.zeros(3), force / rotors.weight]),
        bounds=[*zip(rotors.lower / unit, rotors.upper / unit), (0.0, None)],
    )
    return np.asarray(found.x[:-1] * unit + 0.0) if found.status == 0 else None


BALANCED: Final = 1e-9
"""Force, as a share of the weight, and torque, of that on the longest lever, that count as none."""

LEVEL_RESERVE: Final = 0.25
"""Share of the mean thrust that every rotor keeps from its limits."""

MAX_TILT: Final = radians(60.0)

STARTS: Final = (0.0, 0.15, 0.4)
"""Size of the tilt angles (rad) at the starts of the search, equal and with alternating signs."""


def level_hover(
    table: Sequence[float], force: Floats, box: tuple[Floats, Floats], max_tilt: float = MAX_TILT
) -> tuple[Floats, Floats] | None:
    """The least tilt angles with which the rotors make a force without torque.

    Args:
        table: of the rotors, `tiltsim_controllers.vehicle.rotors`
        force: N, body axes, shape (3,)
        box: lower and upper bounds of the rotor inputs w, rad^2/s^2, shape (N,) each
        max_tilt: largest tilt angle, rad

    Returns:
        Tilt angles (rad) and rotor inputs w; None where no limits are met.
    """
    from scipy.optimize import minimize

    problem = _Problem(table, force)
    tilts, rotors = problem.tilts, problem.rotors
    reserve = LEVEL_RESERVE / problem.rotors
    low, high = box[0] / problem.unit + reserve, box[1] / problem.unit - reserve
    if (low > high).any():
        return None
    bounds = [(-max_tilt, max_tilt)] * tilts + [*zip(low, high, strict=True)]
    even = np.clip(problem.spins / rotors, low, high)
    by_turns = (-1.0) ** np.arange(tilts)
    candidates: list[Floats] = []
    for size in STARTS:
        for signs in (np.ones(tilts), by_turns):
            found = minimize(
                lambda x: float(x[:tilts] @ x[:tilts]),
                np.concatenate([size * signs, even]),
                jac=lambda x: np.concatenate([2.0 * x[:tilts], np.zeros(rotors)]),
                method="SLSQP",
                bounds=bounds,
                constraints={"type": "eq", "fun": problem.imbalance, "jac": problem.slopes},
                options={"ftol": 1e-14, "maxiter": 200},
            ).x
            if np.abs(problem.imbalance(found)).max() < BALANCED:
                candidates.append(found)
    if not candidates:
        return None
    best = min(candidates, key=lambda x: float(x[:tilts] @ x[:tilts]))
    return best[:tilts], best[tilts:] * problem.unit


class MovedOutputs(NamedTuple):
    """How many outputs rotors and tilts move independently of each other about a hover."""

    attitude_and_lift: int  # of four
    pose: int  # of six


def moved_outputs(table: Sequence[float], tilts: Floats, w: Floats) -> MovedOutputs:
    """The outputs that rotor speeds and tilts (rad, shape (M,)) move in a hover with inputs w.

    They are ``varpi |varpi|``, rad^2/s^2, shape (N,); the table is as for `level_hover`.
    """
    rotors = rotors_in(table, 0, tilt_of_rotor(table))
    rows = input_matrix(rotors, tilts, w / np.abs(w).max())
    rows /= np.repeat([np.abs(part).max() for part in (rows[:3], rows[3:])], 3)[:, np.newaxis]
    ranks = (np.linalg.matrix_rank(part, RANK_TOLERANCE) for part in (rows[[0, 1, 2, 5]], rows))
    return MovedOutputs(*map(int, ranks))


class _Problem:
    """Imbalance of tilts and inputs, in units of the desired force and its torque on a lever."""

    def __init__(self, table: Sequence[float], force: Floats) -> None:
        layout = tilt_of_rotor(table)
        self._map = rotors_in(table, 0, layout)
        self.rotors, self.tilts = len(layout), max(layout) + 1
        self.spins = np.array(table[SPIN_SIGN::ROTOR_FLOATS])
        rows = wrench_map(self._map, np.zeros(self.tilts))
        self.unit = float(np.linalg.norm(force) / np.linalg.norm(rows[:3], axis=0).max())
        lever = np.linalg.norm(rows[3:], axis=0).max() * self.unit
        self._scale = np.repeat([1.0 / np.linalg.norm(force), 1.0 / lever], 3)
        self._wanted = np.concatenate([force, np.zeros(3)])

    def imbalance(self, x: Floats) -> Floats:
        """Force less the desired one, and torque, shape (6,)."""
        wrench = wrench_map(self._map, x[: self.tilts]) @ (x[self.tilts :] * self.unit)
        return np.asarray((wrench - self._wanted) * self._scale)

    def slopes(self, x: Floats) -> Floats:
        """Its derivatives by tilts and inputs, shape (6, tilts + rotors)."""
        tilts, inputs = x[: self.tilts], x[self.tilts :] * self.unit
        per_input = wrench_map(self._map, tilts) * self.unit
        per_tilt = by_tilt(self._map, wrench_slope(self._map, tilts) * inputs)
        return np.asarray(np.hstack([per_tilt, per_input]) * self._scale[:, np.newaxis])
