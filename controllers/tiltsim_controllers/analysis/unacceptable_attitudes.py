"""Unacceptable attitudes of a gait: the singular curve in the roll-pitch diagram (ch. 5 to 8).

The thesis traces the curve by root finding. At singular attitudes world up, in body axes, is
perpendicular to the torque-free force ``n``: a great circle, known in closed form. Angles are in
rad; ``angles`` are the four tilt angles of one gait at one instant.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import atan, atan2, cos, inf, pi
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.analysis.singularity import residuals, torque_free_direction
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import Vehicle

CurveKind = Literal["graph", "vertical", "none", "everywhere"]


@dataclass(frozen=True)
class AttitudeCurve:
    """The singular attitudes of one gait with ``|roll| < pi/2``.

    ``kind`` is their shape: ``graph`` (one pitch for each roll), ``vertical`` (one roll, any
    pitch; ``R_theta = 0``), ``none`` (only at ``|roll| = pi/2``; ``R_phi = R_theta = 0``) or
    ``everywhere`` (``n = 0``). ``roll`` and ``pitch`` are samples, shape (N,), empty for the last
    two kinds.
    """

    kind: CurveKind
    roll: Floats
    pitch: Floats


def unacceptable_attitudes(
    angles: ArrayLike, vehicle: Vehicle, samples: int = 181
) -> AttitudeCurve:
    """The unacceptable-attitude curve of a gait, in ``samples`` points.

    Sampled evenly along the great circle, not in roll, so that steep and vertical curves are also
    resolved.
    """
    empty = np.empty(0)
    direction = torque_free_direction(angles, vehicle)
    if np.isnan(direction).any():
        return AttitudeCurve("everywhere", empty, empty)
    nx, ny, nz = (float(value) for value in direction)
    lean = float(np.hypot(nx, ny))
    if lean <= np.finfo(float).eps:
        return AttitudeCurve("none", empty, empty)
    # Two unit vectors that span the plane across n: one level, one pointing up.
    level = np.array([-ny, nx, 0.0]) / lean
    upward = np.array([-nx * nz, -ny * nz, lean * lean]) / lean
    turn = np.linspace(0.0, pi, samples + 2)[1:-1, np.newaxis]
    ux, uy, uz = (np.cos(turn) * level + np.sin(turn) * upward).T
    kind: CurveKind = "vertical" if nx == 0.0 else "graph"
    return AttitudeCurve(kind, np.arctan2(uy, uz), np.arctan2(-ux, np.hypot(uy, uz)))


def acceptable_share(angles: ArrayLike, vehicle: Vehicle, half_width: float = pi / 2) -> float:
    """Fraction of the square ``|roll|, |pitch| < half_width`` (rad) reachable from level attitude.

    That is the part where the determinant has the same sign as at level attitude; it is connected,
    as the curve crosses each line of constant roll at most once. Zero if level is singular.

    Raises:
        ValueError: If ``half_width`` is not in (0, pi/2].
    """
    if not 0.0 < half_width <= pi / 2:
        raise ValueError(f"half_width = {half_width}: must be in (0, pi/2]")
    if np.isnan(torque_free_direction(angles, vehicle)).any():
        return 0.0
    R, R_phi, R_theta = (float(value) for value in residuals(angles, vehicle))
    if R == 0.0:
        return 0.0
    if R < 0.0:
        R, R_phi, R_theta = -R, -R_phi, -R_theta
    amplitude, centre = float(np.hypot(R, R_phi)), atan2(R_phi, R)

    def reachable(roll: float) -> float:
        """Length of the acceptable interval of pitch: tan(pitch) R_theta > -lift."""
        lift = amplitude * cos(roll - centre)
        steepness = lift / abs(R_theta) if R_theta else (inf if lift > 0.0 else -inf)
        return half_width + min(half_width, max(-half_width, atan(steepness)))

    from scipy.integrate import quad  # takes a third of a second to import

    # The integrand has corners where the curve leaves the square or crosses level pitch.
    bends = {-half_width, half_width}
    for level in (0.0, abs(R_theta) * np.tan(half_width), -abs(R_theta) * np.tan(half_width)):
        if abs(level) <= amplitude:
            offset = float(np.arccos(level / amplitude))
            bends |= {centre + offset, centre - offset}
    inside = sorted(bend for bend in bends if -half_width <= bend <= half_width)
    area = sum(quad(reachable, lower, upper)[0] for lower, upper in pairwise(inside))
    return float(area) / (2.0 * half_width) ** 2
