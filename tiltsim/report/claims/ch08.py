"""Chapter 8: the generalized Two Color Map Theorem."""

from __future__ import annotations

from functools import partial
from math import atan, pi
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim
from tiltsim.report.claims.ch03 import EQ_19
from tiltsim.report.claims.ch06 import RANK
from tiltsim.report.measures import (
    DIGITS,
    PRINTED_OFFSET,
    angles_as_printed,
    beats_its_biased_twin,
    exact_and_printed,
    margins_as_printed,
    terms_hold,
)
from tiltsim.report.statement import Origin, Statement
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
_PATH: Final = (Origin.PATH,)
_DRAWN: Final = (
    "Figs. 7 and 8 are not available. Place, color and shape are as described, and the size is "
    "chosen so that the rule holds: this is no evidence for the theorem."
)
_LITTLE: Final = 0.2  # rad
_ABUNDANT: Final = 1.0  # rad


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


def _colors_apart(first: float, second: float, offset: float) -> float:
    """Distance (rad) between the red and the blue (α₃, α₄)."""
    return max(abs(offset - 2.0 * first), abs(offset + 2.0 * second))


def _colors_meet(p: float, offset: float) -> bool:
    """Whether at (p, -p) both colors have the same angles, to half of the last printed digit."""
    return _colors_apart(p, -p, offset) < 5e-7


def _colors_meet_nowhere_else() -> bool:
    """On the square, in steps of 0.01 rad, the colors' angles differ by their distance from P."""
    axis = np.linspace(-1.0, 1.0, 201).tolist()
    offset = 2.0 * delta(_VEHICLE)
    return all(
        _colors_apart(first, second, offset) > 1e-3
        for first in axis
        for second in axis
        if max(abs(first - _P[0]), abs(second - _P[1])) > 1e-3
    )


def _key(name: str) -> str:
    return f"ch08_{name.lower().replace(' ', '_')}"


def _regular(name: str) -> bool:
    """Whether R keeps its sign and never vanishes on the accepted path."""
    return robustness(PUBLISHED_GAITS[_key(name)]).margin_exact > 1e-6


def _regular_as_printed(name: str) -> bool:
    R = residuals(angles_as_printed(_key(name)), _VEHICLE).R
    return bool((R > 0.0).all() or (R < 0.0).all())


def _biased_margin(name: str) -> float:
    margin = robustness(PUBLISHED_GAITS[_key(name)]).margin_biased
    assert margin is not None
    return margin


_AT_P: Final = "P lies on L, where R = 0, and the other half of the gait is blue. "
_EXACT: Final = ", on the exact lines"
_PRINTED: Final = ", with the printed P and offset"
_ROUNDED: Final = "What keeps the matrix regular is the sixth digit of the offset."

