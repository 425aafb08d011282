"""Tilt angles of any multirotor that hold it level against a constant acceleration.

The rotors then make no torque and a force that balances weight and acceleration. Tilt angles for
which rotor speeds within the limits do so, with the least sum of squares, are found by sequential
quadratic programming over tilts and rotor inputs together, from several starts. Without a reserve
the least tilts would load some rotors fully and stop others.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import minimize

from tiltsim_controllers.analysis.torque_free import RANK_TOLERANCE
from tiltsim_controllers.laws.full_pose import input_matrix
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.effectiveness import ROTOR_FLOATS, SPIN_SIGN, tilt_of_rotor
from tiltsim_controllers.vehicle.rotors import by_tilt, rotors_in, wrench_map, wrench_slope

BALANCED: Final = 1e-9
"""Force, as a share of the weight, and torque, of that on the longest lever, that count as none."""

RESERVE: Final = 0.25
"""Share of the mean thrust that every rotor keeps from its limits."""

MAX_TILT: Final = radians(60.0)

STARTS: Final = (0.0, 0.15, 0.4)
"""Size of the tilt angles (rad) at the starts of the search, equal and with alternating signs."""


def level_hover(
    table: Sequence[float], force: Floats, box: tuple[Floats, Floats], max_tilt: float = MAX_TILT
) -> tuple[Floats, Floats] | None:
    """The least tilt angles with which the rotors make a force without torque.

    Args:
        table: of the rotors, `tiltsim_controllers.vehicle.effectiveness`
        force: N, body axes, shape (3,)
        box: lower and upper bounds of the rotor inputs w, rad^2/s^2, shape (N,) each
        max_tilt: largest tilt angle, rad

    Returns:
        Tilt angles (rad) and rotor inputs w; None where no limits are met.
    """
    problem = _Problem(table, force)
    tilts, rotors = problem.tilts, problem.rotors
    reserve = RESERVE / problem.rotors
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
    """The outputs of a level hover with rotor speeds and tilt angles as inputs.

    Args:
        table: of the rotors, as for `level_hover`
        tilts: tilt angles, rad, shape (M,)
        w: rotor inputs ``varpi |varpi|``, rad^2/s^2, shape (N,)
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
