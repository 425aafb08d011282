"""Vehicles under a supervisor: the margin and determinant of the tiltrotor and of any multirotor.

The margin is the angle between world up and the nearest direction in which the controller has no
lift: with one component of force, the nearest direction across the torque-free force with which it
lifts; with two, the normal of their plane; with three there is none. The determinant is the volume
of the decoupling matrix's rows of torque and lift relative to the level untilted vehicle, times the
share of every further row of force that the rows before it leave: zero where the matrix is
singular.

The tiltrotor's matrix is singular where ``n(alpha) . r3 = 0`` (`vehicle.decoupling_matrix`); its
determinant is ``n . r3``, 4 for a level untilted vehicle. Only the determinant shows that a gait
approaches the curve L of the Two Color Map, where ``n`` vanishes whatever its direction. At zero
tilts and on red ``n`` is vertical.
"""

from collections.abc import Sequence
from functools import cache
from math import pi
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.gaits.colors import nearest_red_angles
from tiltsim_controllers.gaits.motion import NO_KNOTS
from tiltsim_controllers.laws.force_directions import factors, share
from tiltsim_controllers.laws.supervisor import UNTILTED, Supervision, Supervisor
from tiltsim_controllers.mathematics.linear import norm
from tiltsim_controllers.mathematics.moving import Moving
from tiltsim_controllers.mathematics.records import Vector3
from tiltsim_controllers.mathematics.scalar import Triple
from tiltsim_controllers.vehicle.cross import torque_free_force
from tiltsim_controllers.vehicle.parameters import drag_ratio
from tiltsim_controllers.vehicle.rotors import (
    TiltOfRotor,
    force_and_torque,
    rotors_in,
    tilt_of_rotor,
    tilts_of,
    wrench_map,
)


class Watched(NamedTuple):
    """Vehicle parameters used by the supervisor."""

    rotors: float = 0.0  # where in the knots the table of the rotors begins
    per_volume: float = 0.0  # of the determinant, 1 / (N^3 m^3) and units of the speeds
    side: Vector3 = (0.0, 0.0, 0.0)  # of the torque-free force that points up, if it has two


def untilted_volume(table: Sequence[float]) -> float:
    """Volume of the rows of torque and lift of the level untilted vehicle; 0 where singular."""
    force, torque = force_and_torque(table, (0.0,) * tilts_of(tilt_of_rotor(table)))
    sizes = np.linalg.norm(torque, axis=-1).max(), np.linalg.norm(force[2])
    rows = np.vstack([torque / sizes[0], force[2] / sizes[1]])
    volume = float(np.prod(np.linalg.svd(rows, compute_uv=False)))
    return float(volume * sizes[0] ** 3 * sizes[1]) if volume > 1e-6 else 0.0


def watched(table: Sequence[float], rotors: int, side: Triple) -> Watched:
    """Parameters of a vehicle whose table begins at an index of the knots."""
    return Watched(float(rotors), UNTILTED / untilted_volume(table), side)


@traceable
def watched_at(time: Any, parameters: Any) -> Watched:
    """Parameters of the rotors that work at a time (s): without a failed one once it is known.

    A law's parameters have ``watched``, ``watched_without`` and ``failure``.
    """
    whole, rest = parameters.watched, parameters.watched_without
    if rest.rotors == 0.0:  # no table without a rotor: no failure will be known
        return whole
    known = time >= parameters.failure.known_from
    return Watched(*(xp.where(known, b, a) for a, b in zip(whole, rest, strict=True)))


def _margin(up: Any, direction: Any, dimension: int) -> Any:
    """The margin (rad) by the ``direction`` of the factors, whatever its length."""
    if dimension == 3:
        return 0.5 * pi
    along = direction @ up / norm(direction)
    if dimension == 2:
        along = xp.sqrt(xp.maximum(0.0, 1.0 - along * along))
    return xp.arcsin(xp.minimum(1.0, along))


@cache
def multirotor_supervision_of(
    layout: TiltOfRotor, dimension: int, forward: bool = False
) -> Supervision:
    """The supervisor of vehicles of a layout, whose ``vehicle`` is a `Watched`.

    On dimension and forward see `tiltsim_controllers.laws.force_directions.factors`.
    """

    @traceable
    def assess(
        tilts: Any, up: Any, vehicle: Watched, knots: Any = NO_KNOTS
    ) -> tuple[Any, Any, Any]:
        wrench = wrench_map(rotors_in(knots, vehicle.rotors, layout), tilts)
        force, torque = wrench[:3], wrench[3:]
        _, lifts, units, direction = factors(wrench, force, up, dimension, forward)
        size = (torque[0] @ units[0]) * (torque[1] @ units[1]) * (torque[2] @ units[2])
        size = size * (vehicle.per_volume * norm(up @ force))
        for lift, unit in zip(lifts, units[3:]):
            size = size * share(lift, unit)
        regular = size > 0.0
        margin = _margin(up, direction, dimension)
        if dimension == 1:
            sign = xp.where(units[3] @ (vehicle.side @ force) < 0.0, -1.0, 1.0)
            margin, size = sign * margin, sign * size
        return (
            xp.where(regular, margin, 0.0),
            xp.where(regular, size, 0.0),
            xp.where(regular, direction, up),
        )

    return Supervision(tilts_of(layout), watched_at, assess)


NEAR: Final = 0.05
"""rad: the distance from red, for the speed of the return, is at least this."""


@traceable
def assess(tilts: Any, up: Any, drag_ratio: Any, knots: Any = NO_KNOTS) -> tuple[Any, Any, Any]:
    """Singularity margin (rad), determinant and ``n``, along which the vehicle hovers.

    Args:
        tilts: rad, shape (4,).
        up: World up in body axes, shape (3,).
        drag_ratio: ``r = K_m / (L K_f)``.
        knots: Not used here.
    """
    n = torque_free_force(tilts, drag_ratio)
    along, length = n @ up, norm(n)
    exists = length != 0.0
    sine = xp.where(exists, along / xp.where(exists, length, 1.0), 0.0)
    margin = xp.arcsin(xp.minimum(1.0, xp.maximum(-1.0, sine)))
    return margin, xp.where(exists, along, 0.0), xp.where(exists, n, up)


def _towards_red(planned: Any, motion: Any, supervisor: Supervisor, drag_ratio: Any) -> Any:
    """Tilts moved by a fraction of the path to red, shape (4, 3)."""
    red = nearest_red_angles(planned, drag_ratio, supervisor.clearance)
    way = Moving(*motion) * Moving(*(xp.vstack([red, red]) - planned).T)
    return planned + xp.stack([way.value, way.rate, way.acceleration], 1)


def _return_speed(planned: Any, supervisor: Supervisor, drag_ratio: Any) -> Any:
    """Rate (1/s) along the path to red at which the fastest tilt has its maximum rate."""
    red = nearest_red_angles(planned, drag_ratio, supervisor.clearance)[:, 0]
    longest = NEAR
    for way in abs(xp.hstack([red, red]) - planned[:, 0]):
        longest = xp.maximum(longest, way)
    return supervisor.max_rate / longest


SUPERVISION: Final = Supervision(
    4, lambda _, p: drag_ratio(p.vehicle), assess, _towards_red, _return_speed
)
"""Its functions; the ``vehicle`` is the drag ratio ``r = K_m / (L K_f)``."""
