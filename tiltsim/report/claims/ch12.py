"""Chapter 12: the Two Color Map of another vehicle."""

from __future__ import annotations

from functools import partial
from math import atan
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim
from tiltsim.report.measures import (
    DIGITS,
    coefficient,
    determinant_coefficients,
    exact_and_printed,
    terms,
    terms_hold,
)
from tiltsim.report.statement import Statement
from tiltsim_controllers.analysis.singularity import residuals
from tiltsim_controllers.analysis.two_color_map import (
    curve_l,
    grid_roots,
    point_p,
    region,
    root_counts,
)
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["luukkonen"]
_FORMER: Final = PRESETS["ar_drone_2"]
_P: Final = point_p(_VEHICLE)
SCALE: Final = 1.025
"""Ch. 12 prints the determinant times this constant."""

EQ_8: Final = terms(
    "4.100 cccc + 5.680 cccs - 5.680 ccsc + 5.680 cscc - 5.680 sccc + 0.9954 ccss "
    "+ 0.9954 cssc + 0.9954 sccs + 0.9954 sscc - 2.050 cscs - 2.050 scsc - 0.1743 csss "
    "+ 0.1743 scss - 0.1743 sscs + 0.1743 sssc"
)
EQ_6: Final = terms(
    "1.025 ccsc - 1.025 sccc - 1.025 csss + 1.025 sscs + 2.927 ccss + 2.927 cssc "
    "- 2.927 sccs - 2.927 sscc"
)
EQ_7: Final = terms(
    "1.025 cccs - 1.025 cscc - 1.025 scss + 1.025 sssc - 2.927 ccss + 2.927 cssc "
    "- 2.927 sccs + 2.927 sscc"
)


def _coefficients_differ_greatly() -> bool:
    """Whether any coefficient differs by a tenth or more, up to the common factor."""
    for own, former in zip(
        determinant_coefficients(_VEHICLE), determinant_coefficients(_FORMER), strict=True
    ):
        for name, value in former.items():
            if abs(own[name] - value) > 0.1 * abs(value) + 1e-9:
                return True
    return False


def _l_apart() -> float:
    """Largest distance (rad) of L from that of ch. 8 along the second angle."""
    axis = np.linspace(-1.0, 1.0, 41)
    return float(np.abs(curve_l(axis, _VEHICLE) - curve_l(axis, _FORMER)).max())


def _maps_are_similar() -> bool:
    """The same counts of roots, P within 0.01 rad and L within 0.02 rad."""
    own, former = (root_counts(grid_roots(vehicle)) for vehicle in (_VEHICLE, _FORMER))
    return bool(
        np.array_equal(own, former)
        and abs(_P[0] - point_p(_FORMER)[0]) < 0.01
        and _l_apart() < 0.02
    )


def _only_three_parameters_matter() -> bool:
    """Whether mass, inertia and gravity do not change the determinant's coefficients."""
    other = _VEHICLE._replace(mass=1.0, inertia_xx=0.1, inertia_zz=0.2, gravity=3.7)
    angles = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 4))
    same = zip(residuals(angles, _VEHICLE), residuals(angles, other), strict=True)
    return all(np.array_equal(own, changed) for own, changed in same)


def _two_vehicles_can_share_a_map() -> bool:
    """Whether other L, K_f and K_m with the same ratio give the same map."""
    other_vehicle = _VEHICLE._replace(
        arm_length=2.0 * _VEHICLE.arm_length,
        thrust_coefficient=3.0 * _VEHICLE.thrust_coefficient,
        drag_coefficient=6.0 * _VEHICLE.drag_coefficient,
    )
    angles = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 4))
    same = zip(residuals(angles, _VEHICLE), residuals(angles, other_vehicle), strict=True)
    return all(np.allclose(own, changed, rtol=1e-9, atol=1e-12) for own, changed in same)


