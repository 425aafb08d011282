"""Chapter 12: the Two Color Map of another vehicle."""

from __future__ import annotations

from functools import partial
from math import atan
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim
from tiltsim.report.measures import (
    DIGITS,
    EVERY_TERM,
    coefficient,
    determinant_coefficients,
    exact_and_printed,
    terms,
    terms_hold,
)
from tiltsim.report.statement import read_statements
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


THESIS: Final = read_statements(
    "ch12", every_term=EVERY_TERM, digits=DIGITS.format("1.025 / 2.927")
)

CLAIMS = (
    *(
        AnalysisClaim(
            THESIS["ch12-coefficients"],
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
            THESIS["ch12-terms"],
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
        THESIS["ch12-coefficients-differ"],
        _coefficients_differ_greatly,
        refuted="Up to the common factor 1.025 they are those of ch. 3 within 1 %: K_m / (L K_f) "
        "is 0.1700 instead of 0.1687.",
    ),
    AnalysisClaim(THESIS["ch12-three-parameters"], _only_three_parameters_matter),
    AnalysisClaim(
        THESIS["ch12-unique-map"],
        lambda: not _two_vehicles_can_share_a_map(),
        refuted="The map depends only on the ratio K_m / (L K_f).",
    ),
    AnalysisClaim(THESIS["ch12-similar-map"], _maps_are_similar),
    AnalysisClaim(
        THESIS["ch12-shifts"], lambda: abs(_P[0] - point_p(_FORMER)[0]) > 1e-3, case="point P"
    ),
    AnalysisClaim(THESIS["ch12-shifts"], lambda: _l_apart() > 1e-3, case="curve L"),
    *exact_and_printed(THESIS["ch12-p"], _P[0], 0.5 * atan(1.025 / 2.927), "0.168421"),
    AnalysisClaim(
        THESIS["ch12-p-below"],
        lambda: region(*_P, _VEHICLE) == "S_D",
        refuted="As in ch. 8: P lies on L exactly.",
    ),
    *exact_and_printed(THESIS["ch12-offset"], 2.0 * _P[0], atan(1.025 / 2.927), "0.336842"),
)
