"""Mixer of the quadrotor: rotor speeds that produce a thrust and three torques.

Rotors 1 to 4 are on +x, +y, -x and -y. With ``c_i = s_i varpi_i |varpi_i|``, positive for upward
thrust, the total thrust is ``K_f (c_1 + c_2 + c_3 + c_4)``, the roll torque ``L K_f (c_2 -
c_4)``, the pitch torque ``L K_f (c_3 - c_1)`` and the yaw torque ``K_m (c_1 - c_2 + c_3 - c_4)``:
ch. 3, Eqs. (3) and (5), without tilt.
"""

from __future__ import annotations

from math import sqrt

from tiltsim_controllers.mathematics.scalar import Quad, scalar
from tiltsim_controllers.vehicle.parameters import Vehicle


@scalar
def thrust_controls(
    thrust: float, roll_torque: float, pitch_torque: float, yaw_torque: float, vehicle: Vehicle
) -> Quad:
    """The ``c_i`` (rad^2/s^2) that produce a thrust and torques.

    Args:
        thrust: N
        roll_torque, pitch_torque, yaw_torque: n m, body axes, z up
        vehicle: the quadrotor
    """
    lever = vehicle.arm_length * vehicle.thrust_coefficient
    lift = thrust / vehicle.thrust_coefficient
    roll, pitch = roll_torque / lever, pitch_torque / lever
    yaw = yaw_torque / vehicle.drag_coefficient
    along_x, along_y = 0.5 * (lift + yaw), 0.5 * (lift - yaw)  # sums of opposite rotors
    return (
        0.5 * (along_x - pitch),
        0.5 * (along_y + roll),
        0.5 * (along_x + pitch),
        0.5 * (along_y - roll),
    )


@scalar
def speed_along_spin(thrust_control: float) -> float:
    """The rotor speed (rad/s) of a ``c_i`` (rad^2/s^2), negative against the nominal spin."""
    return sqrt(thrust_control) if thrust_control >= 0.0 else -sqrt(-thrust_control)
