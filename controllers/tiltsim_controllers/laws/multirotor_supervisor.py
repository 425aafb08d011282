"""The supervisor of any multirotor: its margin and determinant, as the tiltrotor's at four rotors.

The margin is the angle between world up and the nearest direction in which the controller has no
lift: with one component of force, the direction of the torque-free force with which it lifts; with
two the normal of their plane; with three there is none. The determinant is the volume of the
decoupling matrix's rows of torque and lift relative to the level untilted vehicle, times the share
of every further row of force that the rows before it leave: zero where the matrix is singular.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import asin, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from tiltsim_controllers.laws.force_directions import combination_of, factors_of, share_of
from tiltsim_controllers.laws.supervisor import UNTILTED, Assessment, Supervision, supervision_of
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import vectors_of
from tiltsim_controllers.vehicle.effectiveness import (
    TiltOfRotor,
    effectiveness_of,
    force_and_torque,
    tilt_of_rotor,
    tilts_of,
)


class Watched(NamedTuple):
    """Vehicle parameters used by the supervisor."""

    rotors: float = 0.0  # where in the knots the table of the rotors begins
    per_volume: float = 0.0  # of the determinant, 1 / (N^3 m^3) and units of the speeds
    side_x: float = 0.0  # of the torque-free force that points up, if it has two; else zero
    side_y: float = 0.0
    side_z: float = 0.0


def untilted_volume(table: Sequence[float]) -> float:
    """Volume of the rows of torque and lift of the level untilted vehicle; 0 where singular."""
    force, torque = force_and_torque(table, (0.0,) * tilts_of(tilt_of_rotor(table)))
    sizes = np.linalg.norm(torque, axis=-1).max(), np.linalg.norm(force[2])
    rows = np.vstack([torque / sizes[0], force[2] / sizes[1]])
    volume = float(np.prod(np.linalg.svd(rows, compute_uv=False)))
    return float(volume * sizes[0] ** 3 * sizes[1]) if volume > 1e-6 else 0.0


def watched(table: Sequence[float], rotors: int, side: Triple) -> Watched:
    """Parameters of a vehicle whose table begins at an index of the knots."""
    return Watched(float(rotors), UNTILTED / untilted_volume(table), *side)


@scalar
def watched_at(time: float, parameters: Any) -> Watched:
    """The watched vehicle at a time (s): without a rotor that is known to have failed."""
    seen: Watched = parameters.watched
    if time >= parameters.failure.known_from:
        seen = parameters.watched_without
    return seen


@cache
def multirotor_supervision_of(
    layout: TiltOfRotor, dimension: int, forward: bool = False
) -> Supervision:
    """The supervisor of vehicles of a layout, whose ``vehicle`` is a `Watched`.

    Args:
        layout: of the table of rotors
        dimension, forward: as for `tiltsim_controllers.laws.multirotor.multirotor_law_of`
    """
    cosines, sines, effect, _, _ = effectiveness_of(layout)
    length = len(layout)
    factors_of_rows = factors_of(length, dimension, forward)
    dot, combination, share_of_row = (
        vectors_of(length).dot,
        combination_of(length),
        share_of(length),
    )

    @scalar
    def margin_of(up: Triple, direction: Triple) -> float:
        """The margin by the ``direction`` of the factors, whatever its length."""
        if dimension == 3:
            return 0.5 * pi
        x, y, z = direction
        along = (x * up[0] + y * up[1] + z * up[2]) / sqrt(x * x + y * y + z * z)
        if dimension == 2:
            along = sqrt(max(0.0, 1.0 - along * along))
        return asin(min(1.0, along))

    @scalar
    def assess(tilts: Values, up: Triple, vehicle: Watched, knots: Vector) -> Assessment:
        rows = effect(1.0, cosines(tilts), sines(tilts), knots, int(vehicle.rotors))
        forces = rows[0], rows[1], rows[2]
        _, lifts, units, direction = factors_of_rows(rows, forces, up)
        lift = combination(up, *forces)
        size = dot(rows[3], units[0]) * dot(rows[4], units[1]) * dot(rows[5], units[2])
        size *= vehicle.per_volume * sqrt(dot(lift, lift))
        for k in range(dimension):
            size *= share_of_row(lifts[k], units[3 + k])
        if not size > 0.0:
            return 0.0, 0.0, up
        margin = margin_of(up, direction)
        if dimension == 1:
            side = (vehicle.side_x, vehicle.side_y, vehicle.side_z)
            if dot(units[3], combination(side, *forces)) < 0.0:
                return -margin, -size, direction
        return margin, size, direction

    return supervision_of(tilts_of(layout), assess)
