"""Steady states of flights with fixed tilts, from statics alone (ch. 4, Remark 6)."""

from __future__ import annotations

import numpy as np

from tiltsim_controllers.laws.feedback import (
    CONVENTIONAL,
    EXACT,
    conventional_decoupler,
    exact_decoupler,
    modified_decoupler,
)
from tiltsim_controllers.vehicle.cross import torque_free_force
from tiltsim_controllers.vehicle.parameters import drag_ratio


def hover_attitude(tilts, vehicle):
    """Roll and pitch (rad) at which the torque-free force of fixed tilt angles is vertical."""
    n = torque_free_force(np.array(tilts), drag_ratio(vehicle))
    return exact_decoupler(0.0, 0.0, 0.0, 0.0, vehicle.gravity, n)


def setpoint_error(tilts, vehicle, gains, decoupler):
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
        n = torque_free_force(np.array(tilts), drag_ratio(vehicle))
        roll_bias, pitch_bias = modified_decoupler(0.0, 0.0, 0.0, gravity, n)
    stiffness = gains.position[1]
    return gravity * (pitch - pitch_bias) / stiffness, -gravity * (roll - roll_bias) / stiffness
