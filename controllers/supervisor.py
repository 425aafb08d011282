"""A supervisor that keeps a planned gait away from singular decoupling matrices.

The matrix is singular where ``n(alpha) . r3 = 0`` (`controllers.decoupling_matrix`). At a given
attitude there is always a way out: all tilt angles scaled towards zero, where ``n`` is vertical.
The supervisor lets as much of the gait pass as keeps two numbers above their thresholds: the
singularity margin (rad, how far the attitude is from a singular one) and the determinant ``n .
r3`` itself (4 for a level untilted vehicle), which alone sees a gait come to the curve L of the Two
Color Map, where ``n`` vanishes whatever its direction.

It is a pure function of the planned angles and the attitude, so that a saved state restarts and
the same source runs in every engine.
"""

from __future__ import annotations

from math import asin, sqrt
from typing import Final, NamedTuple

from controllers.decoupling_matrix import sines_and_cosines, torque_entries, torque_free_force
from controllers.gaits.trot import TiltsAndRates
from controllers.rotation import world_up_in_body
from controllers.scalar import Quad, Triple, scalar

STEPS: Final = 16
"""Scales that are looked at, from nothing of the gait to all of it."""

HALVINGS: Final = 20
"""How often the last step is halved: the scale is exact to 1e-7."""


class Supervisor(NamedTuple):
    """What the supervisor keeps; both 0 to leave it out."""

    min_margin: float = 0.0  # rad, below a right angle
    min_determinant: float = 0.0  # 4 for a level untilted vehicle


@scalar
def is_allowed(
    scale: float, tilts: Quad, up: Triple, supervisor: Supervisor, drag_ratio: float
) -> bool:
    """Whether the tilts times ``scale`` are regular enough; ``up`` is `world_up_in_body`."""
    trig = sines_and_cosines(scale * tilts[0], scale * tilts[1], scale * tilts[2], scale * tilts[3])
    nx, ny, nz = torque_free_force(trig, torque_entries(trig, drag_ratio), drag_ratio)
    along = nx * up[0] + ny * up[1] + nz * up[2]
    length = sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0 or along < supervisor.min_determinant:
        return False
    return asin(min(1.0, max(-1.0, along / length))) >= supervisor.min_margin


@scalar
def allowed_scale(
    tilts: Quad, roll: float, pitch: float, supervisor: Supervisor, drag_ratio: float
) -> float:
    """The largest scale up to which the gait is allowed all the way from zero.

    Where not even the untilted vehicle meets the thresholds, as it leans too far, 0: the best that
    a gait can do.
    """
    up = world_up_in_body(roll, pitch)
    low, high = 0.0, 1.0
    for step in range(STEPS + 1):
        high = step / STEPS
        if not is_allowed(high, tilts, up, supervisor, drag_ratio):
            break
        low = high
    if low == high or high == 0.0:
        return low
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if is_allowed(middle, tilts, up, supervisor, drag_ratio):
            low = middle
        else:
            high = middle
    return low


@scalar
def gait_share(
    planned: TiltsAndRates, roll: float, pitch: float, supervisor: Supervisor, drag_ratio: float
) -> float:
    """How much of a planned gait passes at an attitude: 1 where no supervisor is at work."""
    if supervisor.min_margin <= 0.0 and supervisor.min_determinant <= 0.0:
        return 1.0
    tilts = planned[0], planned[1], planned[2], planned[3]
    return allowed_scale(tilts, roll, pitch, supervisor, drag_ratio)
