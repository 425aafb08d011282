"""Rotor speeds in hover with fixed tilts, from statics alone (ch. 4, Remark 6)."""

from __future__ import annotations

from math import copysign, hypot, sqrt

from tiltsim_controllers.analysis.singularity import torque_free_direction
from tiltsim_controllers.mathematics.scalar import Quad
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    sines_and_cosines,
    torque_entries,
    torque_free_inputs,
)
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle, drag_ratio


def hover_rotor_speeds(tilts: Quad, vehicle: Vehicle) -> Quad | None:
    """Rotor speeds (rad/s) along the spins with which fixed ``tilts`` (rad) support the weight.

    Their torque is zero and their force as large as the weight, upward at level attitude or as
    nearly as the tilts allow. Negative where a rotor would have to turn backwards, which the
    singularity margin does not show. None where there is no such force or it has no upward part.
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
    """The rotor speed with a given signed square."""
    return copysign(sqrt(abs(square)), square)
