"""The supervisor of the tiltrotor: its margin and determinant, and its way to red gaits.

The decoupling matrix is singular where ``n(alpha) . r3 = 0`` (`vehicle.decoupling_matrix`); its
determinant is ``n . r3``, 4 for a level untilted vehicle. Only the determinant shows that a gait
approaches the curve L of the Two Color Map, where ``n`` vanishes whatever its direction. At zero
tilts and on red ``n`` is vertical.
"""

from __future__ import annotations

from math import asin, sqrt
from typing import Final

from tiltsim_controllers.gaits.parameters import NO_KNOTS
from tiltsim_controllers.gaits.red_gait import nearest_red_angles
from tiltsim_controllers.laws.supervisor import Assessment, Supervisor, WayBack, supervision_of
from tiltsim_controllers.mathematics.jets import Jet, Jets4, jet_product, jet_sum
from tiltsim_controllers.mathematics.scalar import Quad, Triple, Vector, scalar
from tiltsim_controllers.vehicle.decoupling_matrix import (
    sines_and_cosines,
    torque_entries,
    torque_free_force,
)

NEAR: Final = 0.05
"""rad: the distance from red, for the speed of the return, is at least this."""


@scalar
def assess(tilts: Quad, up: Triple, drag_ratio: float, knots: Vector = NO_KNOTS) -> Assessment:
    """Singularity margin (rad), determinant and ``n``, along which the vehicle hovers.

    Args:
        tilts: rad
        up: `world_up_in_body`
        drag_ratio: ``r = K_m / (L K_f)``
        knots: without use here
    """
    trig = sines_and_cosines(tilts[0], tilts[1], tilts[2], tilts[3])
    nx, ny, nz = torque_free_force(trig, torque_entries(trig, drag_ratio), drag_ratio)
    along = nx * up[0] + ny * up[1] + nz * up[2]
    length = sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return 0.0, 0.0, up
    return asin(min(1.0, max(-1.0, along / length))), along, (nx, ny, nz)


@scalar
def _blend(tilt: Jet, red: Jet, share: Jet) -> Jet:
    """A tilt moved by a fraction of the path to red."""
    return jet_sum(1.0, tilt, 1.0, jet_product(share, jet_sum(1.0, red, -1.0, tilt)))


@scalar
def _towards_red(
    planned: Jets4, motion: Triple, supervisor: Supervisor, drag_ratio: float
) -> Jets4:
    a1, a2, a3, a4 = planned
    r1, r2 = nearest_red_angles(planned, drag_ratio, supervisor.clearance)
    m = motion
    return _blend(a1, r1, m), _blend(a2, r2, m), _blend(a3, r1, m), _blend(a4, r2, m)


@scalar
def _return_speed(planned: Jets4, supervisor: Supervisor, drag_ratio: float) -> float:
    """Rate (1/s) along the path to red at which the fastest tilt has its maximum rate."""
    a1, a2, a3, a4 = planned
    red_1, red_2 = nearest_red_angles(planned, drag_ratio, supervisor.clearance)
    front = max(abs(red_1[0] - a1[0]), abs(red_2[0] - a2[0]))
    rear = max(abs(red_1[0] - a3[0]), abs(red_2[0] - a4[0]))
    return supervisor.max_rate / max(front, rear, NEAR)


SUPERVISION: Final = supervision_of(4, assess, WayBack(_towards_red, _return_speed))
"""Its scalar code; the ``vehicle`` is the drag ratio ``r = K_m / (L K_f)``."""
