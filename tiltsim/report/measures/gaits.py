"""Singularity margins of the gaits of ch. 5 to 8, exact and with the printed digits."""

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np

from tiltsim.report.measures.determinant import value_of_terms
from tiltsim_controllers.analysis.published_gaits import (
    PUBLISHED_GAITS,
    robustness,
    smallest_margin,
)
from tiltsim_controllers.analysis.singularity import margin_over_gait, residuals, singular_values
from tiltsim_controllers.analysis.two_color_map import delta
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.gaits.cat import SWINGS
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]
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