COEFFICIENTS = Statement(
    id="ch12-coefficients",
    source="ch. 12, Eq. (4)",
    text="Coefficients of the determinant, times 1.025",
    thesis="Condition (4) prints them with four digits.",
    criterion="The coefficient rounds to the printed digits, scaled so that the smallest of R_φ "
    "is 1.025",
)
TERMS = Statement(
    id="ch12-terms",
    source="ch. 12, Eqs. (4)-(10)",
    text="The condition is printed correctly, term by term",
    thesis="Eqs. (6), (7), (8) and (10) print R_φ, R_θ and R.",
    criterion="Every product of sines and cosines has the printed coefficient, to 0.001, and none "
    "is missing",
)
DIFFER = Statement(
    id="ch12-coefficients-differ",
    source="ch. 12",
    text="The coefficients differ greatly from those of ch. 3",
    thesis="“In comparison, the coefficients in Equation (4) in this chapter differ greatly from "
    "the ones in Equation (17) in Chapter 3.”",
    criterion="Some coefficient differs by a tenth or more, up to a common factor, which does not "
    "move a zero of the determinant",
)
PARAMETERS = Statement(
    id="ch12-three-parameters",
    source="ch. 12",
    text="L, K_f and K_m are the only parameters that the map depends on",
    thesis="“… there are three parameters (…, L, …, K_f, …, K_m) of the tiltrotor model that "
    "influences the result of the Two Color Map.”",
    criterion="Other masses, inertias and gravity leave R, R_φ and R_θ of 50 random gaits bit for "
    "bit the same",
    finding="map",
)
UNIQUE = Statement(
    id="ch12-unique-map",
    source="ch. 12",
    text="Every set of L, K_f and K_m has its own map",
    thesis="“… the differences in these three parameters … result in different decoupling "
    "matrices, which consequentially lead to the unique corresponding Two Color Map.”",
    criterion="Another set with the same ratio K_m / (L K_f) has another map",
    finding="map",
)
SIMILAR = Statement(
    id="ch12-similar-map",
    source="ch. 12, Fig. 1",
    text="The map is very similar to that of ch. 8",
    thesis="“Note that these results are highly resemble to the ones reported in Chapter 8.”",
    criterion="The grid has the same numbers of roots, P moves by less than 0.01 rad, L by less "
    "than 0.02 rad",
    pictures=("map-luukkonen",),
)
SHIFTS = Statement(
    id="ch12-shifts",
    source="ch. 12, Fig. 1",
    text="P and L move",
    thesis="“Firstly, the orange point (α₁, α₂) in Figure 1 slightly changes its location. "
    "Secondly, L … shifts its shape in Two Color Map.”",
    criterion="The point, or the curve somewhere on the square, moves by more than 0.001 rad",
    pictures=("map-luukkonen",),
)
P = Statement(
    id="ch12-p",
    source="ch. 12, Fig. 1",
    text="The colors meet at P = (p, -p) with p",
    thesis="“The orange point is at (α₁, α₂) = (0.168421, -0.168421).”",
    criterion="p rounds to the printed digits; within 1e-4 rad it is the same point",
    note="In closed form p is δ = atan(K_m / (L K_f)), half the offset. "
    + DIGITS.format("1.025 / 2.927"),
    finding="map",
)
P_BELOW = Statement(
    id="ch12-p-below",
    source="ch. 12, Fig. 1",
    text="P lies below L, in S_D",
    thesis="“Note that this point is a little below L rather than on L.”",
    criterion="R at P, in closed form, is below zero by more than rounding",
    finding="red",
)
OFFSET = Statement(
    id="ch12-offset",
    source="ch. 12, Eq. (12)",
    text="On blue α₁ + α₃ = -(α₂ + α₄) is",
    thesis="Eq. (12): α₃ = -α₁ + 0.336842, α₄ = -α₂ - 0.336842.",
    criterion="The sum rounds to the printed digits; within 1e-4 rad it is the same plane",
    note="In closed form it is 2δ. " + DIGITS.format("1.025 / 2.927"),
    finding="map",
)

CLAIMS = (
    *(
        AnalysisClaim(
            COEFFICIENTS,
            partial(coefficient, part, name, _VEHICLE, SCALE),
            case=" ".join(map("{}{}".format, name, (1, 2, 3, 4))) + factors,
            published=published,
        )
        for published, part, name, factors in (
            ("4.100", "R", "cccc", ", cos φ cos θ"),
            ("5.680", "R", "cccs", ", cos φ cos θ"),
            ("0.9954", "R", "ccss", ", cos φ cos θ"),
            ("2.050", "R", "cscs", ", cos φ cos θ"),
            ("0.1743", "R", "csss", ", cos φ cos θ"),
            ("1.025", "R_phi", "ccsc", ", sin φ cos θ"),
            ("2.927", "R_phi", "ccss", ", sin φ cos θ"),
        )
    ),
    *(
        AnalysisClaim(
            TERMS,
            partial(terms_hold, part, printed, _VEHICLE, SCALE),
            case=name,
            where=f"ch. 12, {equations}",
        )
        for equations, name, part, printed in (
            ("Eqs. (4), (6)", "R_φ", "R_phi", EQ_6),
            ("Eqs. (4), (7)", "R_θ", "R_theta", EQ_7),
            ("Eqs. (4), (8), (10)", "R", "R", EQ_8),
        )
    ),
    AnalysisClaim(
        DIFFER,
        _coefficients_differ_greatly,
        refuted="Up to the common factor 1.025 they are those of ch. 3 within 1 %: K_m / (L K_f) "
        "is 0.1700 instead of 0.1687.",
    ),
    AnalysisClaim(PARAMETERS, _only_three_parameters_matter),
    AnalysisClaim(
        UNIQUE,
        lambda: not _two_vehicles_can_share_a_map(),
        refuted="The map depends only on the ratio K_m / (L K_f).",
    ),
    AnalysisClaim(SIMILAR, _maps_are_similar),
    AnalysisClaim(SHIFTS, lambda: abs(_P[0] - point_p(_FORMER)[0]) > 1e-3, case="point P"),
    AnalysisClaim(SHIFTS, lambda: _l_apart() > 1e-3, case="curve L"),
    *exact_and_printed(P, _P[0], 0.5 * atan(1.025 / 2.927), "0.168421"),
    AnalysisClaim(
        P_BELOW, lambda: region(*_P, _VEHICLE) == "S_D", refuted="As in ch. 8: P lies on L exactly."
    ),
    *exact_and_printed(OFFSET, 2.0 * _P[0], atan(1.025 / 2.927), "0.336842"),
)
