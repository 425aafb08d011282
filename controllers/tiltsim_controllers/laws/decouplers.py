"""Attitude-position decouplers: roll and pitch that produce a desired acceleration.

Attitude and altitude use all four rotor speeds, so the horizontal position is controlled by leaning
the vehicle. The decouplers differ in their model of the tilted rotors: the conventional one ignores
them (ch. 4, Eqs. 7-8), the modified one has the side force at level attitude, to first order
(Eqs. 9-11), the exact one the whole direction of the force at zero torque.
"""

from __future__ import annotations

from math import acos, atan2, cos, nan, sin, sqrt
from typing import Final

from tiltsim_controllers.mathematics.scalar import Triple, scalar

NONE: Final = 0.0
CONVENTIONAL: Final = 1.0
MODIFIED: Final = 2.0
EXACT: Final = 3.0

DECOUPLERS: Final = {
    "none": NONE,
    "conventional": CONVENTIONAL,
    "modified": MODIFIED,
    "exact": EXACT,
}
"""Decouplers by their name in a scenario."""


@scalar
def conventional_decoupler(ax: float, ay: float, yaw: float, gravity: float) -> tuple[float, float]:
    """Roll and pitch (rad) of a plain quadrotor near hover (ch. 4, Eqs. 7-8).

    Args:
        ax, ay: desired acceleration, m/s^2, world
        yaw: rad
        gravity: m/s^2
    """
    sin_yaw, cos_yaw = sin(yaw), cos(yaw)
    return (ax * sin_yaw - ay * cos_yaw) / gravity, (ax * cos_yaw + ay * sin_yaw) / gravity


@scalar
def modified_decoupler(
    ax: float, ay: float, yaw: float, gravity: float, n: Triple
) -> tuple[float, float]:
    """Conventional roll and pitch plus the side force at level hover (ch. 4, Eqs. 9-11).

    Eq. 11 determines the rotor inputs with zero torque whose vertical force is the weight at level
    attitude. Their force is parallel to ``n``, so ``F_X = m g n_x / n_z`` and ``F_Y = m g n_y /
    n_z``: the printed 4 x 4 inverse in closed form. NaN where no such inputs exist.

    Args:
        ax, ay, yaw, gravity: as for `conventional_decoupler`
        n: the torque-free force, of arbitrary unit, body axes
    """
    nx, ny, nz = n
    if nz == 0.0:
        return nan, nan
    roll, pitch = conventional_decoupler(ax, ay, yaw, gravity)
    return roll + ny / nz, pitch - nx / nz


@scalar
def exact_decoupler(
    ax: float, ay: float, az: float, yaw: float, gravity: float, n: Triple
) -> tuple[float, float]:
    """The roll and pitch (rad) that point the torque-free force along the desired one.

    Solves ``Ry(pitch) Rx(roll) n = d |n|`` with ``d`` the unit vector along ``Rz(-yaw) (ax, ay,
    g + az)``, on the branch that is level when ``n`` and ``d`` are vertical. Where no roll reaches
    ``d`` the nearest one is returned; NaN where the torque-free force has neither a lateral nor a
    vertical part, and in free fall, ``d = 0``.

    Args:
        ax, ay, az: desired acceleration, m/s^2, world
        yaw, gravity, n: as for `modified_decoupler`
    """
    sin_yaw, cos_yaw = sin(yaw), cos(yaw)
    dx = ax * cos_yaw + ay * sin_yaw
    dy = ay * cos_yaw - ax * sin_yaw
    dz = gravity + az
    # The rotors can push along n or against it; the side that points up is used.
    side = 1.0 if n[2] >= 0.0 else -1.0
    nx, ny, nz = side * n[0], side * n[1], side * n[2]
    lateral = sqrt(ny * ny + nz * nz)
    desired = dx * dx + dy * dy + dz * dz
    if lateral == 0.0 or desired == 0.0:
        return nan, nan
    scale = sqrt((nx * nx + ny * ny + nz * nz) / desired)
    roll = acos(min(1.0, max(-1.0, dy * scale / lateral))) - atan2(nz, ny)
    pitch = atan2(dx, dz) - atan2(nx, ny * sin(roll) + nz * cos(roll))
    return roll, pitch
