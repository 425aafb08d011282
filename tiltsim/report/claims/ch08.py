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
from tiltsim.report.statement import read_statements
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


THESIS: Final = read_statements(
    "ch08", digits=DIGITS.format("1.000 / 2.880"), little=_LITTLE, abundant=_ABUNDANT
)

CLAIMS = (
    AnalysisClaim(THESIS["ch8-eq-7"], _eq_7_holds),
    AnalysisClaim(THESIS["ch8-l-divides"], _divides_in_two),
    *exact_and_printed(THESIS["ch8-p"], _P[0], 0.5 * atan(1.000 / 2.880), "0.167099"),
    AnalysisClaim(
        THESIS["ch8-p-below"],
        lambda: region(*_P, _VEHICLE) == "S_D",
        refuted="P lies on L exactly: tan(-δ) = tan δ - 2r with r = tan δ. The printed P is below "
        "it by its rounding alone.",
    ),
    *exact_and_printed(THESIS["ch8-offset"], 2.0 * _P[0], atan(1.000 / 2.880), "0.334198"),
    *(
        AnalysisClaim(
            THESIS["ch8-coefficients-vanish"],
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
        AnalysisClaim(
            THESIS["ch8-examples"], partial(_accepted, name), case=name, published=name != "E4"
        )
        for name in PATHS
    ),
    *(
        AnalysisClaim(THESIS["ch8-p-continuous"], partial(_colors_meet, p, offset), case=case)
        for case, p, offset in (
            ("in closed form", _P[0], 2.0 * delta(_VEHICLE)),
            ("with the printed digits", 0.5 * PRINTED_OFFSET, PRINTED_OFFSET),
        )
    ),
    AnalysisClaim(THESIS["ch8-p-only"], _colors_meet_nowhere_else),
    *(
        AnalysisClaim(THESIS["ch8-ignored-gaits"], partial(_needs_the_generalized, name), case=name)
        for name in _GAITS
    ),
    *(
        AnalysisClaim(
            THESIS["ch8-never-zero"],
            partial(_regular, name),
            case=name if name == "Gait 2" else name + _EXACT,
            refuted={"Gait 1": _AT_P + RANK, "Gait 3": RANK}.get(name, ""),
            finding="red" if name == "Gait 2" else "blue",
        )
        for name in _GAITS
    ),
    *(
        AnalysisClaim(
            THESIS["ch8-never-zero"],
            partial(_regular_as_printed, name),
            case=name + _PRINTED,
            note=_ROUNDED,
        )
        for name in ("Gait 1", "Gait 3")
    ),
    AnalysisClaim(
        THESIS["ch8-more-robust"],
        partial(beats_its_biased_twin, "ch08_gait_1"),
        case="Gait 1" + _EXACT,
        where="ch. 8, Sec. 4.1, Fig. 10",
        refuted=_AT_P + RANK,
        finding="blue",
    ),
    AnalysisClaim(
        THESIS["ch8-more-robust"],
        lambda: margins_as_printed("ch08_gait_1")[0] > margins_as_printed("ch08_gait_1")[1],
        case="Gait 1" + _PRINTED,
        where="ch. 8, Sec. 4.1, Fig. 10",
        note=_ROUNDED,
    ),
    AnalysisClaim(
        THESIS["ch8-more-robust"],
        partial(beats_its_biased_twin, "ch08_gait_2"),
        case="Gait 2",
        where="ch. 8, Sec. 4.2, Fig. 12",
        finding="red",
    ),
    AnalysisClaim(
        THESIS["ch8-gait-2-all-attitudes"],
        lambda: robustness(PUBLISHED_GAITS["ch08_gait_2"]).margin > 0.5 * pi - 1e-9,
    ),
    AnalysisClaim(THESIS["ch8-biased-1-little"], lambda: _biased_margin("Gait 1") < _LITTLE),
    AnalysisClaim(THESIS["ch8-biased-2-abundant"], lambda: _biased_margin("Gait 2") > _ABUNDANT),
    AnalysisClaim(
        THESIS["ch8-gait-3-enough"],
        lambda: robustness(PUBLISHED_GAITS["ch08_gait_3"]).margin_exact > _LITTLE,
        case="Gait 3" + _EXACT,
        refuted=RANK,
        finding="blue",
    ),
    AnalysisClaim(
        THESIS["ch8-gait-3-enough"],
        lambda: margins_as_printed("ch08_gait_3")[0] > _LITTLE,
        case="Gait 3, with the printed offset",
        note=_ROUNDED,
    ),
    AnalysisClaim(
        THESIS["ch8-gait-3-enough"],
        lambda: _biased_margin("Gait 3") > _LITTLE,
        case="biased Gait 3",
        why="On our circle R of the biased gait changes its sign: some of its attitudes are "
        "singular when level.",
    ),
)
