"""Hover after the failure of a rotor, with partial thrust, or with a stuck tilt servo.

The thesis leaves this question open. Static hover means zero torque and a force as large as the
weight; the vehicle may lean so that it points up. In units of ``L K_f`` and with ``r = K_m / (L
K_f) = tan(delta)`` the torque matrix (ch. 3, Eq. 5) is, up to the factor ``1 / cos(delta)``,

    rotors 2, 4:  roll ``cos(a2 + delta)``, ``-cos(a4 + delta)``;  yaw ``-sin(ai + delta)``
    rotors 1, 3:  pitch ``cos(a1 - delta)``, ``-cos(a3 - delta)``;  yaw ``sin(ai - delta)``

Without rotor 1 only rotor 3 produces pitch torque. For the loss of rotor 1 (for the others rotate
the vehicle, and mirror it for rotors 2 and 4):

- Rotors 2 and 4 alone hover at ``a2 = a4 = -delta``, where the tilt of each compensates its drag
  torque; each must carry ``m g / (2 cos(delta))``. Pitch is then uncontrolled.
- With rotor 3 turning at ``a3 = delta - pi/2``, where its pitch torque vanishes, there is a family
  of hovers. Tilting rotor 3 from there produces pitch torque of either sign, and three speeds and
  three tilts control all six components of force and torque: the vehicle, leaning slightly, stays
  fully controllable.
- With fixed tilts, two or three rotors hover only where ``a2 + a4 = -2 delta``, the condition of
  the blue planes of the Two Color Map on this pair: the rank deficiency that the intact vehicle
  must avoid is necessary to hover on the pair. Pitch is uncontrolled.
"""

from dataclasses import dataclass
from itertools import product
from math import asin, atan, atan2, cos, hypot, pi, sin, sqrt
from typing import Any, Final

import numpy as np

from tiltsim_controllers.analysis.singularity import force_matrix, torque_matrix
from tiltsim_controllers.laws.full_pose import input_matrix
from tiltsim_controllers.mathematics.scalar import Floats, Quad
from tiltsim_controllers.vehicle.body import ROTORS
from tiltsim_controllers.vehicle.cross import cross_table
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle, drag_ratio
from tiltsim_controllers.vehicle.rotors import rotors_in

BALANCED: Final = 1e-9
"""Torque, in units of ``L m g``, that counts as zero."""
POLYGON: Final = 24
"""Corners of the polygon that stands for a disk; a local search takes away its error."""


@dataclass(frozen=True)
class Hover:
    """A static hover: tilts, rotor speeds and the attitude in which the force points up."""

    tilts: Quad  # rad
    rotor_speeds: Quad  # rad/s, absolute
    roll: float  # rad
    pitch: float  # rad
    authority: float  # smallest over largest singular value of `pose_matrix`; 0: uncontrollable

    @property
    def max_rotor_speed(self) -> float:
        """The largest rotor speed (rad/s)."""
        return max(self.rotor_speeds)


def pose_matrix(tilts: Quad, rotor_speeds: Quad, vehicle: Vehicle, lost: int | None) -> Floats:
    """Force and torque per speed and tilt of the working rotors, shape (6, 8 or 6).

    Forces are in units of the weight, torques in units of the weight times the arm's length, inputs
    are relative changes of thrust and tilts in rad.

    Args:
        tilts, rotor_speeds: rad, rad/s
        vehicle: the tiltrotor
        lost: failed rotor, 1 to 4, or None
    """
    w = np.array(SPIN) * np.square(rotor_speeds)
    rotors = rotors_in(cross_table(vehicle, tilting=True), 0, (0, 1, 2, 3))
    torque, force = np.split(input_matrix(rotors, np.array(tilts), w), 2)
    rows = np.vstack([force, torque / vehicle.arm_length]) / (vehicle.mass * vehicle.gravity)
    rows[:, :4] *= w
    sound = [column for column in range(8) if lost is None or column % 4 != lost - 1]
    return np.asarray(rows[:, sound])


