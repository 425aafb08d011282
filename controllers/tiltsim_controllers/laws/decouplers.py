"""Attitude-position decouplers: which roll and pitch make a wanted acceleration.

Attitude and altitude take all four rotor speeds, so the horizontal position is steered by leaning
the vehicle. The decouplers differ in what they know of the tilted rotors: the conventional one
nothing (ch. 4, Eqs. 7-8), the modified one the side force at level attitude, to first order
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
"""Decouplers by the name a scenario gives them."""


@scalar
def conventional_decoupler(ax: float, ay: float, yaw: float, gravity: float) -> tuple[float, float]:
    """Roll and pitch (rad) of a plain quadrotor near hover (ch. 4, Eqs. 7-8)."""
    sin_yaw, cos_yaw = sin(yaw), cos(yaw)
    return (ax * sin_yaw - ay * cos_yaw) / gravity, (ax * cos_yaw + ay * sin_yaw) / gravity


@scalar
def modified_decoupler(
    ax: float, ay: float, yaw: float, gravity: float, n: Triple
) -> tuple[float, float]:
    """Conventional roll and pitch plus the side force at level hover (ch. 4, Eqs. 9-11).

    Eq. 11 asks for the rotor inputs without torque whose vertical force is the weight, level.
    Their force is parallel to ``n``, so ``F_X = m g n_x / n_z`` and ``F_Y = m g n_y / n_z``: the
    printed 4 x 4 inverse in closed form. NaN where no such inputs exist.
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
    """The roll and pitch (rad) that point the torque-free force along the wanted one.

    Solves ``Ry(pitch) Rx(roll) n = d |n|`` with ``d`` the unit vector along ``Rz(-yaw) (ax, ay,
    g + az)``, on the branch that is level when ``n`` and ``d`` are vertical. Where no roll reaches
    ``d`` (a gait with a large side force asked for more along it) the nearest one is returned; NaN
    where the torque-free force has neither a side nor a vertical part, and in free fall, ``d = 0``.
    """
    sin_yaw, cos_yaw = sin(yaw), cos(yaw)
    dx = ax * cos_yaw + ay * sin_yaw
    dy = ay * cos_yaw - ax * sin_yaw
    dz = gravity + az
    # The rotors push along n or against it; the vehicle flies with whichever side points up.
    side = 1.0 if n[2] >= 0.0 else -1.0
    nx, ny, nz = side * n[0], side * n[1], side * n[2]
    lateral = sqrt(ny * ny + nz * nz)
    wanted = dx * dx + dy * dy + dz * dz
    if lateral == 0.0 or wanted == 0.0:
        return nan, nan
    scale = sqrt((nx * nx + ny * ny + nz * nz) / wanted)
    roll = acos(min(1.0, max(-1.0, dy * scale / lateral))) - atan2(nz, ny)
    pitch = atan2(dx, dz) - atan2(nx, ny * sin(roll) + nz * cos(roll))
    return roll, pitch
