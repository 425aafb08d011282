"""Chapter 3: the decoupling matrix of the tiltrotor, and fixed gaits that can be flown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.measures import (
    PRINTED,
    Coefficients,
    determinant_coefficients,
    grows,
    terms,
    terms_hold,
    worst_coefficient,
)
from tiltsim_controllers.analysis.published_gaits import DETERMINANT_CASES, TRIANGLE
from tiltsim_controllers.analysis.singularity import decoupling_matrix, determinant, residuals
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]

EQ_19: Final = terms(
    "4.000 cccc + 5.592 cccs - 5.592 ccsc + 5.592 cscc - 5.592 sccc + 0.9716 ccss "
    "+ 0.9716 cssc + 0.9716 sccs + 0.9716 sscc - 2.000 cscs - 2.000 scsc - 0.1687 csss "
    "+ 0.1687 scss - 0.1687 sscs + 0.1687 sssc"
)
"""The printed condition at level attitude, term by term."""

EQ_17: Final = Coefficients(
    R=EQ_19,
    # -2.880 s1 c2 s3 s4 and -2.880 s1 s2 c3 s4 as printed; the latter comes on top of 1.000.
    R_phi=terms(
        "1.000 ccsc - 1.000 sccc - 1.000 csss + 1.000 sscs - 2.880 sscs + 2.880 ccss "
        "+ 2.880 cssc - 2.880 scss"
    ),
    R_theta=terms(
        "1.000 cccs - 1.000 cscc - 1.000 scss + 1.000 sssc - 2.880 ccss + 2.880 cssc "
        "- 2.880 sccs + 2.880 sscc"
    ),
)
"""The printed condition at any attitude, term by term, with its misprints."""


def _coefficient(part: int, product: str) -> Callable[[], float]:
    return lambda: abs(determinant_coefficients(_VEHICLE)[part][product])


def _coefficient_claim(printed: str, case: str, part: int, product: str) -> AnalysisClaim:
    return AnalysisClaim(
        source="ch. 3, Sec. 4, Eqs. (17), (19)",
        statement="Coefficients of the determinant",
        case=case,
        published=printed,
        measure=_coefficient(part, product),
    )


def _triangle_is_regular(case: str) -> bool:
    """Whether R keeps one sign on the triangle U, V, M for all five pairs of a case."""
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


def _switching_crosses(case: str) -> bool:
    """Whether R changes sign on the straight line from (1, 1) to (-1, -1), for every pair."""
    line = np.linspace(1.0, -1.0, 201)
    for alpha_1, alpha_3 in DETERMINANT_CASES[case].pairs:
        angles = np.stack([0 * line + alpha_1, line, 0 * line + alpha_3, line], axis=-1)
        R = residuals(angles, _VEHICLE).R
        if R.min() > 0.0 or R.max() < 0.0:
            return False
    return True


def _untilted_is_regular() -> bool:
    angles = np.linspace(-1.55, 1.55, 101)
    roll, pitch = np.meshgrid(angles, angles)
    return bool((determinant(np.zeros(4), roll, pitch, _VEHICLE) > 0.0).all())


def _pair(gait: str) -> tuple[str, str]:
    return f"ch03_gaits/over_actuated#{gait}", f"ch03_gaits/over_actuated#{gait}_planned"


def _return_to_no_tilt_is_regular() -> bool:
    """Whether R stays positive while any gait of the triangle shrinks to no tilt."""
    share = np.array([(i, j, 20 - i - j) for i in range(21) for j in range(21 - i)]) / 20.0
    points = share @ np.array(TRIANGLE)
    for case in DETERMINANT_CASES.values():
        for alpha_1, alpha_3 in case.pairs:
            angles = np.insert(points, [0, 1], [alpha_1, alpha_3], axis=1)
            shrinking = np.linspace(0.0, 1.0, 11)[:, np.newaxis, np.newaxis] * angles
            if residuals(shrinking, _VEHICLE).R.min() <= 0.0:
                return False
    return True


def _rest_is_singular(*, exact: bool) -> bool:
    """Whether the matrix of Eq. (12) is singular, level, with one rotor of gait 1 at rest."""
    matrix = decoupling_matrix((-0.1, 0.1, -0.2, 0.1), 0.0, 0.0, _VEHICLE)
    matrix = matrix / np.abs(matrix).max(axis=1, keepdims=True)
    for rotor in range(4):
        speeds = np.where(np.arange(4) == rotor, 0.0, 1.0)
        stopped = matrix.copy()
        stopped[0 if exact else 3 :] *= speeds
        if abs(np.linalg.det(stopped)) > 1e-9:
            return False
    return True


def _lifts_at_start() -> bool:
    lift = 4.0 * _VEHICLE.thrust_coefficient * 300.0**2
    return lift >= _VEHICLE.mass * _VEHICLE.gravity


def _stable_flights(flights: Mapping[str, Metrics]) -> float:
    """Number of flights at rest at the end, without a reversed rotor (ch. 3, Sec. 4)."""
    resting = ("final_roll", "final_pitch", "final_yaw", "final_position_error_z")
    return float(
        sum(
            not metrics["diverged"]
            and metrics["min_rotor_speed"] > 0.0
            and all(abs(metrics[name]) < 0.05 for name in resting)
            for metrics in flights.values()
        )
    )


def _corners(*corners: str) -> tuple[str, ...]:
    pairs = ("equal", "half", "negative", "negative_half", "untilted")
    return tuple(f"ch03_gaits/corners#{pair}_{corner}" for pair in pairs for corner in corners)


def _tilts_less(gait: str, flights: Mapping[str, Metrics]) -> bool:
    own, planned = (flights[address] for address in _pair(gait))
    return planned["max_tilt_rate"] < 0.01 * own["max_tilt_rate"]


_NO_CROSSING: Final = (
    "At α₁ = -α₃ = ±1.4 both ends lie in one region and R stays above 0.5 all the way; the other "
    "three pairs are as published."
)
_GAITS: Final = {"gait_1": "Gait 1", "gait_2": "Gait 2"}

CLAIMS = (
    _coefficient_claim("4.000", "c1 c2 c3 c4, cos φ cos θ", 0, "cccc"),
    _coefficient_claim("5.592", "c1 c2 c3 s4, cos φ cos θ", 0, "cccs"),
    _coefficient_claim("0.9716", "c1 c2 s3 s4, cos φ cos θ", 0, "ccss"),
    _coefficient_claim("2.000", "c1 s2 c3 s4, cos φ cos θ", 0, "cscs"),
    _coefficient_claim("0.1687", "c1 s2 s3 s4, cos φ cos θ", 0, "csss"),
    _coefficient_claim("1.000", "c1 c2 s3 c4, sin φ cos θ", 1, "ccsc"),
    _coefficient_claim("2.880", "c1 c2 s3 s4, sin φ cos θ", 1, "ccss"),
    AnalysisClaim(
        source="ch. 3, Sec. 4, Eq. (17)",
        statement="Eq. (17), term by term, is the determinant at any attitude",
        wrong=True,
        why="Two misprints: -2.880 s1 s2 c3 s4 sin φ cos θ should be s1 s2 c3 c4, as in ch. 5 "
        "and 6, and -2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4.",
        measure=lambda: worst_coefficient(EQ_17, _VEHICLE) < PRINTED,
    ),
    AnalysisClaim(
        source="ch. 3, Sec. 4, Eq. (19)",
        statement="Eq. (19), term by term, is the determinant at level attitude",
        measure=partial(terms_hold, "R", EQ_19, _VEHICLE),
    ),
    *(
        AnalysisClaim(
            source="ch. 3, Sec. 5.2, Figs. 10-13",
            statement="The triangle U, V, M of (α₂, α₄) contains no singular gait",
            case=restriction,
            measure=partial(_triangle_is_regular, case),
        )
        for case, (restriction, _) in DETERMINANT_CASES.items()
    ),
    *(
        AnalysisClaim(
            source="ch. 3, Sec. 5.2, Figs. 3, 5, 7, 9",
            statement="From (α₂, α₄) = (1, 1) to (-1, -1) a gait crosses a singular one",
            case=restriction,
            wrong=case == "negative",
            why=_NO_CROSSING if case == "negative" else "",
            measure=partial(_switching_crosses, case),
        )
        for case, (restriction, _) in DETERMINANT_CASES.items()
    ),
    AnalysisClaim(
        source="ch. 3, Sec. 7",
        statement="The untilted vehicle's decoupling matrix is always invertible",
        measure=_untilted_is_regular,
    ),
    *(
        FlightClaim(
            source="ch. 3, Sec. 6.3, Figs. 24-27",
            statement="Over-actuated control responds faster than the planned gait",
            case=title,
            flights=_pair(gait),
            measure=partial(grows, "altitude_settling_time"),
        )
        for gait, title in _GAITS.items()
    ),
    *(
        FlightClaim(
            source="ch. 3, Sec. 7",
            statement="Over-actuated control overshoots less than the planned gait",
            case=title,
            flights=_pair(gait),
            measure=partial(grows, "altitude_overshoot"),
        )
        for gait, title in _GAITS.items()
    ),
    *(
        FlightClaim(
            source="ch. 3, Sec. 6.3, Fig. 27",
            statement="Over-actuated control tilts over-rapidly, the planned gait does not",
            case=title,
            flights=_pair(gait),
            measure=partial(_tilts_less, gait),
        )
        for gait, title in _GAITS.items()
    ),
    AnalysisClaim(
        source="ch. 3, Sec. 6.1.1, Eq. (12)",
        statement="A rotor at rest makes the decoupling matrix singular",
        case="with the factor 2|ϖ| in all rows",
        measure=partial(_rest_is_singular, exact=True),
    ),
    AnalysisClaim(
        source="ch. 3, Sec. 6.1.1, Eq. (12)",
        statement="A rotor at rest makes the decoupling matrix singular",
        case="as printed, in the fourth row only",
        wrong=True,
        why="As printed the column of the resting rotor keeps its torques: regular. The statement "
        "holds for the exact matrix.",
        measure=partial(_rest_is_singular, exact=False),
    ),
    AnalysisClaim(
        source="ch. 3, Sec. 5.3",
        statement="The untilted rotors carry the weight at the initial 300 rad/s",
        published=False,
        measure=_lifts_at_start,
    ),
    AnalysisClaim(
        source="ch. 3, Sec. 7",
        statement="Every gait of the region can return to no tilt without a singularity",
        measure=_return_to_no_tilt_is_regular,
    ),
    FlightClaim(
        source="ch. 3, Sec. 6.2, Figs. 20-23",
        statement="Stable corners (-1.3, 1.3), (1.3, -1.3), (1, 1) of five pairs, each restriction "
        "at its largest tilt and no tilt",
        published="15",
        flights=_corners("s", "t", "m"),
        measure=_stable_flights,
    ),
    FlightClaim(
        source="ch. 3, Sec. 7",
        statement="Stable gaits beyond them, at (-1.5, 1.5) and (1.5, -1.5), of the same pairs",
        published="0",
        flights=_corners("u", "v"),
        measure=_stable_flights,
    ),
)
