"""Chapter 3: the decoupling matrix of the tiltrotor, and fixed gaits that can be flown."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim, FlightClaim, Metrics
from tiltsim.report.measures import (
    Coefficients,
    coefficient,
    grows,
    planned_gait_tilts_less,
    terms,
    terms_hold,
)
from tiltsim.report.statement import Statement
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

_RETRACTED: Final = (
    "Sec. 7 of the chapter takes part of it back: “Furthermore, we asserted that crossing these "
    "curves is inevitable when switching from the gait in one region to the gait in another "
    "region. However, this is not always true.”"
)
_NORM: Final = (
    "The over-actuated controller has the gains of the author's public simulation model (the "
    "thesis prints none), and tilt rates are weighted by the force they move; with the norm as "
    "published the flight is lost, see ch3-over-actuated-flies."
)

COEFFICIENTS = Statement(
    id="ch3-coefficients",
    source="ch. 3, Sec. 4, Eqs. (17), (19)",
    text="Coefficients of the determinant",
    thesis="Condition (17) prints them with four digits.",
    criterion="The coefficient rounds to the printed digits",
    pictures=("determinant",),
)
ANY_ATTITUDE = Statement(
    id="ch3-eq-17",
    source="ch. 3, Sec. 4, Eq. (17)",
    text="Eq. (17), term by term, is the determinant at any attitude",
    thesis="“The decoupling matrix is invertible if, and only if” condition (17) holds (Prop. 1).",
    criterion="Every product of sines and cosines has the printed coefficient, to 0.001, and none "
    "is missing",
    finding="slips",
)
LEVEL = Statement(
    id="ch3-eq-19",
    source="ch. 3, Sec. 4, Eq. (19)",
    text="Eq. (19), term by term, is the determinant at level attitude",
    thesis="“When the roll angle and pitch angle of the tiltrotor are close to zero, the "
    "decoupling matrix is invertible if, and only if” condition (19) holds (Prop. 2).",
    criterion="Every product of sines and cosines has the printed coefficient, to 0.001, and none "
    "is missing",
)
FOURTH_ROW = Statement(
    id="ch3-fourth-row",
    source="ch. 3, Sec. 3.1, Eqs. (3), (10), (12)",
    text="The fourth row of the printed matrix is the rotors' vertical acceleration",
    thesis="The fourth row reads “[0 0 1] · K_f/m · R · F(α)”, and F(α) of Eq. (3) contains K_f.",
    criterion="The printed row equals [0 0 1] R F(α)/m of Eq. (1)",
    finding="gains",
)
TRIANGLE_REGULAR = Statement(
    id="ch3-triangle",
    source="ch. 3, Sec. 5.2, Figs. 10-13",
    text="The triangle U, V, M of (α₂, α₄) contains no singular gait",
    thesis="“… any (α₂, α₄) located within or on the edge of the triangular zone defined in (22) "
    "for each case in Section 5.1 will not violate Condition (19).”",
    criterion="R keeps one sign at 11,000 points of the triangle for all five pairs of the case",
    pictures=("determinant",),
)
MUST_CROSS = Statement(
    id="ch3-must-cross",
    source="ch. 3, Sec. 5.2, Figs. 3, 5, 7, 9",
    text="From (α₂, α₄) = (1, 1) to (-1, -1) a gait crosses a singular one",
    thesis="“… switching from (α₂, α₄) = (1,1) to (α₂, α₄) = (−1,−1) is determined to violate "
    "Condition (19) for any of the cases shown in Figures 3, 5, 7 and 9.”",
    criterion="R changes its sign on the straight way, for each of the five pairs of the case",
    note=_RETRACTED,
    finding="switching",
)
UNTILTED = Statement(
    id="ch3-untilted",
    source="ch. 3, Sec. 7",
    text="The untilted vehicle's decoupling matrix is always invertible",
    thesis="“It can be proven that the decoupling matrix for the gait (α₁, α₂, α₃, α₄) = "
    "(0,0,0,0) is always invertible.”",
    criterion="The determinant is positive at all attitudes of a grid up to 1.55 rad",
)
FASTER = Statement(
    id="ch3-over-actuated-faster",
    source="ch. 3, Sec. 6.3, Figs. 24-27",
    text="Over-actuated control responds faster than the planned gait",
    thesis="“… the response was faster than in the control method proposed in this research.”",
    criterion="The time after which the height stays within 5 mm is shorter",
    note=_NORM,
    pictures=("over-actuated",),
)
LESS_OVERSHOOT = Statement(
    id="ch3-over-actuated-overshoot",
    source="ch. 3, Sec. 7",
    text="Over-actuated control overshoots less than the planned gait",
    thesis="“In return, the tiltrotor received a faster response and less overshoot.”",
    criterion="The largest height above the reference is smaller",
    note=_NORM,
    pictures=("over-actuated",),
)
INTENSIVE = Statement(
    id="ch3-over-actuated-intensive",
    source="ch. 3, Sec. 6.3, Fig. 27",
    text="Over-actuated control tilts over-rapidly, the planned gait does not",
    thesis="“… the tilting angles changed over-rapidly and intensively, which is commonly believed "
    "to be unrealistic.”",
    criterion="The planned gait's largest tilt rate is below a hundredth of the other one",
    note=_NORM,
    pictures=("over-actuated",),
)
REST = Statement(
    id="ch3-rest-singular",
    source="ch. 3, Sec. 6.1.1, Eq. (12)",
    text="A rotor at rest makes the decoupling matrix singular",
    thesis="“… none of the angular velocities touched 0, which guarantees the invertibility of the "
    "decoupling matrix in (12).”",
    criterion="The matrix of gait 1 at level attitude has rank 3 whichever rotor rests",
    finding="gains",
)
TOO_SLOW = Statement(
    id="ch3-initial-speed",
    source="ch. 3, Sec. 5.3",
    text="The untilted rotors carry the weight at the initial 300 rad/s",
    thesis="“… these angular velocities are not sufficient to compensate for the effect of "
    "gravity, even for the case (α₁, α₂, α₃, α₄) = (0,0,0,0).”",
    criterion="The speed at which four untilted rotors carry the weight is at most 300 rad/s",
)
RETURN = Statement(
    id="ch3-return",
    source="ch. 3, Sec. 7",
    text="Every gait of the region can return to no tilt without a singularity",
    thesis="“… the tiltrotor may return to the safe gait (0,0,0,0) as the middle step before "
    "switching to the desired gait.”",
    criterion="R stays positive while any gait of the triangle and any of the 20 pairs shrinks to "
    "zero",
)
STABLE = Statement(
    id="ch3-stable-corners",
    source="ch. 3, Sec. 6.2, Figs. 20-23",
    text="Stable corners (-1.3, 1.3), (1.3, -1.3), (1, 1) of five pairs, each restriction "
    "at its largest tilt and no tilt",
    thesis="“… the regions of applicable (α₂, α₄) for the remaining 19 cases contained the same "
    "triangular region governed by (−1.3,1.3), (1.3,−1.3), and (1,1).”",
    criterion="Of 15 flights, those that end within 0.05 rad and 0.05 m of zero and in which no "
    "rotor reverses are all 15",
)
UNSTABLE = Statement(
    id="ch3-unstable-corners",
    source="ch. 3, Sec. 7",
    text="Stable gaits beyond them, at (-1.5, 1.5) and (1.5, -1.5), of the same pairs",
    thesis="“… the control result is very likely to be unstable if (α₂, α₄) lies outside the "
    "relevant colored areas in Figures 20–23.”",
    criterion="Of ten flights none ends within 0.05 rad and 0.05 m of zero without a reversed "
    "rotor",
)

CLAIMS = (
    *(
        AnalysisClaim(
            COEFFICIENTS,
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
        ANY_ATTITUDE,
        lambda: all(
            terms_hold(part, printed, _VEHICLE) for part, printed in EQ_17._asdict().items()
        ),
        refuted="Two misprints: -2.880 s1 s2 c3 s4 sin φ cos θ should be s1 s2 c3 c4, as in ch. 5 "
        "and 6, and -2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4.",
    ),
    AnalysisClaim(LEVEL, partial(terms_hold, "R", EQ_19, _VEHICLE)),
    AnalysisClaim(
        FOURTH_ROW,
        _fourth_row_is_the_acceleration,
        refuted="K_f is counted twice, once before the matrix and once in F(α).",
    ),
    *(
        AnalysisClaim(TRIANGLE_REGULAR, partial(_triangle_is_regular, case), case=restriction)
        for case, (restriction, _) in DETERMINANT_CASES.items()
    ),
    *(
        AnalysisClaim(
            MUST_CROSS,
            partial(_switching_crosses, case),
            case=restriction,
            refuted=_NO_CROSSING if case == "negative" else "",
        )
        for case, (restriction, _) in DETERMINANT_CASES.items()
    ),
    AnalysisClaim(UNTILTED, _untilted_is_regular),
    *(
        FlightClaim(statement, _pair(gait), measure, case=title)
        for statement, measure in (
            (FASTER, partial(grows, "altitude_settling_time")),
            (LESS_OVERSHOOT, partial(grows, "altitude_overshoot")),
            (INTENSIVE, planned_gait_tilts_less),
        )
        for gait, title in (("gait_1", "Gait 1"), ("gait_2", "Gait 2"))
    ),
    *(
        AnalysisClaim(REST, partial(_rest_is_singular, exact=not reason), case=case, refuted=reason)
        for case, reason in (
            ("with the factor 2|ϖ| in all rows", ""),
            ("as printed, in the fourth row only", _RESTING_COLUMN),
        )
    ),
    AnalysisClaim(TOO_SLOW, lambda: _VEHICLE.hover_rotor_speed <= 300.0, published=False),
    AnalysisClaim(RETURN, _return_to_no_tilt_is_regular),
    FlightClaim(STABLE, _corners("s", "t", "m"), _stable_flights, published="15"),
    FlightClaim(UNSTABLE, _corners("u", "v"), _stable_flights, published="0"),
)
