"""Forces and torques that act on a vehicle from outside for a time: pushes, pulls, hung loads."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.records import Vector3

ROUNDING: Final = 1e-9
"""s by which a time may be rounded: a load begins and ends at equal steps on all plants."""


class Load(NamedTuple):
    """A force at a point, or a torque, from ``start`` to ``end``."""

    start: float = 0.0  # s
    end: float = inf  # s
    in_body: float = 0.0  # 1 if force and torque are in body axes, 0 if they are in the world's
    force: Vector3 = (0.0, 0.0, 0.0)  # N
    torque: Vector3 = (0.0, 0.0, 0.0)  # N m
    point: Vector3 = (0.0, 0.0, 0.0)  # m from the center of mass, body axes


def wrench_of_loads(time: Any, rotation: Any, loads: Iterable[Load]) -> Any:
    """Force (N) and torque (N m) about the center of mass, body axes, shape (6,).

    Args:
        time: s.
        rotation: From body to world axes, shape (3, 3).
        loads: Each acts from its start until before its end.
    """
    total = xp.zeros(6)
    for load in loads:
        later = time + ROUNDING
        acts = xp.where((later >= load.start) & (later < load.end), 1.0, 0.0)

        def in_body(value: Any, load: Load = load) -> Any:
            return xp.where(load.in_body > 0.0, value, rotation.T @ value)

        force = in_body(load.force)
        torque = in_body(load.torque) + cross(load.point, force)
        total = total + acts * xp.hstack([force, torque])
    return total
