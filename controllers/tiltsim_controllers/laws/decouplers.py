"""Attitude-position decouplers: roll and pitch that produce a desired acceleration.

Attitude and altitude use all four rotor speeds, so the horizontal position is controlled by leaning
the vehicle. The decouplers differ in their model of the tilted rotors: the conventional one ignores
them (ch. 4, Eqs. 7-8), the modified one has the side force at level attitude, to first order
(Eqs. 9-11), the exact one the whole direction of the force at zero torque.
"""

from __future__ import annotations

from typing import Any, Final

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.moving import angle, cosine, sine, square_root, value_of, where

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


@traceable
def conventional_decoupler(ax: Any, ay: Any, yaw: Any, gravity: Any) -> tuple[Any, Any]:
    """Roll and pitch (rad) of a plain quadrotor near hover (ch. 4, Eqs. 7-8).

    Args:
        ax, ay: Desired acceleration, m/s^2, world axes.
        yaw: rad.
        gravity: m/s^2.
    """
    s, c = xp.sin(yaw), xp.cos(yaw)
    return (ax * s - ay * c) / gravity, (ax * c + ay * s) / gravity


@traceable
def modified_decoupler(ax: Any, ay: Any, yaw: Any, gravity: Any, n: Any) -> tuple[Any, Any]:
    """Conventional roll and pitch (rad) plus the side force at level hover (ch. 4, Eqs. 9-11).

    Eq. 11 determines the rotor inputs with zero torque whose vertical force is the weight at level
    attitude. Their force is parallel to ``n``, so ``F_X = m g n_x / n_z`` and ``F_Y = m g n_y /
    n_z``: the printed 4 x 4 inverse in closed form. NaN where no such inputs exist.

    Args:
        ax, ay, yaw, gravity: See `conventional_decoupler`.
        n: The torque-free force, of any unit, body axes, shape (3,).
    """
    roll, pitch = conventional_decoupler(ax, ay, yaw, gravity)
    lift = xp.where(n[2] == 0.0, xp.nan, n[2])
    return roll + n[1] / lift, pitch - n[0] / lift


@traceable
def exact_decoupler(ax: Any, ay: Any, az: Any, yaw: Any, gravity: Any, n: Any) -> tuple[Any, Any]:
    """The roll and pitch (rad) that point the torque-free force along the desired one.

    Solves ``Ry(pitch) Rx(roll) n = d |n|`` with ``d`` the unit vector along ``Rz(-yaw) (ax, ay,
    g + az)``, on the branch that is level when ``n`` and ``d`` are vertical. Where no roll reaches
    ``d`` the nearest one is returned, at rest; NaN where the torque-free force has neither a
    lateral nor a vertical part, and in free fall, ``d = 0``.

    All arguments but gravity may be `Moving`; roll and pitch are then as well.

    Args:
        ax, ay, az: Desired acceleration, m/s^2, world axes.
        yaw, gravity, n: See `modified_decoupler`.
    """
    s, c = sine(yaw), cosine(yaw)
    dx, dy, dz = ax * c + ay * s, ay * c - ax * s, gravity + az
    # The rotors can push along n or against it; the side that points up is used.
    n = n * xp.where(value_of(n[2]) >= 0.0, 1.0, -1.0)
    lateral, desired = n[1] * n[1] + n[2] * n[2], dx * dx + dy * dy + dz * dz
    none = (value_of(lateral) == 0.0) | (value_of(desired) == 0.0)
    lateral, desired = where(none, xp.nan, lateral), where(none, xp.nan, desired)
    # n_y cos(roll) - n_z sin(roll) = d_y |n| / |d|: the component along the pitch axis.
    reach = dy * square_root((lateral + n[0] * n[0]) / desired)
    rest, phase = lateral - reach * reach, angle(n[2], n[1])
    reaches = value_of(rest) > 0.0
    reached = angle(square_root(where(reaches, rest, 1.0)), reach) - phase
    nearest = xp.arctan2(0.0, value_of(reach)) - value_of(phase)
    roll = where(reaches, reached, nearest)
    pitch = angle(dx, dz) - angle(n[0], n[1] * sine(roll) + n[2] * cosine(roll))
    return roll, pitch
