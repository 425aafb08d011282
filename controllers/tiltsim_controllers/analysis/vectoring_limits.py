"""Limits of a vehicle as `vectoring` sees it: forces, poses and torques that its rotors leave.

Side force that needs no lean, and the poses that it holds, come from linear programs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from math import atan, inf, pi
from typing import Final

import numpy as np

from tiltsim_controllers.laws.full_pose import pose_rank
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.rotors import (
    ROTOR_FLOATS,
    SPIN_SIGN,
    by_tilt,
    force_and_torque,
    rotors_in,
    tilt_of_rotor,
    wrench_slope,
)

SIDE_SHARE: Final = 0.65
"""Share of the greatest thrusts that side force may take."""
SERVO_ANGLE: Final = 0.3
"""rad: the tilt by which braking counts about an axis that only tilts turn."""
TILT_SHARE: Final = 0.9
"""Share of the range of tilts that side force may take; the rest is left for yaw."""
SLOPE_SHARE: Final = 0.8
"""Share of the greatest side force in hover on which the law relies."""
DIRECTIONS: Final = 8
"""Directions of side force in the linear programs."""


@dataclass(frozen=True)
class Craft:
    """A vehicle as the design sees it, N rotors with M tilts."""

    table: Values  # table of the rotors, per newton
    mass: float  # kg
    gravity: float  # m/s^2
    inertia: Floats  # kg m^2, shape (3, 3)
    thrust: Floats  # K_f, N s^2/rad^2, shape (N,)
    slowest: Floats  # least speeds, rad/s, along the spin, shape (N,)
    fastest: Floats  # largest ones, rad/s, along the spin, shape (N,)
    tilts: Floats  # at the start, rad, shape (M,)
    commanded: bool  # whether the law commands the tilts
    tilt_range: float  # rad, of these, from the preferred ones
    moving: bool  # whether a gait moves them
    levers: Floats  # m, of the rotors from the center of mass, shape (N,)
    works: Floats  # 1 for a rotor that works, else 0, shape (N,)

    @property
    def hover(self) -> float:
        """Thrust (N) of a rotor in hover, were all upward."""
        return self.mass * self.gravity / len(self.thrust)

    @property
    def limits(self) -> tuple[Floats, Floats]:
        """Least and greatest thrusts, N, shape (N,) each."""
        low, high = (self.thrust * s * np.abs(s) for s in (self.slowest, self.fastest))
        return low, high

    def outputs(self, tilts: Floats) -> int:
        """How many of the six outputs rotors and tilts move."""
        spins = np.reshape(self.table, (len(self.thrust), ROTOR_FLOATS))[:, SPIN_SIGN]
        return pose_rank(self.table, tilts, spins * self.works)

    def wrench(self, tilts: Floats) -> Floats:
        """Force and torque per newton, shape (6, N)."""
        force, torque = force_and_torque(self.table, tilts[np.newaxis])
        return np.vstack([force[0], torque[0]]) * self.works


def preferred_tilts(craft: Craft) -> Floats:
    """The gait's angles or level ones, whichever are farther from singular, rad, shape (M,)."""
    if not craft.commanded:
        return craft.tilts

    def margin(tilts: Floats) -> float:
        scale = np.repeat([1.0, 1.0 / float(craft.levers.mean())], 3)[:, np.newaxis]
        rows = scale * craft.wrench(tilts)
        sizes = [np.linalg.svd(part, compute_uv=False)[-1] for part in (rows, rows[2:])]
        return float((sizes[0] if len(craft.thrust) >= 6 else 0.0) + 1e-3 * sizes[1])

    return max((craft.tilts, np.zeros(len(craft.tilts))), key=margin)


def side_slope(craft: Craft) -> float:
    """Side force per lift that level hover has in every direction within the limits."""
    if craft.moving:
        return 0.0
    weight = craft.mass * craft.gravity
    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    sides = [np.array([np.cos(angle), np.sin(angle), 0.0]) for angle in angles]
    low, most = craft.limits[0], np.minimum(SIDE_SHARE * craft.limits[1], 2.4 * craft.hover)
    preferred = preferred_tilts(craft)
    rows = craft.wrench(preferred)
    if craft.commanded:
        # A rotor that tilts within a range pushes like two rotors at its ends.
        most_tilt = TILT_SHARE * craft.tilt_range
        rows = np.hstack([craft.wrench(preferred + tilt) for tilt in (-most_tilt, most_tilt)])
        low, most = np.zeros(rows.shape[1]), np.tile(most, 2)
    return SLOPE_SHARE * least_force(rows, sides, weight, (low, most)) / weight