def _hover(tilts: Quad, rotor_speeds: Quad, vehicle: Vehicle, lost: int | None) -> Hover:
    w = np.array(rotor_speeds) ** 2 * SPIN
    x, y, z = (force_matrix(np.array(tilts)) @ w).tolist()
    values = np.linalg.svd(pose_matrix(tilts, rotor_speeds, vehicle, lost), compute_uv=False)
    # World up in body axes is (-sin pitch, sin roll cos pitch, cos roll cos pitch).
    roll, pitch = atan2(y, z), -asin(x / hypot(x, y, z))
    return Hover(tilts, rotor_speeds, roll, pitch, float(values[5] / values[0]))


def three_rotor_hover(lost: int, vehicle: Vehicle, *, opposite_speed: float) -> Hover:
    """The hover without a rotor, 1 to 4, in which its two neighbors share the weight evenly.

    The ``opposite_speed`` (rad/s) of the rotor opposite the lost one determines the authority over
    the torque that only this rotor produces. At 0 the other two hover alone.

    Raises:
        ValueError: If there is no such rotor, or the opposite rotor alone would outweigh the
            vehicle.
    """
    if lost not in ROTORS:
        raise ValueError(f"lost = {lost!r}: must be a rotor, 1 to 4")
    delta = atan(drag_ratio(vehicle))
    weight = vehicle.mass * vehicle.gravity / vehicle.thrust_coefficient
    across = opposite_speed * opposite_speed
    if opposite_speed < 0.0 or across * cos(delta) >= weight:
        raise ValueError(
            f"opposite_speed = {opposite_speed!r}: must lie between 0 and "
            f"{sqrt(weight / cos(delta)):.4g} rad/s, where this rotor alone outweighs the vehicle"
        )
    # The opposite rotor pushes across the lean, all three lift along it; yaw: sin(beta) w = half.
    lift = sqrt(weight * weight - (across * cos(delta)) ** 2)
    upright = (lift - 2.0 * across * sin(delta)) / (2.0 * cos(delta))
    beside = hypot(upright, 0.5 * across)
    beta = atan2(0.5 * across, upright)
    # Rotors 2 and 4 turn the other way and tilt in the mirror.
    mirror = -SPIN[lost - 1]
    tilts, speeds = [0.0] * 4, [0.0] * 4
    for step in (1, 3):
        tilts[(lost - 1 + step) % 4] = mirror * (beta - delta)
        speeds[(lost - 1 + step) % 4] = sqrt(beside)
    tilts[(lost + 1) % 4] = mirror * (delta - 0.5 * pi)
    speeds[(lost + 1) % 4] = opposite_speed
    return _hover(_quad(tilts), _quad(speeds), vehicle, lost)


def fixed_tilt_imbalance(tilts: Quad | Floats, lost: int, vehicle: Vehicle) -> float:
    """Deviation (rad) of fixed tilts from hover without a rotor: ``a_i + a_k -+ 2 delta``.

    ``i`` and ``k`` are the neighbors of the rotor ``lost``. Zero where they hover alone, with the
    opposite rotor at rest.
    """
    delta = atan(drag_ratio(vehicle))
    beside = tilts[lost % 4] + tilts[(lost + 2) % 4]
    return float(beside - 2.0 * SPIN[lost - 1] * delta)


