"""The Two Color Map: its roots, its lines, and the planner's verdicts (ch. 6, 7, 8, 12)."""

from collections.abc import Callable
from functools import cache
from math import pi
from typing import Final

import numpy as np

from tiltsim.report.measures.determinant import terms_hold, value_of_terms
from tiltsim_controllers.analysis.singularity import residuals
from tiltsim_controllers.analysis.two_color_map import (
    Root,
    curve_l,
    delta,
    find_roots,
    grid_roots,
    point_p,
    red_residual,
    region,
    root_counts,
)
from tiltsim_controllers.analysis.two_color_planner import Circle, Leg, Path, Polyline
from tiltsim_controllers.gaits.colors import colored_angles
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio

_VEHICLE: Final = PRESETS["ar_drone_2"]
_ZERO: Final = 1e-9
_P: Final = point_p(_VEHICLE)
_TRIANGLE: Final = (_P, (0.7, -0.25), (0.25, -0.7), _P)


def gait_of_chapter_8(number: int) -> Path:
    """The gaits of ch. 8, Sec. 4."""
    gait_1 = Polyline((Leg("red", _TRIANGLE), Leg("blue", _TRIANGLE)))
    return (gait_1, Circle("red", (0.5, -0.5), 0.3), Circle("blue", (0.5, -0.5), 0.3))[number - 1]


@cache
def _grid() -> list[list[list[Root]]]:
    return grid_roots(_VEHICLE)


def _cells() -> list[list[Root]]:
    """The roots of each grid point inside."""
    return [cell for row in _grid()[1:-1] for cell in row[1:-1]]


def _inside() -> list[Root]:
    return [root for cell in _cells() for root in cell]


def classes(chosen: Callable[[Root], bool] = lambda root: True) -> set[str]:
    """The classes by planes, such as "(+,-)", of the roots inside, or of some of them."""
    return {f"({root.plane_3},{root.plane_4})" for root in _inside() if chosen(root)}


def roots_by_place() -> tuple[float, ...]:
    """Roots inside, on the sides, in the corners; NaN where they differ."""
    counts = root_counts(_grid())
    sides = [counts[0, 1:-1], counts[-1, 1:-1], counts[1:-1, 0], counts[1:-1, -1]]
    groups = [counts[1:-1, 1:-1], np.concatenate(sides), counts[[0, 0, -1, -1], [0, -1, 0, -1]]]
    return tuple(float(group.flat[0]) if np.ptp(group) == 0 else np.nan for group in groups)


def roots_lie_on_two_planes() -> bool:
    """Whether every α₃ is α₁ or 2δ - α₁ and every α₄ is α₂ or -2δ - α₂, modulo π."""
    offset = 2.0 * delta(_VEHICLE)

    def off(angle: float, *planes: float) -> float:
        return min(abs((angle - plane + pi / 2) % pi - pi / 2) for plane in planes)

    return all(
        off(root.alpha_3, root.alpha_1, offset - root.alpha_1) < _ZERO
        and off(root.alpha_4, root.alpha_2, -offset - root.alpha_2) < _ZERO
        for root in _inside()
    )


def positive_roots_have_no_minus() -> bool:
    """Whether no root with R > 0 lies on a minus plane."""
    return not any("-" in name for name in classes(lambda root: root.R > _ZERO))


def _is_negative(root: Root, offset: float, level: str) -> bool:
    """Whether R < 0: exactly, or if ``level`` prints R, with its terms and the printed offset."""
    on_red = abs(root.alpha_3 - root.alpha_1) + abs(root.alpha_4 - root.alpha_2) < _ZERO
    if not level or on_red:
        return root.R < -_ZERO
    first, second = root.alpha_1, root.alpha_2
    angles = np.array([[first, second, offset - first, -offset - second]])
    return float(value_of_terms(level, angles)[0]) < 0.0


def all_classes_are_negative(offset: float = 0.0, level: str = "") -> bool:
    """Whether all seven classes occur among the roots with R < 0, exactly or as printed."""
    return len(classes(lambda root: _is_negative(root, offset, level))) == 7


def some_point_has_two_negative_roots(offset: float = 0.0, level: str = "") -> bool:
    """Whether a grid point has two roots with R < 0, exactly or as printed."""
    return any(sum(_is_negative(root, offset, level) for root in cell) == 2 for cell in _cells())


def _positive_points() -> set[tuple[int, int]]:
    """Grid points, in units of π/16 from the middle, that have a root with R > 0."""
    return {
        (round(root.alpha_1 * 16 / pi), round(root.alpha_2 * 16 / pi))
        for root in _inside()
        if root.R > _ZERO
    }


def positive_points(below: bool = False) -> float:
    """The number of grid points that have a root with R > 0: all, or below the diagonal."""
    return float(sum(not below or j < i for i, j in _positive_points()))


def at_most_one_positive_root() -> bool:
    """Whether no grid point has two roots with R > 0."""
    return sum(root.R > _ZERO for root in _inside()) == len(_positive_points())


def positive_points_fill(edge: int) -> bool:
    """Whether R > 0 holds exactly at the points with α₂ at least α₁ + ``edge`` π/16.

    2 makes the printed triangle (-7, 7), (-7, -5), (5, 7), and 0 the triangle to the diagonal.
    """
    expected = {(i, j) for i in range(-7, 8) for j in range(-7, 8) if j >= i + edge}
    return _positive_points() == expected


def upper_triangle_is_blue_only() -> bool:
    """Whether no point with a red root of R > 0 has another red root, so only (-,-) is left."""
    for cell in _cells():
        classes = {f"({root.plane_3},{root.plane_4})" for root in cell if root.R <= _ZERO}
        positive = any(root.R > _ZERO for root in cell)
        if positive and not classes <= {"(-,-)", "(-,?)", "(?,-)", "(?,?)"}:
            return False
    return True


