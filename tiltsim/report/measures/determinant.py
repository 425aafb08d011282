"""The decoupling matrix, its determinant term by term, and margins of gaits (ch. 3 to 12)."""

import re
from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise, product
from typing import Final, NamedTuple

import numpy as np

from tiltsim_controllers.analysis.published_gaits import (
    DETERMINANT_CASES,
    PUBLISHED_GAITS,
    TRIANGLE,
    robustness,
    smallest_margin,
)
from tiltsim_controllers.analysis.singularity import (
    decoupling_matrix,
    determinant,
    force_matrix,
    margin_over_gait,
    residuals,
    singular_values,
    torque_matrix,
)
from tiltsim_controllers.analysis.two_color_map import delta
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.cat import SWINGS
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE = PRESETS["ar_drone_2"]
_GAIT_1 = (-0.1, 0.1, -0.2, 0.1)  # the fixed gait 1 of ch. 3, rad.


class Coefficients(NamedTuple):
    """Coefficients of the determinant (ch. 3, Eq. 17), by product: "csss" is c1 s2 s3 s4."""

    R: dict[str, float]  # of cos(roll) cos(pitch)
    R_phi: dict[str, float]  # of sin(roll) cos(pitch)
    R_theta: dict[str, float]  # of sin(pitch)


def terms(formula: str) -> dict[str, float]:
    """Read printed terms: "4.000 cccc - 5.592 ccsc" has the coefficient -5.592 of c1 c2 s3 c4."""
    coefficients: dict[str, float] = {}
    for sign, number, product_ in re.findall(r"([+-]?) ?([\d.]+) ([cs]{4})", formula):
        coefficients[product_] = coefficients.get(product_, 0.0) + float(sign + number)
    return coefficients


def value_of_terms(formula: str, angles: Floats) -> Floats:
    """The sum of printed terms at tilt angles (rad) of shape (N, 4); shape (N,)."""
    factors = {"s": np.sin(angles), "c": np.cos(angles)}
    parts = [
        value * np.prod([factors[f][:, i] for i, f in enumerate(name)], axis=0)
        for name, value in terms(formula).items()
    ]
    return np.sum(parts, axis=0)


@cache
def determinant_coefficients(vehicle: str = "ar_drone_2") -> Coefficients:
    """The determinant's coefficients: at tilt angles of 0 and 90 degrees only one product is 1."""
    names = ["".join(letters) for letters in product("cs", repeat=4)]
    angles = [[np.pi / 2 if letter == "s" else 0.0 for letter in name] for name in names]
    values = residuals(angles, PRESETS[vehicle])
    return Coefficients(*(dict(zip(names, part.tolist(), strict=True)) for part in values))


def coefficient(part: str, name: str, vehicle: str = "ar_drone_2", scale: float = 1.0) -> float:
    """Absolute value of one coefficient of the determinant.

    Args:
        part, vehicle, scale: See `terms_hold`.
        name: The product: "csss" is c1 s2 s3 s4.
    """
    return scale * abs(float(getattr(determinant_coefficients(vehicle), part)[name]))


def terms_off(
    part: str, formula: str, vehicle: str = "ar_drone_2", scale: float = 1.0
) -> dict[str, float]:
    """By how much printed terms deviate from the exact ones, by product.

    Args:
        part, formula, vehicle, scale: See `terms_hold`.
    """
    printed, exact = terms(formula), getattr(determinant_coefficients(vehicle), part)
    return {name: printed.get(name, 0.0) - scale * value for name, value in exact.items()}


def terms_hold(
    part: str, formula: str, printed: float, vehicle: str = "ar_drone_2", scale: float = 1.0
) -> bool:
    """Whether the printed terms of a part of the determinant are correct and complete.

    Args:
        part: ``R``, ``R_phi`` or ``R_theta``.
        formula: The printed terms; absent ones are 0.
        printed: Accuracy to which they are printed.
        vehicle: The vehicle of the chapter.
        scale: Constant by which the chapter multiplies the determinant.
    """
    return all(abs(off) < printed for off in terms_off(part, formula, vehicle, scale).values())


