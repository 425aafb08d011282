"""The Two Color Map in closed form, for any vehicle (ch. 6 to 8, 12).

According to ch. 6 a gait is robust where ``R_phi = R_theta = 0`` and ``R != 0``: small roll and
pitch then do not change the determinant. The thesis solves the first two equations numerically for
each vehicle. Written with the columns of ``tau``, they factor. Let ``r = K_m / (L K_f)``, ``delta =
atan(r)`` and ``k = (r + 1/r) / 2``; then

    ``R_theta = k sin(alpha_1 + alpha_3 - 2 delta) sin(alpha_2 - alpha_4)``,
    ``R_phi = k sin(alpha_2 + alpha_4 + 2 delta) sin(alpha_3 - alpha_1)``,

so the only roots are two families of lines (where they intersect, one angle is free):

* red: ``alpha_3 = alpha_1``, ``alpha_4 = alpha_2``;
* blue: ``alpha_3 = 2 delta - alpha_1``, ``alpha_4 = -2 delta - alpha_2``;

each angle up to a multiple of pi. They meet at ``P = (delta, -delta)``.

**Red.** ``n`` is vertical and the margin pi/2, except where ``R`` also vanishes:

    ``R = (2/r) (2 r - tan alpha_1 + tan alpha_2) (1 + r tan alpha_1) (1 - r tan alpha_2)
    cos^2 alpha_1 cos^2 alpha_2``.

The first bracket is the curve L of ch. 8: ``tan alpha_2 = tan alpha_1 - 2 r``. P lies exactly on
it; ch. 8 and 12 place it slightly below because of rounding. The other two vanish only at
``alpha_1 = delta - pi/2`` and ``alpha_2 = pi/2 - delta``.

**Blue is singular everywhere.** Up to the factor ``hypot(L K_f, K_m)`` the columns of ``tau`` are

    ``(0, cos(alpha_1 - delta), sin(alpha_1 - delta))``,
    ``(cos(alpha_2 + delta), 0, -sin(alpha_2 + delta))``,
    ``(0, -cos(alpha_3 - delta), sin(alpha_3 - delta))``,
    ``(-cos(alpha_4 + delta), 0, -sin(alpha_4 + delta))``.

On blue ``alpha_3 - delta = -(alpha_1 - delta)`` and ``alpha_4 + delta = -(alpha_2 + delta)``, so
the third column is minus the first and the fourth minus the second: ``tau`` has rank 2 at most, at
every attitude. ``R``, ``R_phi`` and ``R_theta`` vanish together. The thesis's results for blue are
due to the rounding of its coefficients; the margin of a blue gait is zero.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import product
from math import acos, atan, atan2, cos, hypot, pi, sin
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tiltsim_controllers.analysis.singularity import residuals
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import Vehicle, drag_ratio

Region = Literal["S_U", "S_D", "L"]

GRID_SIZE: Final = 17
"""Grid points along each axis of ch. 6's search, pi/16 apart."""

_END_TOLERANCE: Final = 1e-9


def delta(vehicle: Vehicle) -> float:
    """``atan(K_m / (L K_f))``, rad."""
    return atan(drag_ratio(vehicle))


def point_p(vehicle: Vehicle) -> tuple[float, float]:
    """P, the only point (rad) of the alpha_1-alpha_2 plane on both colors (ch. 8, Sec. 3.4)."""
    angle = delta(vehicle)
    return angle, -angle


def red_residual(alpha_1: ArrayLike, alpha_2: ArrayLike, vehicle: Vehicle) -> Floats:
    """``R`` on red (ch. 8, Eq. 7) in factored form; angles in rad broadcast."""
    ratio, angle = drag_ratio(vehicle), delta(vehicle)
    alpha_1, alpha_2 = np.asarray(alpha_1, float), np.asarray(alpha_2, float)
    beside_l = 2.0 * ratio * np.cos(alpha_1) * np.cos(alpha_2) - np.sin(alpha_1 - alpha_2)
    sides = np.cos(alpha_1 - angle) * np.cos(alpha_2 + angle) / np.cos(angle) ** 2
    return np.asarray(2.0 / ratio * beside_l * sides)


def curve_l(alpha_1: ArrayLike, vehicle: Vehicle) -> Floats:
    """The curve L (ch. 8, Eq. 6): ``alpha_2 = atan(tan alpha_1 - 2 r)``, rad, up to pi/2."""
    return np.asarray(np.arctan(np.tan(np.asarray(alpha_1, float)) - 2.0 * drag_ratio(vehicle)))


def region(alpha_1: float, alpha_2: float, vehicle: Vehicle) -> Region:
    """The region of red angles (rad): S_U (R > 0), S_D (R < 0) or L (ch. 8, Eqs. 6-9)."""
    value = float(red_residual(alpha_1, alpha_2, vehicle))
    if abs(value) < 1e-12 / drag_ratio(vehicle):
        return "L"
    return "S_U" if value > 0.0 else "S_D"


@dataclass(frozen=True)
class Root:
    """A solution of ``R_phi = R_theta = 0`` for given ``alpha_1`` and ``alpha_2``; rad."""

    alpha_1: float
    alpha_2: float
    alpha_3: float
    alpha_4: float
    R: float
    plane_3: Literal["+", "-", "?"]  # alpha_3 grows with alpha_1, falls with it, or where both meet
    plane_4: Literal["+", "-", "?"]


