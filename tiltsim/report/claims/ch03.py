"""Chapter 3: the decoupling matrix of the tiltrotor, and fixed gaits that can be flown."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.measures import (
    EVERY_TERM,
    Coefficients,
    coefficient,
    grows,
    planned_gait_tilts_less,
    terms,
    terms_hold,
)
from tiltsim.report.statement import read_statements
from tiltsim_controllers.analysis.published_gaits import DETERMINANT_CASES, TRIANGLE
from tiltsim_controllers.analysis.singularity import (
    decoupling_matrix,
    determinant,
    force_matrix,
    residuals,
)
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


def _fourth_row_is_the_acceleration() -> bool:
    """Whether K_f/m R F(alpha), with K_f in F, is what the rotors accelerate the vehicle with."""
    forces = _VEHICLE.thrust_coefficient * force_matrix((-0.1, 0.1, -0.2, 0.1))[2]
    printed = _VEHICLE.thrust_coefficient / _VEHICLE.mass * forces
    return bool(np.allclose(printed, forces / _VEHICLE.mass))


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


THESIS: Final = read_statements("ch03", every_term=EVERY_TERM)

CLAIMS = (
    *(
        AnalysisClaim(
            THESIS["ch3-coefficients"],
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
        THESIS["ch3-eq-17"],
        lambda: all(
            terms_hold(part, printed, _VEHICLE) for part, printed in EQ_17._asdict().items()
        ),
        refuted="Two misprints: -2.880 s1 s2 c3 s4 sin φ cos θ should be s1 s2 c3 c4, as in ch. 5 "
        "and 6, and -2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4.",
    ),
    AnalysisClaim(THESIS["ch3-eq-19"], partial(terms_hold, "R", EQ_19, _VEHICLE)),
    AnalysisClaim(
        THESIS["ch3-fourth-row"],
        _fourth_row_is_the_acceleration,
        refuted="K_f is counted twice, once before the matrix and once in F(α).",
    ),
    *(
        AnalysisClaim(THESIS["ch3-triangle"], partial(_triangle_is_regular, case), case=restriction)
        for case, (restriction, _) in DETERMINANT_CASES.items()
    ),
    *(
        AnalysisClaim(
            THESIS["ch3-must-cross"],
            partial(_switching_crosses, case),
            case=restriction,
            refuted=_NO_CROSSING if case == "negative" else "",
        )
        for case, (restriction, _) in DETERMINANT_CASES.items()
    ),
    AnalysisClaim(THESIS["ch3-untilted"], _untilted_is_regular),
    *(
        FlightClaim(statement, _pair(gait), measure, case=title)
        for statement, measure in (
            (THESIS["ch3-over-actuated-faster"], partial(grows, "altitude_settling_time")),
            (THESIS["ch3-over-actuated-overshoot"], partial(grows, "altitude_overshoot")),
            (THESIS["ch3-over-actuated-intensive"], planned_gait_tilts_less),
        )
        for gait, title in (("gait_1", "Gait 1"), ("gait_2", "Gait 2"))
    ),
    *(
        AnalysisClaim(
            THESIS["ch3-rest-singular"],
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
        THESIS["ch3-initial-speed"], lambda: _VEHICLE.hover_rotor_speed <= 300.0, published=False
    ),
    AnalysisClaim(THESIS["ch3-return"], _return_to_no_tilt_is_regular),
    FlightClaim(
        THESIS["ch3-stable-corners"], _corners("s", "t", "m"), _stable_flights, published="15"
    ),
    FlightClaim(THESIS["ch3-unstable-corners"], _corners("u", "v"), _stable_flights, published="0"),
)