def pairs_are_equal_on_red() -> bool:
    """Whether α₃ = α₁ and α₄ = α₂ for every root on (+,+)."""
    return all(
        abs(root.alpha_3 - root.alpha_1) + abs(root.alpha_4 - root.alpha_2) < _ZERO
        for root in _inside()
        if (root.plane_3, root.plane_4) == ("+", "+")
    )


def planes_intersect() -> bool:
    """Whether α₃ of both colors agrees on α₁ = δ, and α₄ on α₂ = -δ, whatever the other angle."""
    first, second = _P
    ratio = drag_ratio(_VEHICLE)
    apart = [
        abs(colored_angles(*angles, "blue", ratio)[axis] - angles[axis])
        for other in np.linspace(-1.0, 1.0, 21).tolist()
        for axis, angles in enumerate(((first, other), (other, second)))
    ]
    return max(apart) < 1e-12


def one_root_of_each_color() -> bool:
    """At 200 random (α₁, α₂) off the lines through P: the roots are one red, one blue."""
    rng, offset = np.random.default_rng(7), 2.0 * delta(_VEHICLE)
    for first, second in rng.uniform(-1.5, 1.5, (200, 2)).tolist():
        lines = [(first, second), (offset - first, -offset - second)]
        roots = [(r.alpha_3, r.alpha_4) for r in find_roots(first, second, _VEHICLE)]
        apart = np.array(roots)[:, np.newaxis] - np.array(lines)  # angles up to a multiple of pi
        same = np.abs(np.sin(apart)).max(axis=-1) < 1e-6
        if len(roots) != 2 or not same.any(axis=0).all():
            return False
    return True


def red_residual_holds(formula: str, printed: float) -> bool:
    """Whether Eq. (7) of ch. 8, R with α₃ = α₁ and α₄ = α₂, has the printed coefficients."""
    if not terms_hold("R", formula, printed):
        return False
    first, second = np.meshgrid(np.linspace(-1.0, 1.0, 21), np.linspace(-1.0, 1.0, 21))
    angles = np.stack([first, second, first, second], axis=-1)
    exact = red_residual(first, second, _VEHICLE)
    return bool(np.abs(residuals(angles, _VEHICLE).R - exact).max() < 1e-9)


def l_divides_in_two() -> bool:
    """Whether on every vertical line of the square L has one point or none, with R > 0 above."""
    for first in np.linspace(-1.0, 1.0, 41).tolist():
        edge = float(curve_l(first, _VEHICLE))
        above, below = (region(first, edge + step, _VEHICLE) for step in (1e-3, -1e-3))
        if (above, below) != ("S_U", "S_D"):
            return False
    return True


def coefficients_vanish_as_printed(offset: float, with_roll: str, with_pitch: str) -> bool:
    """Whether the printed R_φ and R_θ vanish on blue with the printed offset."""
    first, second = np.random.default_rng(0).uniform(-1.0, 1.0, (200, 2)).T
    angles = np.stack([first, second, offset - first, -offset - second], axis=-1)
    values = [value_of_terms(formula, angles) for formula in (with_roll, with_pitch)]
    return bool(np.abs(values).max() < 1e-12)


def coefficients_vanish(color: str) -> bool:
    """Whether R_φ and R_θ vanish on the exact lines of a color."""
    rng = np.random.default_rng(0)
    for first, second in rng.uniform(-1.0, 1.0, (200, 2)).tolist():
        back = (
            (first, second)
            if color == "red"
            else colored_angles(first, second, "blue", drag_ratio(_VEHICLE))
        )
        values = residuals((first, second, *back), _VEHICLE)
        if max(abs(float(values.R_phi)), abs(float(values.R_theta))) > 1e-12:
            return False
    return True


def _colors_apart(first: float, second: float, offset: float) -> float:
    """Distance (rad) between the red and the blue (α₃, α₄)."""
    return max(abs(offset - 2.0 * first), abs(offset + 2.0 * second))


def colors_meet(offset: float = 2.0 * _P[0]) -> bool:
    """Whether at P both colors have the same angles, to half of the last printed digit."""
    return _colors_apart(0.5 * offset, -0.5 * offset, offset) < 5e-7


def colors_meet_nowhere_else() -> bool:
    """On the square, in steps of 0.01 rad, the colors' angles differ by their distance from P."""
    axis = np.linspace(-1.0, 1.0, 201).tolist()
    offset = 2.0 * delta(_VEHICLE)
    return all(
        _colors_apart(first, second, offset) > 1e-3
        for first in axis
        for second in axis
        if max(abs(first - _P[0]), abs(second - _P[1])) > 1e-3
    )


def shift_from_chapter_8(part: str) -> float:
    """Distance (rad) from ch. 8 to ch. 12 of P, or the largest one of L along the second angle."""
    if part == "P":
        return abs(point_p(PRESETS["luukkonen"])[0] - _P[0])
    axis = np.linspace(-1.0, 1.0, 41)
    return float(np.abs(curve_l(axis, PRESETS["luukkonen"]) - curve_l(axis, _VEHICLE)).max())


def maps_are_similar(p_near: float, l_near: float) -> bool:
    """Whether root counts are equal, and P and L nearer than ``p_near`` and ``l_near`` (rad)."""
    own, former = (root_counts(grid_roots(PRESETS[n])) for n in ("luukkonen", "ar_drone_2"))
    near = shift_from_chapter_8("P") < p_near and shift_from_chapter_8("L") < l_near
    return near and bool(np.array_equal(own, former))