def find_roots(
    alpha_1: float, alpha_2: float, vehicle: Vehicle, same_plane: float = _END_TOLERANCE
) -> list[Root]:
    """All ``(alpha_3, alpha_4)`` in [-pi/2, pi/2] with ``R_phi = R_theta = 0`` (ch. 6, Eqs. 7-8).

    A search independent of the closed form above, to check it: both residuals are bilinear in
    ``(cos, sin)`` of ``alpha_3`` and of ``alpha_4``, so eliminating ``alpha_4`` leaves one
    quadratic, and no root is missed.

    Args:
        alpha_1, alpha_2: rad
        vehicle: the tiltrotor
        same_plane: distance below which planes intersect, rad; for "?" of ch. 6 half a grid step,
            pi/32, as no grid point lies exactly on an intersection

    Raises:
        ValueError: If the roots are not isolated: on ``alpha_1 = delta`` or ``alpha_2 = -delta``
            every value of one angle is a root.
    """
    corner = np.array([[[alpha_1, alpha_2, a, b] for b in (0.0, pi / 2)] for a in (0.0, pi / 2)])
    _, roll_form, pitch_form = residuals(corner, vehicle)
    scale = max(np.abs(roll_form).max(), np.abs(pitch_form).max())
    # (c a0 + s a1) x (c b0 + s b1) = 0 for c, s = cos, sin alpha_3, with rows a of the roll form.
    square_c = _cross(roll_form[0], pitch_form[0])
    mixed = _cross(roll_form[0], pitch_form[1]) + _cross(roll_form[1], pitch_form[0])
    square_s = _cross(roll_form[1], pitch_form[1])
    mean, wave = 0.5 * (square_c + square_s), hypot(0.5 * (square_c - square_s), 0.5 * mixed)
    middle = atan2(0.5 * mixed, 0.5 * (square_c - square_s))
    spread = acos(min(1.0, max(-1.0, -mean / wave))) if wave else 0.0
    offset, roots, isolated = 2.0 * delta(vehicle), [], wave >= _END_TOLERANCE * scale**2
    for double_angle in (middle + spread, middle - spread):
        third = 0.5 * double_angle
        direction = np.array([cos(third), sin(third)])
        lines = [direction @ roll_form, direction @ pitch_form]
        line = max(lines, key=lambda pair: float(np.abs(pair).max()))
        if not isolated or np.abs(line).max() < _END_TOLERANCE * scale:
            raise ValueError(
                f"(alpha_1, alpha_2) = ({alpha_1:g}, {alpha_2:g}): on alpha_1 = delta or alpha_2 ="
                " -delta the roots are not isolated"
            )
        for a, b in product(_ends(third), _ends(atan2(-line[0], line[1]))):
            planes = (
                _plane(a, alpha_1, offset - alpha_1, same_plane),
                _plane(b, alpha_2, -offset - alpha_2, same_plane),
            )
            angles = alpha_1, alpha_2, a, b
            roots.append(Root(*angles, float(residuals(angles, vehicle).R), *planes))
    return sorted(roots, key=lambda root: (root.alpha_3, root.alpha_4))


def grid_axis() -> Floats:
    """Grid of ch. 6 along one axis, from -pi/2 to pi/2 (rad)."""
    return np.linspace(-pi / 2, pi / 2, GRID_SIZE)


def grid_roots(vehicle: Vehicle) -> list[list[list[Root]]]:
    """The roots at every grid point ``[i][j]`` of ``(alpha_1, alpha_2)`` (ch. 6, Fig. 4).

    Planes closer than half a grid step count as intersecting ("?").
    """
    axis = grid_axis().tolist()
    half_step = 0.5 * pi / (GRID_SIZE - 1)
    return [[find_roots(a, b, vehicle, half_step) for b in axis] for a in axis]


def root_counts(roots: list[list[list[Root]]]) -> NDArray[np.int_]:
    """Number of roots at every grid point; ch. 6 finds 2 inside, 3 on sides, 5 in corners."""
    return np.array([[len(cell) for cell in row] for row in roots])


def root_classes(roots: list[list[list[Root]]]) -> Counter[str]:
    """How many roots inside the grid belong to each class ``(+,+)``, ``(-,-)``, ``(+,?)``, ..."""
    inside = [cell for row in roots[1:-1] for cell in row[1:-1]]
    return Counter(f"({root.plane_3},{root.plane_4})" for cell in inside for root in cell)


def _plane(angle: float, growing: float, falling: float, same: float) -> Literal["+", "-", "?"]:
    if _distance(growing, falling) < same:
        return "?"
    return "+" if _distance(angle, growing) <= _distance(angle, falling) else "-"


def _distance(angle: float, other: float) -> float:
    """Distance (rad) of two directions modulo half a revolution."""
    return abs((angle - other + pi / 2) % pi - pi / 2)


def _ends(angle: float) -> list[float]:
    """The values of ``angle`` modulo pi in [-pi/2, pi/2]: both ends if it is one of them."""
    wrapped = (angle + pi / 2) % pi - pi / 2
    if pi / 2 - abs(wrapped) < _END_TOLERANCE:
        return [-pi / 2, pi / 2]
    return [wrapped]


def _cross(first: Floats, second: Floats) -> float:
    return float(first[0] * second[1] - first[1] * second[0])
