"""Where a flight comes to rest: steady states from statics alone (ch. 4, Remark 6)."""

from __future__ import annotations

from math import copysign, hypot, sqrt
from typing import TYPE_CHECKING

from tiltsim_controllers.analysis.singularity import torque_free_direction
from tiltsim_controllers.laws.attitude_altitude import Gains
from tiltsim_controllers.laws.decouplers import (
    CONVENTIONAL,
    EXACT,
    conventional_decoupler,
    exact_decoupler,
    modified_decoupler,
)
from tiltsim_controllers.vehicle.decoupling_matrix import (
    body_force,
    sines_and_cosines,
    torque_entries,
    torque_free_force,
    torque_free_inputs,
)
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle, drag_ratio

if TYPE_CHECKING:
    from tiltsim_controllers.mathematics.scalar import Quad


def hover_attitude(tilts: Quad, vehicle: Vehicle) -> tuple[float, float]:
    """Roll and pitch (rad) at which the torque-free force of fixed tilt angles is vertical."""
    trig = sines_and_cosines(*tilts)
    ratio = drag_ratio(vehicle)
    n = torque_free_force(trig, torque_entries(trig, ratio), ratio)
    return exact_decoupler(0.0, 0.0, 0.0, 0.0, vehicle.gravity, n)


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


def setpoint_error(
    tilts: Quad, vehicle: Vehicle, gains: Gains, decoupler: float
) -> tuple[float, float]:
    """Steady position error (m), reference minus actual, of a setpoint flown with fixed tilts.

    At rest the vehicle hovers at `hover_attitude`. A decoupler that takes another attitude for
    level demands acceleration there, and the position loop, ``a = K_2 e``, answers with an error.
    This inverts the decoupler at yaw 0, whose roll steers y and whose pitch steers x.
    """
    if decoupler == EXACT:
        return 0.0, 0.0
    roll, pitch = hover_attitude(tilts, vehicle)
    gravity = vehicle.gravity
    if decoupler == CONVENTIONAL:
        roll_bias, pitch_bias = conventional_decoupler(0.0, 0.0, 0.0, gravity)
    else:
        trig = sines_and_cosines(*tilts)
        ratio = drag_ratio(vehicle)
        n = torque_free_force(trig, torque_entries(trig, ratio), ratio)
        roll_bias, pitch_bias = modified_decoupler(0.0, 0.0, 0.0, gravity, n)
    stiffness = gains.position_2
    return gravity * (pitch - pitch_bias) / stiffness, -gravity * (roll - roll_bias) / stiffness