EQ_7 = Statement(
    id="ch8-eq-7",
    source="ch. 8, Sec. 3.1, Eq. (7)",
    text="Eq. (7), term by term, is R on red",
    thesis="Eq. (7) prints R(α₁, α₂) with 15 terms.",
    criterion="Every product of sines and cosines has the printed coefficient, to 0.001, none is "
    "missing, and the closed form of R on red equals it at 441 points",
)
L_DIVIDES = Statement(
    id="ch8-l-divides",
    source="ch. 8, Sec. 3.1, Fig. 6",
    text="L divides the square |α₁|, |α₂| ≤ 1 in two, with R > 0 above and R < 0 below",
    thesis="“It is a black curve that divides the space (3) into 2 separate subspaces … S_U is "
    "exactly the upper subspace in Fig. 6. While S_D is exactly the lower subspace.”",
    criterion="On 41 vertical lines of the square R changes its sign from below to above where "
    "the closed form of L is, within 0.001 rad",
)
P = Statement(
    id="ch8-p",
    source="ch. 8, Sec. 3.4",
    text="The colors meet at P = (p, -p) with p",
    thesis="“At point P(α₁, α₂) = (0.167099, -0.167099), (α₁, α₂) is able to change the color.”",
    criterion="p rounds to the printed digits; within 1e-4 rad it is the same point",
    note="In closed form p is δ = atan(K_m / (L K_f)), half the offset. "
    + DIGITS.format("1.000 / 2.880"),
    finding="map",
)
P_BELOW = Statement(
    id="ch8-p-below",
    source="ch. 8, Sec. 3.1, Fig. 6",
    text="P lies below L, in S_D",
    thesis="“In other words, P lies below L rather than on it. … Obviously, P ∈ S_D.”",
    criterion="R at P, in closed form, is below zero by more than rounding",
    finding="red",
)
OFFSET = Statement(
    id="ch8-offset",
    source="ch. 8, Sec. 3.5, Eq. (12)",
    text="On blue α₁ + α₃ = -(α₂ + α₄) is",
    thesis="Eq. (12): α₃ = -α₁ + 0.334198, α₄ = -α₂ - 0.334198.",
    criterion="The sum rounds to the printed digits; within 1e-4 rad it is the same plane",
    note="In closed form it is 2δ. " + DIGITS.format("1.000 / 2.880"),
    finding="map",
)
VANISH = Statement(
    id="ch8-coefficients-vanish",
    source="ch. 8, Sec. 2.2",
    text="The coefficients of roll and pitch vanish exactly",
    thesis="R_φ and R_θ “are not exact zero in the blue surface after linearization. … While the "
    "coefficient of φ and θ are exact zero in the red surface.”",
    criterion="R_φ and R_θ are below 1e-12 at 200 random points of the color's lines",
)
EXAMPLES = Statement(
    id="ch8-examples",
    source="ch. 8, Sec. 3.3, Fig. 7",
    text="The example follows the generalized theorem",
    thesis="“Gait E1 ~ E3 are robust gaits satisfying Generalized Two Color Map Theorem. While "
    "Gait E4 violates the requirements.”",
    criterion="The planner accepts E1 to E3 by the rules of Secs. 3.2-3.4 and refuses E4",
    note=_DRAWN,
    origins=_PATH,
    fitted=True,
)
MEET = Statement(
    id="ch8-p-continuous",
    source="ch. 8, Sec. 3.5",
    text="At P both colors have the same angles, so that the color can change",
    thesis="“Notice that Point P … results the identical (α₃, α₄) in both (11) and (12), enabling "
    "to change the color.”",
    criterion="Red and blue (α₃, α₄) differ by less than half of the last printed digit",
)
ONLY_P = Statement(
    id="ch8-p-only",
    source="ch. 8, Sec. 3.4",
    text="The color can change at P only",
    thesis="“(α₁, α₂) can change the color if and only if it passes this point; changing the "
    "current color at any other position is not allowed.”",
    criterion="At all points of a grid of 0.01 rad except P the colors' angles differ",
)
VIOLATES = Statement(
    id="ch8-ignored-gaits",
    source="ch. 8, Sec. 4",
    text="The gait violates the Two Color Map Theorem and follows the generalized one",
    thesis="“… three periodic gaits … that satisfy Generalized Two Color Map Theorem … all these "
    "three gaits does not satisfy Two Color Map Theorem since (1) ~ (2) are violated.”",
    criterion="The planner accepts the path by the rules of Sec. 3 but not by Eqs. (1), (2)",
    note=_DRAWN,
    origins=_PATH,
    fitted=True,
)
NEVER_ZERO = Statement(
    id="ch8-never-zero",
    source="ch. 8, Sec. 3.5",
    text="On a gait of the theorem the determinant at level attitude is never zero",
    thesis="“The subspace-division and L guarantees that the resulting determinant of the "
    "decoupling matrix will be non-zero; it will either be always positive or be always negative.”",
    criterion="R has one sign along the whole gait, without zeros",
    origins=_PATH,
)
MORE_ROBUST = Statement(
    id="ch8-more-robust",
    source="ch. 8, Sec. 4, Figs. 10, 12",
    text="The gait is more robust than its biased twin",
    thesis="“This indicates that Gait 1 is more robust to the biased Gait 1. … Thus, Gait 2 is "
    "more robust to the biased Gait 2.”",
    criterion="The gait's smallest singularity margin at level attitude exceeds its twin's, and "
    "is not zero",
    origins=_PATH,
    pictures=("circle-and-biased",),
)
NO_CURVE = Statement(
    id="ch8-gait-2-all-attitudes",
    source="ch. 8, Sec. 4.2, Fig. 12",
    text="Gait 2 has no singular attitude at all",
    thesis="“… there are no unacceptable attitudes for Gait 2; any attitude in this figure are "
    "acceptable.”",
    criterion="Its singularity margin is a right angle to 1e-9 rad all along",
    origins=_PATH,
    finding="red",
    pictures=("circle-and-biased",),
)
BIASED_1 = Statement(
    id="ch8-biased-1-little",
    source="ch. 8, Sec. 4.1, Fig. 10",
    text="The biased Gait 1 leaves little acceptable attitudes",
    thesis="“Clearly, the biased Gait 1 leaves little acceptable attitudes for the tilt-rotor.”",
    criterion=f"Its smallest singularity margin at level attitude is below {_LITTLE} rad",
    origins=_PATH,
)
BIASED_2 = Statement(
    id="ch8-biased-2-abundant",
    source="ch. 8, Sec. 4.2, Fig. 12",
    text="The biased Gait 2 leaves relatively abundant acceptable attitudes",
    thesis="“… the biased Gait 2 leaves relatively abundant acceptable attitudes.”",
    criterion=f"Its smallest singularity margin at level attitude is above {_ABUNDANT} rad",
    origins=_PATH,
    pictures=("circle-and-biased",),
)
GAIT_3 = Statement(
    id="ch8-gait-3-enough",
    source="ch. 8, Sec. 4.3, Fig. 14",
    text="Gait 3 and its biased twin both leave enough attitudes",
    thesis="“Indeed, both gaits are relatively far from (φ, θ) = (0,0), leaving sufficient "
    "attitude space for the tilt-rotor.”",
    criterion=f"The smallest singularity margin at level attitude is above {_LITTLE} rad",
    origins=_PATH,
)

