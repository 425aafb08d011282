"""Where the quadrotor's yaw-position decoupling matrix is singular: claimed and exact (ch. 2).

Ch. 2 derives a "determinant surface" ``S(theta, phi)`` that vanishes on a closed curve through
level attitude. It results from one wrong entry: the first of the third row of Eq. (43) is printed
as 0, but the printed factors make it ``cos(theta)^2 (sin(phi) - cos(phi))``, and with it the
product has the determinant -1 at every attitude. The determinant of ``Delta`` itself is

    ``det Delta = -d^3 zeta^2 cos(phi) / (I_x I_y I_z m^3 cos(theta))``,

which is never zero for ``zeta != 0`` and roll and pitch inside of 90 degrees. Eqs. (31) and (36)
also have an error (``s_theta s_phi`` for ``s_theta c_phi``), which adds multiples of the matrix's
last row to its first two and so does not change the determinant. Both the published and the exact
form are available.

Attitudes are roll ``phi`` and pitch ``theta`` in rad. Each expression is even in pitch, so it holds
in the axes of ch. 2 (z down) and in ours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import Vehicle


def published_determinant(roll: ArrayLike, pitch: ArrayLike) -> Floats:
    """The surface ``S(theta, phi)`` as published (ch. 2, Eqs. 44-46), dimensionless.

    Args:
        roll, pitch: Attitudes in rad, of any shapes that broadcast.
    """
    roll, pitch = np.asarray(roll, dtype=float), np.asarray(pitch, dtype=float)
    surface = np.cos(pitch) ** 2 * np.cos(roll) * (np.cos(roll) - np.sin(roll)) - 1.0
    return np.asarray(surface)


def published_singular_curve() -> tuple[Floats, Floats]:
    """The closed curve ``S = 0`` of ch. 2, Fig. 3: roll and pitch in rad.

    ``cos(theta)^2 = 1 / (cos(phi) (cos(phi) - sin(phi)))`` has a solution only for
    ``-pi/4 <= phi <= 0``. The curve passes through level attitude and ``(-pi/4, 0)``.
    Pitch is positive on the first half of the points, negative on the second.
    """
    # Evenly spaced in the angle about the curve's center: pitch grows like the square root of the
    # distance from either end.
    roll = -np.pi / 8.0 * (1.0 - np.cos(np.linspace(0.0, np.pi, 181)))
    cosine = 1.0 / np.sqrt(np.cos(roll) * (np.cos(roll) - np.sin(roll)))
    pitch = np.arccos(np.minimum(cosine, 1.0))
    return np.concatenate([roll, roll[::-1]]), np.concatenate([pitch, -pitch[::-1]])


def exact_determinant(
    roll: ArrayLike, pitch: ArrayLike, thrust: ArrayLike, vehicle: Vehicle
) -> Floats:
    """The determinant of ``Delta``, Eq. (42) without its errors, in SI units.

    Args:
        roll, pitch: Attitudes in rad.
        thrust: Total thrust ``zeta`` in N.
        vehicle: the quadrotor; ``d`` is its arm length
    """
    roll, pitch = np.asarray(roll, dtype=float), np.asarray(pitch, dtype=float)
    inertia = vehicle.inertia_xx * vehicle.inertia_yy * vehicle.inertia_zz
    scale = vehicle.arm_length**3 / (inertia * vehicle.mass**3)
    return np.asarray(-scale * np.square(thrust) * np.cos(roll) / np.cos(pitch))


def normalized_determinant(
    roll: ArrayLike, pitch: ArrayLike, thrust: ArrayLike, vehicle: Vehicle
) -> Floats:
    """`exact_determinant` over its value in level hover: 1 there, 0 where singular.

    Args:
        roll, pitch: Attitudes in rad.
        thrust: Total thrust ``zeta`` in N.
        vehicle: the quadrotor
    """
    hover = vehicle.mass * vehicle.gravity
    level = exact_determinant(0.0, 0.0, hover, vehicle)
    return np.asarray(exact_determinant(roll, pitch, thrust, vehicle) / level)