def condition_holds(printed: float, level: str, with_roll: str, with_pitch: str) -> bool:
    """Whether the printed condition at any attitude is the determinant, part by part.

    Args:
        printed: Accuracy to which the terms are printed.
        level, with_roll, with_pitch: The terms of R, R_phi and R_theta.
    """
    formulas = zip(Coefficients._fields, (level, with_roll, with_pitch))
    return all(terms_hold(part, formula, printed) for part, formula in formulas)


def triangle_is_regular(case: str) -> bool:
    """Whether R keeps one sign on the triangle U, V, M for all five pairs of a case (ch. 3)."""
    share = np.linspace(0.0, 1.0, 151)
    first, second = (part[..., np.newaxis] for part in np.meshgrid(share, share))
    corners = np.array(TRIANGLE)
    edges = corners[1:] - corners[0]
    points = (corners[0] + first * edges[0] + second * edges[1])[(first + second)[..., 0] <= 1.0]
    signs = set()
    for alpha_1, alpha_3 in DETERMINANT_CASES[case].pairs:
        R = residuals(np.insert(points, [0, 1], [alpha_1, alpha_3], axis=1), _VEHICLE).R
        signs |= set(np.sign(R).tolist())
    return len(signs) == 1


def residuals_of_switch(pair: tuple[float, float]) -> Floats:
    """R on the straight line from (1, 1) to (-1, -1), for the other two angles (rad)."""
    line = np.linspace(1.0, -1.0, 2001)
    first, third = (np.full_like(line, angle) for angle in pair)
    return residuals(np.stack([first, line, third, line], axis=-1), _VEHICLE).R


def switching_crosses(case: str) -> bool:
    """Whether R changes sign on that line, for every pair."""
    lines = map(residuals_of_switch, DETERMINANT_CASES[case].pairs)
    return all(R.min() <= 0.0 <= R.max() for R in lines)


def return_to_no_tilt_is_regular() -> bool:
    """Whether R stays positive while any gait of the triangle shrinks to no tilt (ch. 3)."""
    share = np.array([(i, j, 20 - i - j) for i in range(21) for j in range(21 - i)]) / 20.0
    points = share @ np.array(TRIANGLE)
    for case in DETERMINANT_CASES.values():
        for alpha_1, alpha_3 in case.pairs:
            angles = np.insert(points, [0, 1], [alpha_1, alpha_3], axis=1)
            shrinking = np.linspace(0.0, 1.0, 11)[:, np.newaxis, np.newaxis] * angles
            if residuals(shrinking, _VEHICLE).R.min() <= 0.0:
                return False
    return True


def rest_is_singular(rows: Sequence[int]) -> bool:
    """Whether the matrix of Eq. (12) is singular, level, with one rotor of gait 1 at rest.

    ``rows`` are the numbers, from 0, of the rows with the factor 2|w| of the rotor's speed.
    """
    matrix = decoupling_matrix(_GAIT_1, 0.0, 0.0, _VEHICLE)
    matrix = matrix / np.abs(matrix).max(axis=1, keepdims=True)
    for rotor in range(4):
        stopped = matrix.copy()
        stopped[list(rows)] *= np.where(np.arange(4) == rotor, 0.0, 1.0)
        if abs(np.linalg.det(stopped)) > 1e-9:
            return False
    return True


def eight_inputs_have_full_rank() -> bool:
    """Whether forces and torques change in all six directions with rotor speeds and tilts."""
    rng, step = np.random.default_rng(1), 1e-6
    speeds = np.array([-300.0, 300.0, -300.0, 300.0])
    squares = speeds * np.abs(speeds)

    def wrench(tilts: Floats) -> Floats:
        torque = np.asarray(torque_matrix(tilts, _VEHICLE))
        return np.concatenate([np.asarray(force_matrix(tilts)), torque])

    for tilts in rng.uniform(-np.pi, np.pi, (200, 4)):
        columns = [wrench(tilts) * 2.0 * np.abs(speeds)]
        for shift in step * np.eye(4):
            change = (wrench(tilts + shift) - wrench(tilts - shift)) @ squares / (2.0 * step)
            columns.append(change[:, np.newaxis] / 300.0)
        if np.linalg.matrix_rank(np.concatenate(columns, axis=1), tol=1.0) < 6:
            return False
    return True


