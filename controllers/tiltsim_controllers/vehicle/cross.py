"""The thesis's cross of four rotors: its table, its decoupling matrix, and the quadrotor's mixer.

Ch. 3 (Eqs. 3, 5, 12, 16-18) examines when ``[tau(alpha); r3^T F(alpha)]`` is invertible, with
``r3`` the third row of the body-to-world rotation (world up in body axes), and expands the
determinant into some thirty products. The geometry is simpler. Only rotors 2 and 4 produce roll
torque and only rotors 1 and 3 pitch torque, so the rotor inputs with zero total torque follow pair
by pair; their force has the direction ``n(alpha)``, and

    ``det [tau; r3^T F] = 2 L^2 K_f^3 K_m (n . r3)``,  ``n = (-R_theta, R_phi, R)``.

The matrix is singular exactly where world up is perpendicular to ``n``. Tilt angles have the shape
(4, ...), in rad; ``r = K_m / (L K_f)`` is the drag ratio. Torques are in units of ``L K_f``, forces
in units of ``K_f``; rotor inputs are ``w_i = varpi_i |varpi_i|`` (rad^2/s^2).
"""

from typing import Any, Final

import numpy as np

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle

ARMS: Final = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))
"""Directions of the arms of rotors 1 to 4 on a cross; pods of the tiltrotor turn about them."""


def cross_table(vehicle: Vehicle, *, tilting: bool) -> Values:
    """The table of four rotors (`tiltsim_controllers.vehicle.rotors`), tilted about arms or fixed.

    In closed form, so that parameters of the vehicle may be numbers of any kind.
    """
    drag, table = vehicle.drag_coefficient, []
    for rotor, (x, y, _) in enumerate(ARMS):
        spin = SPIN[rotor]
        push = spin * vehicle.thrust_coefficient
        lever = vehicle.arm_length * push
        upright = (0.0, 0.0, push, lever * y, -lever * x, -drag)
        aside = (push * y, -push * x, 0.0, -drag * y, drag * x, -lever)  # tilted by 90 degrees
        nothing = (0.0,) * 6
        parts = (nothing, upright, aside) if tilting else (upright, nothing, nothing)
        table += [float(rotor) if tilting else -1.0, spin, *parts[0], *parts[1], *parts[2]]
    return tuple(table)


def cross_torque(tilts: Any, r: Any) -> Any:
    """``tau(alpha) / (L K_f)``, shape (3, 4, ...) (ch. 3, Eq. 5)."""
    (s1, s2, s3, s4), (c1, c2, c3, c4) = xp.sin(tilts), xp.cos(tilts)
    o = 0.0 * tilts[0] + 0.0  # never negative
    return xp.array(
        [
            [o, c2 - r * s2, o, -c4 + r * s4],
            [c1 + r * s1, o, -c3 - r * s3, o],
            [s1 - r * c1, -s2 - r * c2, s3 - r * c3, -s4 - r * c4],
        ]
    )


def cross_force(tilts: Any) -> Any:
    """``F(alpha) / K_f``, shape (3, 4, ...) (ch. 3, Eq. 3)."""
    (s1, s2, s3, s4), (c1, c2, c3, c4) = xp.sin(tilts), xp.cos(tilts)
    o = 0.0 * tilts[0] + 0.0  # never negative
    return xp.array([[o, s2, o, -s4], [s1, o, -s3, o], [-c1, c2, -c3, c4]])


def torque_free_inputs(torque: Any) -> Any:
    """The rotor inputs that span ``ker tau`` of `cross_torque`, shape (4, ...).

    Rotors 2 and 4 share a factor that cancels their roll torque, rotors 1 and 3 one that cancels
    their pitch torque; the ratio of the two factors cancels the yaw torque. They may vanish below
    rank 3.
    """
    (_, x2, _, x4), (y1, _, y3, _), (z1, z2, z3, z4) = torque
    yaw_of_13, yaw_of_24 = z3 * y1 - z1 * y3, z4 * x2 - z2 * x4
    return xp.array([-y3 * yaw_of_24, x4 * yaw_of_13, y1 * yaw_of_24, -x2 * yaw_of_13])


def torque_free_force(tilts: Any, r: Any) -> Any:
    """The force at zero torque, ``n = (-R_theta, R_phi, R)``, body axes, shape (3, ...).

    Normalized as in ch. 3: ``R = 4`` for an untilted vehicle. Where ``n = 0`` the decoupling matrix
    is singular at every attitude: where ``tau`` is rank-deficient, and also where the torque-free
    forces of the two pairs cancel, as for red gaits on the curve L of the Two Color Map.
    """
    inputs = torque_free_inputs(cross_torque(tilts, r))
    return (cross_force(tilts) * inputs).sum(axis=1) * (0.5 / r)


MIXER: Final = np.array(
    [[1.0, 1.0, 1.0, 1.0], [0.0, 1.0, 0.0, -1.0], [-1.0, 0.0, 1.0, 0.0], [1.0, -1.0, 1.0, -1.0]]
)
"""Thrust and roll, pitch and yaw torque of the untilted rotors (ch. 3, Eqs. 3 and 5).

Per ``c_i = s_i varpi_i |varpi_i|``, positive for upward thrust, in the units of `thrust_controls`.
"""


@traceable
def thrust_controls(wrench: Any, vehicle: Vehicle) -> Any:
    """The ``c_i`` (rad^2/s^2), shape (4,), that produce a thrust (N) and torques (N m), body axes.

    The rotors make ``K_f, L K_f, L K_f, K_m`` of these per unit.
    """
    lever = vehicle.arm_length * vehicle.thrust_coefficient
    units = xp.array([vehicle.thrust_coefficient, lever, lever, vehicle.drag_coefficient])
    squares = (MIXER * MIXER).sum(axis=1)  # its rows are orthogonal
    return MIXER.T @ (wrench / (squares * units))


@traceable
def speed_along_spin(thrust_control: Any) -> Any:
    """The rotor speed (rad/s) of a ``c_i`` (rad^2/s^2), negative against the nominal spin."""
    return xp.copysign(xp.sqrt(abs(thrust_control)), thrust_control)
