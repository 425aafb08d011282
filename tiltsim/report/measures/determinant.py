"""The decoupling matrix of the tiltrotor and its determinant, term by term (ch. 3 to 12)."""

import re
from collections.abc import Sequence
from functools import cache
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from tiltsim_controllers.analysis.published_gaits import DETERMINANT_CASES, TRIANGLE
from tiltsim_controllers.analysis.singularity import (
    decoupling_matrix,
    determinant,
    force_matrix,
    residuals,
    torque_matrix,
)
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


def switching_crosses(case: str) -> bool:
    """Whether R changes sign on the straight line from (1, 1) to (-1, -1), for every pair."""
    line = np.linspace(1.0, -1.0, 201)
    for alpha_1, alpha_3 in DETERMINANT_CASES[case].pairs:
        angles = np.stack([0 * line + alpha_1, line, 0 * line + alpha_3, line], axis=-1)
        R = residuals(angles, _VEHICLE).R
        if R.min() > 0.0 or R.max() < 0.0:
            return False
    return True


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
