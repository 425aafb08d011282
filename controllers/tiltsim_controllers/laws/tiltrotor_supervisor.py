"""The supervisor of the tiltrotor: its margin and determinant, and its way to red gaits.

The decoupling matrix is singular where ``n(alpha) . r3 = 0`` (`vehicle.decoupling_matrix`); its
determinant is ``n . r3``, 4 for a level untilted vehicle. Only the determinant shows that a gait
approaches the curve L of the Two Color Map, where ``n`` vanishes whatever its direction. At zero
tilts and on red ``n`` is vertical.
"""

from __future__ import annotations

from typing import Any, Final

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.gaits.red_gait import nearest_red_angles
from tiltsim_controllers.laws.supervisor import Supervision, Supervisor, WayBack
from tiltsim_controllers.mathematics.linear import norm
from tiltsim_controllers.mathematics.moving import Moving
from tiltsim_controllers.vehicle.decoupling_matrix import torque_entries, torque_free_force
from tiltsim_controllers.vehicle.parameters import drag_ratio

NEAR: Final = 0.05
"""rad: the distance from red, for the speed of the return, is at least this."""


@traceable
def assess(tilts: Any, up: Any, drag_ratio: Any, knots: Any = NO_KNOTS) -> tuple[Any, Any, Any]:
    """Singularity margin (rad), determinant and ``n``, along which the vehicle hovers.

    Args:
        tilts: rad, shape (4,).
        up: World up in body axes, shape (3,).
        drag_ratio: ``r = K_m / (L K_f)``.
        knots: Not used here.
    """
    trig = tuple(xp.array([xp.sin(tilts), xp.cos(tilts)]).T.ravel())
    n = xp.array([*torque_free_force(trig, torque_entries(trig, drag_ratio), drag_ratio)])
    along, length = n @ up, norm(n)
    exists = length != 0.0
    sine = xp.where(exists, along / xp.where(exists, length, 1.0), 0.0)
    margin = xp.arcsin(xp.minimum(1.0, xp.maximum(-1.0, sine)))
    return margin, xp.where(exists, along, 0.0), xp.where(exists, n, up)


def _towards_red(planned: Any, motion: Any, supervisor: Supervisor, drag_ratio: Any) -> Any:
    """Tilts moved by a fraction of the path to red, shape (4, 3)."""
    red = nearest_red_angles(planned, drag_ratio, supervisor.clearance)
    way = Moving(*motion) * Moving(*(xp.vstack([red, red]) - planned).T)
    return planned + xp.stack([way.value, way.rate, way.acceleration], 1)


def _return_speed(planned: Any, supervisor: Supervisor, drag_ratio: Any) -> Any:
    """Rate (1/s) along the path to red at which the fastest tilt has its maximum rate."""
    red = nearest_red_angles(planned, drag_ratio, supervisor.clearance)[:, 0]
    longest = NEAR
    for way in abs(xp.hstack([red, red]) - planned[:, 0]):
        longest = xp.maximum(longest, way)
    return supervisor.max_rate / longest


SUPERVISION: Final = Supervision(
    4,
    lambda _time, parameters: drag_ratio(parameters.vehicle),
    assess,
    WayBack(_towards_red, _return_speed),
)
"""Its functions; the ``vehicle`` is the drag ratio ``r = K_m / (L K_f)``."""