def shrunk_gaits_are_regular() -> bool:
    """Ch. 5, Eq. (18): as a gait shrinks, the determinant goes to 4 cos(roll) cos(pitch)."""
    roll, pitch = np.meshgrid(*[np.linspace(-1.5, 1.5, 61)] * 2)
    limit = determinant(np.zeros(4), roll, pitch, _VEHICLE)
    agrees = bool(np.abs(limit - 4.0 * np.cos(roll) * np.cos(pitch)).max() < 1e-9)
    return agrees and bool((limit > 0.0).all())


TROT: Final = np.linspace(-0.65, 0.65, 131)
"""Angles of the trot, up to the largest, rad."""


def trot_residuals() -> Floats:
    """R of the trot at the angles `TROT`, shape (N,)."""
    return residuals(np.stack([-TROT, -TROT, TROT, TROT], axis=-1), _VEHICLE).R


def only_three_parameters_matter() -> bool:
    """Whether mass, inertia and gravity do not change the determinant's coefficients."""
    vehicle = PRESETS["luukkonen"]
    other = vehicle._replace(mass=1.0, inertia_xx=0.1, inertia_zz=0.2, gravity=3.7)
    angles = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 4))
    same = zip(residuals(angles, vehicle), residuals(angles, other), strict=True)
    return all(np.array_equal(own, changed) for own, changed in same)


_ZERO: Final = 1e-9


@cache
def cat_margin(gait: str, scale: int = 1) -> float:
    """Smallest margin (rad) of a gait of ch. 5 over a period, with its angles over ``scale``."""
    swing = SWINGS[gait]
    plan = plans.cat(gait, swing.amplitude, 1.0, swing.lean)
    return smallest_margin(plan.scaled(scale), _VEHICLE)


def scaling_enlarges(gait: str) -> bool:
    """Whether the margin grows from 1 over 1/2 to 1/3, where a gait whose R vanishes has none."""
    margins = [max(0.0, cat_margin(gait, scale)) for scale in (1, 2, 3)]
    return all(first < second for first, second in pairwise(margins))


def scaling_costs_side_force(gait: str) -> bool:
    """Whether the largest side share of a rotor's thrust falls from 1 over 1/2 to 1/3."""
    swing = SWINGS[gait]
    plan = plans.cat(gait, swing.amplitude, 1.0, swing.lean)
    times = plan.sample_times(401)
    shares = [np.abs(np.sin(plan.scaled(scale).angles(times))).max() for scale in (1, 2, 3)]
    return all(first > second for first, second in pairwise(shares))


def angles_of(key: str, exact: bool = False) -> Floats:
    """Tilt angles (rad) of a gait over a period, as printed or on the exact lines, shape (N, 4)."""
    published = PUBLISHED_GAITS[key]
    gait = (published.exact if exact else None) or published.gait
    return gait.angles(gait.sample_times(401))


def sign_of(values: Floats) -> float:
    """1, -1, or 0 where values are zero or change their sign."""
    one_sided = np.abs(values).min() >= _ZERO and np.ptp(np.sign(values)) == 0
    return float(np.sign(values[0])) if one_sided else 0.0


def angles_as_printed(key: str, offset: float) -> Floats:
    """A gait of `PUBLISHED_GAITS` with the printed P and offset, over a period, shape (N, 4)."""
    first, second, third, _ = angles_of(key).T
    blue = np.abs(third - first) > 1e-12
    aside = 0.5 * offset - delta(_VEHICLE)  # so that a path through P passes the printed one
    first, second = first + aside, second - aside
    return np.stack(
        [
            first,
            second,
            np.where(blue, offset - first, first),
            np.where(blue, -offset - second, second),
        ],
        axis=-1,
    )


def printed_margin(key: str, offset: float, bias: float = 1.0) -> float:
    """Smallest margin (rad) of `angles_as_printed`, the last two of them times ``bias``."""
    angles = angles_as_printed(key, offset) * (1.0, 1.0, bias, bias)
    return float(margin_over_gait(angles, _VEHICLE).min())