def pose_cone(craft: Craft, rows: Floats, slope: float) -> float:
    """Angle (rad) from level of the poses that side force holds; pi where all are held.

    Args:
        craft: The vehicle.
        rows: Force and torque per newton, shape (6, N).
        slope: Result of `side_slope`.
    """
    weight, most = craft.mass * craft.gravity, SIDE_SHARE * craft.limits[1]
    ways = [np.array(way) for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)]
    units = [way / np.linalg.norm(way) for way in ways]
    holds_all = slope > 0.0 and not craft.commanded
    if holds_all and least_force(rows, units, 0.0, (craft.limits[0], most)) > weight:
        return pi
    return atan(slope / SLOPE_SHARE if craft.commanded else slope)


def least_force(
    rows: Floats, ways: Sequence[Floats], lift: float, limits: tuple[Floats, Floats]
) -> float:
    """The least over some directions of the greatest force (N) without torque; 0 for none.

    Args:
        rows: Force and torque per newton, shape (6, N).
        ways: Unit vectors of the directions, body axes.
        lift: N, that the rotors make as well, along z.
        limits: Least and greatest thrusts, N, shape (N,) each.
    """
    return _least_force(rows.tobytes(), np.array(ways).tobytes(), lift, np.array(limits).tobytes())


@lru_cache(maxsize=64)
def _least_force(rows_of: bytes, ways: bytes, lift: float, limits: bytes) -> float:
    """`least_force` of arrays as bytes, kept because a flight needs it several times."""
    from scipy.optimize import linprog  # a third of a second to import

    rows = np.frombuffer(rows_of).reshape(6, -1)
    if np.linalg.matrix_rank(rows, tol=1e-6) < 6:
        return 0.0
    bounds = [*np.frombuffer(limits).reshape(2, -1).T.tolist(), (0, None)]
    forces = []
    for way in np.frombuffer(ways).reshape(-1, 3):
        found = linprog(
            np.array([*np.zeros(rows.shape[1]), -1.0]),
            A_eq=np.column_stack([rows, [*-way, 0.0, 0.0, 0.0]]),
            b_eq=lift * np.eye(6)[2],
            bounds=bounds,
        )
        forces.append(-float(found.fun) if found.status == 0 else 0.0)
    return min(forces)


def sideways_limit(craft: Craft, rows: Floats) -> float:
    """Bandwidth (rad/s) below which a lean pushes more than the torque that makes it.

    A torque of canted rotors pushes sideways, at ``lever`` times the angular acceleration; a lean
    of a vehicle without side force gives ``gravity / frequency^2`` times it.

    Args:
        craft: The vehicle.
        rows: Force and torque per newton, shape (6, N).
    """
    made = np.linalg.pinv(rows[2:], rcond=1e-9)[:, 1:] @ craft.inertia / craft.mass
    lever = float(np.linalg.norm(rows[:2] @ made, 2))
    return inf if lever < 1e-9 else (craft.gravity / lever) ** 0.5


def free_axis(rows: Floats) -> Floats:
    """Unit axis of the force of the least thrusts that lift without torque, shape (3,)."""
    up, torque = rows[2], rows[3:]
    free = up - np.linalg.pinv(torque, rcond=1e-9) @ (torque @ up)
    force = rows[:3] @ free
    size = float(np.linalg.norm(force))
    return force / size if size > 1e-9 else np.array([0.0, 0.0, 1.0])


def authority(craft: Craft, rows: Floats, tilts: Floats) -> tuple[float, float]:
    """Angular accelerations (rad/s^2) about x and y, and about z, that hover leaves.

    By the thrusts; about an axis that only tilts turn, by these.
    """
    low, high = craft.limits
    room = np.maximum(np.minimum(high - craft.hover, craft.hover - low), 0.05 * craft.hover)
    turn = np.abs(rows[3:]) @ room / np.diag(craft.inertia)
    if craft.commanded:
        rotors = rotors_in(craft.table, 0, tilt_of_rotor(craft.table))
        slopes = np.abs(by_tilt(rotors, wrench_slope(rotors, tilts)))[3:]
        turning = SERVO_ANGLE * craft.hover * slopes.sum(axis=1) / np.diag(craft.inertia)
        turn = np.where(turn < 0.1 * turn.max(), np.maximum(turn, turning), turn)
    return min(500.0, float(turn[:2].min())), min(350.0, float(turn[2]))