CLAIMS = (
    AnalysisClaim(EQ_7, _eq_7_holds),
    AnalysisClaim(L_DIVIDES, _divides_in_two),
    *exact_and_printed(P, _P[0], 0.5 * atan(1.000 / 2.880), "0.167099"),
    AnalysisClaim(
        P_BELOW,
        lambda: region(*_P, _VEHICLE) == "S_D",
        refuted="P lies on L exactly: tan(-δ) = tan δ - 2r with r = tan δ. The printed P is below "
        "it by its rounding alone.",
    ),
    *exact_and_printed(OFFSET, 2.0 * _P[0], atan(1.000 / 2.880), "0.334198"),
    *(
        AnalysisClaim(
            VANISH,
            partial(_is_zero_on, color),
            case=color,
            published=color == "red",
            refuted="They also vanish exactly on blue, and so does R: " + RANK
            if color == "blue"
            else "",
            finding=color,
        )
        for color in ("red", "blue")
    ),
    *(
        AnalysisClaim(EXAMPLES, partial(_accepted, name), case=name, published=name != "E4")
        for name in PATHS
    ),
    *(
        AnalysisClaim(MEET, partial(_colors_meet, p, offset), case=case)
        for case, p, offset in (
            ("in closed form", _P[0], 2.0 * delta(_VEHICLE)),
            ("with the printed digits", 0.5 * PRINTED_OFFSET, PRINTED_OFFSET),
        )
    ),
    AnalysisClaim(ONLY_P, _colors_meet_nowhere_else),
    *(AnalysisClaim(VIOLATES, partial(_needs_the_generalized, name), case=name) for name in _GAITS),
    *(
        AnalysisClaim(
            NEVER_ZERO,
            partial(_regular, name),
            case=name if name == "Gait 2" else name + _EXACT,
            refuted={"Gait 1": _AT_P + RANK, "Gait 3": RANK}.get(name, ""),
            finding="red" if name == "Gait 2" else "blue",
        )
        for name in _GAITS
    ),
    *(
        AnalysisClaim(
            NEVER_ZERO, partial(_regular_as_printed, name), case=name + _PRINTED, note=_ROUNDED
        )
        for name in ("Gait 1", "Gait 3")
    ),
    AnalysisClaim(
        MORE_ROBUST,
        partial(beats_its_biased_twin, "ch08_gait_1"),
        case="Gait 1" + _EXACT,
        where="ch. 8, Sec. 4.1, Fig. 10",
        refuted=_AT_P + RANK,
        finding="blue",
    ),
    AnalysisClaim(
        MORE_ROBUST,
        lambda: margins_as_printed("ch08_gait_1")[0] > margins_as_printed("ch08_gait_1")[1],
        case="Gait 1" + _PRINTED,
        where="ch. 8, Sec. 4.1, Fig. 10",
        note=_ROUNDED,
    ),
    AnalysisClaim(
        MORE_ROBUST,
        partial(beats_its_biased_twin, "ch08_gait_2"),
        case="Gait 2",
        where="ch. 8, Sec. 4.2, Fig. 12",
        finding="red",
    ),
    AnalysisClaim(
        NO_CURVE, lambda: robustness(PUBLISHED_GAITS["ch08_gait_2"]).margin > 0.5 * pi - 1e-9
    ),
    AnalysisClaim(BIASED_1, lambda: _biased_margin("Gait 1") < _LITTLE),
    AnalysisClaim(BIASED_2, lambda: _biased_margin("Gait 2") > _ABUNDANT),
    AnalysisClaim(
        GAIT_3,
        lambda: robustness(PUBLISHED_GAITS["ch08_gait_3"]).margin_exact > _LITTLE,
        case="Gait 3" + _EXACT,
        refuted=RANK,
        finding="blue",
    ),
    AnalysisClaim(
        GAIT_3,
        lambda: margins_as_printed("ch08_gait_3")[0] > _LITTLE,
        case="Gait 3, with the printed offset",
        note=_ROUNDED,
    ),
    AnalysisClaim(
        GAIT_3,
        lambda: _biased_margin("Gait 3") > _LITTLE,
        case="biased Gait 3",
        why="On our circle R of the biased gait changes its sign: some of its attitudes are "
        "singular when level.",
    ),
)