def minimum_hover_speed(
    vehicle: Vehicle,
    *,
    factors: Quad = (1.0, 1.0, 1.0, 1.0),
    stuck: tuple[int, float] | None = None,
    upright: bool = False,
) -> float:
    """The minimum over all tilts of the largest rotor speed (rad/s) in hover after a fault.

    Hovers upside down count, unless excluded: half a turn of all four pods reverses force and
    torque, so a servo stuck at an angle is worth one stuck at the opposite angle, the body turned
    over.

    Args:
        vehicle: the tiltrotor
        factors: remaining fraction of each rotor's thrust and drag torque; 0 for a failed one
        stuck: A rotor, 1 to 4, and the angle (rad) its servo holds.
        upright: Whether the body's z axis must point up, or to the side.

    Returns:
        With a lower speed limit no hover is possible; infinite where no speed is enough.
    """
    from scipy.optimize import minimize

    scale = np.array(factors) * SPIN

    def tilts_of(x: Floats) -> Floats:
        tilts = x[:4].copy()
        if stuck is not None:
            tilts[stuck[0] - 1] = stuck[1]
        return tilts

    def force(x: Floats) -> Floats:
        return np.asarray(force_matrix(tilts_of(x)) @ (x[4:8] * scale))

    def balance(x: Floats) -> Floats:
        torque = torque_matrix(tilts_of(x), vehicle) @ (x[4:8] * scale)
        return np.array([*torque, force(x) @ force(x) - 1.0])

    constraints: list[dict[str, Any]] = [
        {"type": "eq", "fun": balance},
        {"type": "ineq", "fun": lambda x: x[8] - x[4:8]},
    ]
    if upright:
        constraints.append({"type": "ineq", "fun": lambda x: force(x)[2]})
    best = np.inf
    for start in _strong_hovers(vehicle, scale, stuck, upright):
        found = minimize(
            lambda x: float(x[8]),
            start,
            method="SLSQP",
            bounds=[(None, None)] * 4 + [(0.0, None)] * 5,
            constraints=constraints,
            options={"ftol": 1e-12, "maxiter": 300},
        )
        if np.abs(balance(found.x)).max() < 1e-8:
            best = min(best, float(found.x[4:8].max()))
    return sqrt(vehicle.mass * vehicle.gravity / vehicle.thrust_coefficient * best)


def _strong_hovers(
    vehicle: Vehicle, scale: Floats, stuck: tuple[int, float] | None, upright: bool
) -> Floats:
    """Hovers near the least rotor speed, found globally.

    A free pod makes any thrust in a disk spanned by the directions across its arm and up, a stuck
    one any on a segment, so that forces without torque form a convex set. The strongest of them is
    the strongest along its own direction. Along a direction, with disks replaced by polygons, it
    is the optimum of a linear program; the force found gives the next direction. A row has the
    tilts (rad), the rotor inputs and their bound, in units of the weight.
    """
    from scipy.optimize import linprog
    from scipy.sparse import block_diag

    tilts = np.repeat(np.linspace(-pi, pi, POLYGON, endpoint=False)[:, None], 4, axis=1)
    if stuck is not None:
        tilts[:, stuck[0] - 1] = stuck[1]
    # One column for each corner of each polygon.
    torque = np.swapaxes(torque_matrix(tilts, vehicle) * scale, 0, 1).reshape(3, -1)
    force = np.swapaxes(force_matrix(tilts) * scale, 0, 1).reshape(3, -1)
    limited, limits = np.tile(np.eye(4), POLYGON), [1.0] * 4
    if upright:
        limited, limits = np.vstack([limited, -force[2]]), [*limits, 0.0]

    directions = np.array([axis for axis in product((-1.0, 0.0, 1.0), repeat=3) if any(axis)])
    for _ in range(3):
        count = len(directions)  # programs without a common variable, solved as one
        found = linprog(
            -(directions @ force).ravel(),
            *(block_diag([limited] * count), np.tile(limits, count)),
            *(block_diag([torque] * count), np.zeros(3 * count)),
        ).x.reshape(count, -1)
        strength = np.linalg.norm(found @ force.T, axis=1)
        best = np.argsort(-strength)[: max(3, count // 2)]
        best = best[strength[best] > BALANCED]
        if best.size == 0:
            return np.empty((0, 9))
        found, strength = found[best], strength[best]
        directions = found @ force.T / strength[:, None]

    thrusts = found.reshape(-1, POLYGON, 4)
    across, up = (thrusts * np.sin(tilts)).sum(axis=1), (thrusts * np.cos(tilts)).sum(axis=1)
    inputs = np.hypot(across, up) / strength[:, None]
    return np.column_stack([np.arctan2(across, up), inputs, 1.0 / strength])


def _quad(values: object) -> Quad:
    a, b, c, d = np.asarray(values, dtype=float).tolist()
    return a, b, c, d
