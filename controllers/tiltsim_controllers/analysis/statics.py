"""Where a flight comes to rest: steady states from statics alone (ch. 4, Remark 6)."""

from __future__ import annotations

from math import copysign, hypot, sqrt
from typing import TYPE_CHECKING

from tiltsim_controllers.analysis.singularity import torque_free_direction
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    sines_and_cosines,
    torque_entries,
    torque_free_inputs,
)
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle, drag_ratio

if TYPE_CHECKING:
    from tiltsim_controllers.mathematics.scalar import Quad


def hover_rotor_speeds(tilts: Quad, vehicle: Vehicle) -> Quad | None:
    """Rotor speeds (rad/s) along the spins with which fixed tilt angles carry the weight.

    They make no torque and a force as large as the weight, up at level attitude or as near to it as
    the tilts allow. Negative where a rotor would have to turn backwards, which the singularity
    margin says nothing of. None where there is no such force, or it has no part upwards.
    """
    if not torque_free_direction(tilts, vehicle)[2] > 0.0:
        return None
    trig = sines_and_cosines(*tilts)
    inputs = torque_free_inputs(torque_entries(trig, drag_ratio(vehicle)))
    x, y, z = body_force(trig, *inputs)
    weight = vehicle.mass * vehicle.gravity / vehicle.thrust_coefficient
    scale = copysign(weight / hypot(x, y, z), z)
    w1, w2, w3, w4 = (spin * scale * w for spin, w in zip(SPIN, inputs, strict=True))
    return _speed(w1), _speed(w2), _speed(w3), _speed(w4)


def _speed(square: float) -> float:
    """The rotor speed whose square, with its sign, is given."""
    return copysign(sqrt(abs(square)), square)