def conditioning_of_blue(exact: bool = False) -> float:
    """The smallest singular value of tau, as a share of the largest, of ch. 6's gait 1.

    The largest share over a period, with the printed angles or on the exact lines.
    """
    values = singular_values(angles_of("ch06_gait_1", exact), _VEHICLE)
    return float((values[:, 2] / values[:, 0]).max())


def remainder_of_blue() -> str:
    """The largest of R, R_phi, R_theta and the conditioning on the exact lines, in words."""
    parts = residuals(angles_of("ch06_gait_1", exact=True), _VEHICLE)
    remainder = max(conditioning_of_blue(exact=True), float(np.abs(parts).max()))
    return "below 1e-9" if remainder < _ZERO else f"{remainder:.0e}"


def _as_published(
    key: str, offset: float, formulas: list[str], bias: float = 1.0
) -> tuple[float, float]:
    """Smallest margin of a blue gait, and the sign of its R (0 if it changes), as ch. 6 has them.

    The offset is the printed one, the formulas are the printed R, R_phi and R_theta. A margin is
    negative where R has another sign than at the start.
    """
    angles = angles_of(key)
    angles[:, 2], angles[:, 3] = offset - angles[:, 0], -offset - angles[:, 1]
    angles[:, 2:] *= bias
    R, R_phi, R_theta = (value_of_terms(formula, angles) for formula in formulas)
    margin = np.arcsin(R / np.sqrt(R**2 + R_phi**2 + R_theta**2)) * np.sign(R[0])
    return float(margin.min()), 0.0 if np.ptp(np.sign(R)) else float(np.sign(R[0]))


def sign_as_published(key: str, offset: float, formulas: list[str]) -> float:
    """The sign of R with the printed offset and formulas."""
    return _as_published(key, offset, formulas)[1]


def margin_as_published(key: str, offset: float, formulas: list[str], bias: float = 1.0) -> float:
    """Smallest margin (rad) of a blue gait with the printed offset and formulas.

    Args:
        key: Key of `PUBLISHED_GAITS`.
        offset: The printed offset of blue, rad.
        formulas: The printed R, R_phi and R_theta.
        bias: Factor on the last two angles.
    """
    return _as_published(key, offset, formulas, bias)[0]


def is_more_robust_as_published(key: str, offset: float, formulas: list[str]) -> bool:
    """Whether a gait beats its biased twin with the printed offset and formulas."""
    bias = PUBLISHED_GAITS[key].bias or 1.0
    own, twin = (margin_as_published(key, offset, formulas, eta) for eta in (1.0, bias))
    return own > twin


def _greater_advantage_over_99(margin: Callable[[float], float]) -> bool:
    """Whether a gait exceeds its 99 % twin by more than its 80 % twin."""
    own, near, far = (margin(eta) for eta in (1.0, 0.99, 0.8))
    return own > near and own - near > own - far


def advantage_as_published(key: str, offset: float, formulas: list[str]) -> bool:
    """`_greater_advantage_over_99` with the printed offset and formulas."""
    return _greater_advantage_over_99(lambda bias: margin_as_published(key, offset, formulas, bias))


def advantage_on_exact_lines(key: str) -> bool:
    """`_greater_advantage_over_99` on the exact lines."""
    exact = PUBLISHED_GAITS[key].exact
    assert exact is not None
    return _greater_advantage_over_99(
        lambda bias: max(0.0, smallest_margin(exact.biased(bias), _VEHICLE))
    )


def partial_scaling_can_harm(keys: list[str]) -> bool:
    """Whether a gait's biased twin has a smaller margin than the gait."""
    found = [robustness(PUBLISHED_GAITS[key]) for key in keys]
    return any(one.margin_biased < one.margin for one in found if one.margin_biased is not None)


def printed_angles_lie_on_the_lines(key: str) -> bool:
    """Whether the printed angles lie on the lines of their color, to half their last digit."""
    published = PUBLISHED_GAITS[key]
    first, second, third, fourth = published.gait.angles(np.arange(4) / 4.0).T
    if published.color == "blue":
        offset = 2.0 * delta(_VEHICLE)
        first, second = offset - first, -offset - second
    return bool(np.abs(np.stack([third - first, fourth - second])).max() < 0.0005)
