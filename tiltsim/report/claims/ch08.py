"""Chapter 8: the generalized Two Color Map Theorem."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim
from tiltsim.report.claims.ch03 import EQ_19
from tiltsim.report.claims.ch06 import RANK
from tiltsim.report.draft import draft
from tiltsim.report.measures import robustness_claim, terms_hold
from tiltsim_controllers.analysis.published_gaits import PATHS, PUBLISHED_GAITS, robustness
from tiltsim_controllers.analysis.singularity import residuals
from tiltsim_controllers.analysis.two_color_map import curve_l, delta, point_p, red_residual, region
from tiltsim_controllers.analysis.two_color_planner import Circle, Leg, Path, Polyline, check_path
from tiltsim_controllers.gaits.two_color import BLUE, colored_angles
from tiltsim_controllers.vehicle.parameters import PRESETS, drag_ratio

_VEHICLE: Final = PRESETS["ar_drone_2"]
_P: Final = point_p(_VEHICLE)
_TRIANGLE: Final = (_P, (0.7, -0.25), (0.25, -0.7), _P)
_GAITS: Final[dict[str, Path]] = {
    "Gait 1": Polyline((Leg("red", _TRIANGLE), Leg("blue", _TRIANGLE))),
    "Gait 2": Circle("red", (0.5, -0.5), 0.3),
    "Gait 3": Circle("blue", (0.5, -0.5), 0.3),
}
DIGITS: Final = (
    "The thesis searches with coefficients printed to four digits; a search with those "
    "gives the printed value. In closed form it is 2δ = 2 atan(K_m / (L K_f))."
)


def _eq_7_holds() -> bool:
    """Whether Eq. (7), R with α₃ = α₁ and α₄ = α₂, has the printed coefficients."""
    if not terms_hold("R", EQ_19, _VEHICLE):
        return False
    first, second = np.meshgrid(np.linspace(-1.0, 1.0, 21), np.linspace(-1.0, 1.0, 21))
    angles = np.stack([first, second, first, second], axis=-1)
    exact = red_residual(first, second, _VEHICLE)
    return bool(np.abs(residuals(angles, _VEHICLE).R - exact).max() < 1e-9)


def _divides_in_two() -> bool:
    """Whether on every vertical line of the square L has one point or none, with R > 0 above."""
    for first in np.linspace(-1.0, 1.0, 41).tolist():
        edge = float(curve_l(first, _VEHICLE))
        above, below = (region(first, edge + step, _VEHICLE) for step in (1e-3, -1e-3))
        if (above, below) != ("S_U", "S_D"):
            return False
    return True


def _is_zero_on(color: str) -> bool:
    """Whether R_φ and R_θ vanish on the lines of a color."""
    rng = np.random.default_rng(0)
    for first, second in rng.uniform(-1.0, 1.0, (200, 2)).tolist():
        back = (
            (first, second)
            if color == "red"
            else colored_angles(first, second, BLUE, drag_ratio(_VEHICLE))
        )
        values = residuals((first, second, *back), _VEHICLE)
        if max(abs(float(values.R_phi)), abs(float(values.R_theta))) > 1e-12:
            return False
    return True


def _accepted(name: str) -> bool:
    return check_path(PATHS[name], _VEHICLE).accepted


def _needs_the_generalized(name: str) -> bool:
    return check_path(_GAITS[name], _VEHICLE).theorem == "generalized"


def _colors_meet_at_p() -> bool:
    blue = colored_angles(*_P, BLUE, drag_ratio(_VEHICLE))
    return max(abs(blue[0] - _P[0]), abs(blue[1] - _P[1])) < 1e-12


def _regular(name: str) -> bool:
    """Whether R keeps its sign and never vanishes on the accepted path."""
    row = robustness(PUBLISHED_GAITS[f"ch08_{name.lower().replace(' ', '_')}"])
    return row.margin_exact > 1e-6


def _both_are_sufficient() -> bool:
    row = robustness(PUBLISHED_GAITS["ch08_gait_3"])
    return min(row.margin_exact, row.margin_biased or 0.0) > 0.2


_AT_P: Final = "P lies on L, where R = 0, and the other half of the gait is blue. "

CLAIMS = (
    AnalysisClaim(
        draft("ch. 8, Sec. 3.1, Eq. (7)", "Eq. (7), term by term, is R on red"), _eq_7_holds
    ),
    AnalysisClaim(
        draft(
            "ch. 8, Sec. 3.1, Fig. 6",
            "L divides the square |α₁|, |α₂| <= 1 in two, with R > 0 above and R < 0 below",
        ),
        _divides_in_two,
    ),
    AnalysisClaim(
        draft("ch. 8, Sec. 3.4", "The colors meet at P = (p, -p) with p"),
        lambda: _P[0],
        published="0.167099",
        unit="rad",
        in_kind=(0.167, 0.1672),
        why=DIGITS,
    ),
    AnalysisClaim(
        draft("ch. 8, Sec. 3.1", "P lies below L, in S_D"),
        lambda: region(*_P, _VEHICLE) == "S_D",
        refuted="P lies on L exactly: tan(-δ) = tan δ - 2r with r = tan δ. The printed P has "
        "R = -1.4e-4, from its rounding.",
    ),
    AnalysisClaim(
        draft("ch. 8, Sec. 3.5, Eq. (12)", "On blue α₁ + α₃ = -(α₂ + α₄) is"),
        lambda: 2.0 * delta(_VEHICLE),
        published="0.334198",
        unit="rad",
        in_kind=(0.3341, 0.3343),
        why=DIGITS,
    ),
    *(
        AnalysisClaim(
            draft("ch. 8, Sec. 2.2", "The coefficients of roll and pitch vanish exactly"),
            partial(_is_zero_on, color),
            case=color,
            published=color == "red",
            refuted="They also vanish exactly on blue, and so does R: " + RANK
            if color == "blue"
            else "",
        )
        for color in ("red", "blue")
    ),
    *(
        AnalysisClaim(
            draft("ch. 8, Sec. 3.3, Fig. 7", "The example follows the generalized theorem"),
            partial(_accepted, name),
            case=name,
            published=name != "E4",
        )
        for name in PATHS
    ),
    AnalysisClaim(
        draft(
            "ch. 8, Secs. 3.4-3.5",
            "At P both colors have the same angles, so that the color can change",
        ),
        _colors_meet_at_p,
    ),
    *(
        AnalysisClaim(
            draft(
                "ch. 8, Sec. 4",
                "The gait violates the Two Color Map Theorem and follows the generalized one",
            ),
            partial(_needs_the_generalized, name),
            case=name,
        )
        for name in _GAITS
    ),
    *(
        AnalysisClaim(
            draft(
                "ch. 8, Sec. 3.5",
                "According to the theorem the determinant at level attitude is never zero",
            ),
            partial(_regular, name),
            case=name,
            refuted={"Gait 1": _AT_P + RANK, "Gait 3": RANK}.get(name, ""),
        )
        for name in _GAITS
    ),
    robustness_claim("ch. 8, Sec. 4.1, Fig. 10", "ch08_gait_1", "Gait 1", _AT_P + RANK),
    robustness_claim("ch. 8, Sec. 4.2, Fig. 12", "ch08_gait_2", "Gait 2"),
    AnalysisClaim(
        draft("ch. 8, Sec. 4.2, Fig. 12", "Gait 2 has no singular attitude at all"),
        lambda: robustness(PUBLISHED_GAITS["ch08_gait_2"]).margin > np.pi / 2 - 1e-9,
    ),
    AnalysisClaim(
        draft(
            "ch. 8, Sec. 4.3, Fig. 14",
            "Gait 3 and its biased twin both leave enough attitudes (0.2 rad)",
        ),
        _both_are_sufficient,
        refuted=RANK + " R of the biased gait changes sign.",
    ),
)
