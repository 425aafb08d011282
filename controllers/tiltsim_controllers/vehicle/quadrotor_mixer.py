"""Mixer of the quadrotor: rotor speeds that produce a thrust and three torques.

Rotors 1 to 4 are on +x, +y, -x and -y. With ``c_i = s_i varpi_i |varpi_i|``, positive for upward
thrust, the total thrust is ``K_f (c_1 + c_2 + c_3 + c_4)``, the roll torque ``L K_f (c_2 -
c_4)``, the pitch torque ``L K_f (c_3 - c_1)`` and the yaw torque ``K_m (c_1 - c_2 + c_3 - c_4)``:
ch. 3, Eqs. (3) and (5), without tilt.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.vehicle.parameters import Vehicle

CROSS: Final = np.array(
    [[1.0, 1.0, 1.0, 1.0], [0.0, 1.0, 0.0, -1.0], [-1.0, 0.0, 1.0, 0.0], [1.0, -1.0, 1.0, -1.0]]
)
"""Thrust and torques of the rotors, in the units of `wrench_units`."""


def wrench_units(vehicle: Vehicle) -> Any:
    """Thrust (N) and torques (N m) of a rotor per (rad/s)^2: ``K_f, L K_f, L K_f, K_m``."""
    lever = vehicle.arm_length * vehicle.thrust_coefficient
    return xp.array([vehicle.thrust_coefficient, lever, lever, vehicle.drag_coefficient])


@traceable
def thrust_controls(wrench: Any, vehicle: Vehicle) -> Any:
    """The ``c_i`` (rad^2/s^2), shape (4,), that produce a thrust and torques.

    Args:
        wrench: Thrust (N) and torques (N m) about the body axes, z up, shape (4,).
        vehicle: The quadrotor.
    """
    squares = (CROSS * CROSS).sum(axis=1)  # its rows are orthogonal
    return CROSS.T @ (wrench / (squares * wrench_units(vehicle)))


@traceable
def speed_along_spin(thrust_control: Any) -> Any:
    """The rotor speed (rad/s) of a ``c_i`` (rad^2/s^2), negative against the nominal spin."""
    return xp.copysign(xp.sqrt(abs(thrust_control)), thrust_control)
