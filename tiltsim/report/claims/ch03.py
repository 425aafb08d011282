"""Chapter 3: the decoupling matrix of the tiltrotor, and fixed gaits that can be flown."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.draft import draft
from tiltsim.report.measures import (
    Coefficients,
    coefficient,
    grows,
    planned_gait_tilts_less,
    terms,
    terms_hold,
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


_NO_CROSSING: Final = (
    "At α₁ = -α₃ = ±1.4 both ends lie in one region and R stays above 0.5 all the way; the other "
    "three pairs are as published."
)
_RESTING_COLUMN: Final = (
    "As printed the column of the resting rotor keeps its torques: regular. The statement holds "
    "for the exact matrix."
)

CLAIMS = (
    *(
        AnalysisClaim(
            draft("ch. 3, Sec. 4, Eqs. (17), (19)", "Coefficients of the determinant"),
            partial(coefficient, part, name, _VEHICLE),
            case=" ".join(map("{}{}".format, name, (1, 2, 3, 4))) + factors,
            published=published,
        )
        for published, part, name, factors in (
            ("4.000", "R", "cccc", ", cos φ cos θ"),
            ("5.592", "R", "cccs", ", cos φ cos θ"),
            ("0.9716", "R", "ccss", ", cos φ cos θ"),
            ("2.000", "R", "cscs", ", cos φ cos θ"),
            ("0.1687", "R", "csss", ", cos φ cos θ"),
            ("1.000", "R_phi", "ccsc", ", sin φ cos θ"),
            ("2.880", "R_phi", "ccss", ", sin φ cos θ"),
        )
    ),
    AnalysisClaim(
        draft(
            "ch. 3, Sec. 4, Eq. (17)", "Eq. (17), term by term, is the determinant at any attitude"
        ),
        lambda: all(
            terms_hold(part, printed, _VEHICLE) for part, printed in EQ_17._asdict().items()
        ),
        refuted="Two misprints: -2.880 s1 s2 c3 s4 sin φ cos θ should be s1 s2 c3 c4, as in ch. 5 "
        "and 6, and -2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4.",
    ),
    AnalysisClaim(
        draft(
            "ch. 3, Sec. 4, Eq. (19)",
            "Eq. (19), term by term, is the determinant at level attitude",
        ),
        partial(terms_hold, "R", EQ_19, _VEHICLE),
    ),
    *(
        AnalysisClaim(
            draft(
                "ch. 3, Sec. 5.2, Figs. 10-13",
                "The triangle U, V, M of (α₂, α₄) contains no singular gait",
            ),
            partial(_triangle_is_regular, case),
            case=restriction,
        )
        for case, (restriction, _) in DETERMINANT_CASES.items()
    ),
    *(
        AnalysisClaim(
            draft(
                "ch. 3, Sec. 5.2, Figs. 3, 5, 7, 9",
                "From (α₂, α₄) = (1, 1) to (-1, -1) a gait crosses a singular one",
            ),
            partial(_switching_crosses, case),
            case=restriction,
            refuted=_NO_CROSSING if case == "negative" else "",
        )
        for case, (restriction, _) in DETERMINANT_CASES.items()
    ),
    AnalysisClaim(
        draft("ch. 3, Sec. 7", "The untilted vehicle's decoupling matrix is always invertible"),
        _untilted_is_regular,
    ),
    *(
        FlightClaim(draft(f"ch. 3, {section}", statement), _pair(gait), measure, case=title)
        for section, statement, measure in (
            (
                "Sec. 6.3, Figs. 24-27",
                "Over-actuated control responds faster than the planned gait",
                partial(grows, "altitude_settling_time"),
            ),
            (
                "Sec. 7",
                "Over-actuated control overshoots less than the planned gait",
                partial(grows, "altitude_overshoot"),
            ),
            (
                "Sec. 6.3, Fig. 27",
                "Over-actuated control tilts over-rapidly, the planned gait does not",
                planned_gait_tilts_less,
            ),
        )
        for gait, title in (("gait_1", "Gait 1"), ("gait_2", "Gait 2"))
    ),
    *(
        AnalysisClaim(
            draft(
                "ch. 3, Sec. 6.1.1, Eq. (12)",
                "A rotor at rest makes the decoupling matrix singular",
            ),
            partial(_rest_is_singular, exact=not reason),
            case=case,
            refuted=reason,
        )
        for case, reason in (
            ("with the factor 2|ϖ| in all rows", ""),
            ("as printed, in the fourth row only", _RESTING_COLUMN),
        )
    ),
    AnalysisClaim(
        draft("ch. 3, Sec. 5.3", "The untilted rotors carry the weight at the initial 300 rad/s"),
        lambda: _VEHICLE.hover_rotor_speed <= 300.0,
        published=False,
    ),
    AnalysisClaim(
        draft(
            "ch. 3, Sec. 7", "Every gait of the region can return to no tilt without a singularity"
        ),
        _return_to_no_tilt_is_regular,
    ),
    FlightClaim(
        draft(
            "ch. 3, Sec. 6.2, Figs. 20-23",
            "Stable corners (-1.3, 1.3), (1.3, -1.3), (1, 1) of five pairs, each restriction "
            "at its largest tilt and no tilt",
        ),
        _corners("s", "t", "m"),
        _stable_flights,
        published="15",
    ),
    FlightClaim(
        draft(
            "ch. 3, Sec. 7",
            "Stable gaits beyond them, at (-1.5, 1.5) and (1.5, -1.5), of the same pairs",
        ),
        _corners("u", "v"),
        _stable_flights,
        published="0",
    ),
)
