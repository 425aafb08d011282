"""Chapter 6: four-dimensional gait surfaces and the Two Color Map."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from math import pi
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim
from tiltsim.report.claims.ch03 import EQ_17, EQ_19
from tiltsim.report.draft import draft
from tiltsim.report.measures import robustness_claim, terms, terms_hold
from tiltsim_controllers.analysis.published_gaits import (
    PUBLISHED_GAITS,
    Robustness,
    robustness,
    smallest_margin,
)
from tiltsim_controllers.analysis.singularity import residuals
from tiltsim_controllers.analysis.two_color_map import (
    Root,
    delta,
    grid_roots,
    root_classes,
    root_counts,
)
from tiltsim_controllers.analysis.two_color_planner import check_path, rectangle
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]
_ZERO: Final = 1e-9
_NEAR_RIGHT_ANGLE: Final = 1.55
"""rad: with such a margin the singular attitudes are within 0.02 rad of a right angle."""

EQ_4: Final = terms(
    "1.000 ccsc - 1.000 sccc - 1.000 csss + 1.000 sscs + 2.880 ccss + 2.880 cssc "
    "- 2.880 sccs - 2.880 sscc"
)
"""R_phi as printed, term by term."""

EQ_1_ROLL: Final = terms(
    "1.000 ccsc - 1.000 sccc - 1.000 csss + 1.000 sscs + 2.880 ccss + 2.880 cssc "
    "- 2.880 scss - 2.880 sscc"
)
"""The terms of Eq. (1) with sin(roll), with their misprint."""

RANK: Final = (
    "On blue the opposite columns of τ cancel: rank 2, the matrix is singular at every attitude. "
    "The printed angles have a margin only because of their rounding; the smallest singular value "
    "of τ is 1e-4 of the largest."
)


@cache
def _grid() -> list[list[list[Root]]]:
    return grid_roots(_VEHICLE)


def _counts() -> tuple[float, ...]:
    """Roots inside, on the sides, in the corners; NaN where they differ."""
    counts = root_counts(_grid())
    sides = [counts[0, 1:-1], counts[-1, 1:-1], counts[1:-1, 0], counts[1:-1, -1]]
    groups = [counts[1:-1, 1:-1], np.concatenate(sides), counts[[0, 0, -1, -1], [0, -1, 0, -1]]]
    return tuple(float(group.flat[0]) if np.ptp(group) == 0 else np.nan for group in groups)


def _inside() -> list[Root]:
    return [root for row in _grid()[1:-1] for cell in row[1:-1] for root in cell]


def _classes(chosen: Callable[[Root], bool]) -> set[str]:
    return {f"({root.plane_3},{root.plane_4})" for root in _inside() if chosen(root)}


def _on_two_planes() -> bool:
    """Whether every α₃ is α₁ or 2δ - α₁ and every α₄ is α₂ or -2δ - α₂, modulo π."""
    offset = 2.0 * delta(_VEHICLE)

    def off(angle: float, *planes: float) -> float:
        return min(abs((angle - plane + pi / 2) % pi - pi / 2) for plane in planes)

    return all(
        off(root.alpha_3, root.alpha_1, offset - root.alpha_1) < _ZERO
        and off(root.alpha_4, root.alpha_2, -offset - root.alpha_2) < _ZERO
        for root in _inside()
    )


def _positive_points() -> set[tuple[int, int]]:
    """Grid points, in units of π/16 from the middle, that have a root with R > 0."""
    return {
        (round(root.alpha_1 * 16 / pi), round(root.alpha_2 * 16 / pi))
        for root in _inside()
        if root.R > _ZERO
    }


def _triangle_is_the_published() -> bool:
    """The triangle (-7, 7), (-7, -5), (5, 7): points with α₂ at least α₁ + 2π/16."""
    published = {(i, j) for i in range(-7, 8) for j in range(-7, 8) if j >= i + 2}
    return _positive_points() == published


def _signs(key: str) -> float:
    """1, -1, or 0 where R is zero or changes sign over the gait on the exact lines."""
    published = PUBLISHED_GAITS[key]
    gait = published.exact or published.gait
    R = residuals(gait.angles(gait.sample_times(401)), _VEHICLE).R
    if np.abs(R).min() < _ZERO:
        return 0.0
    return float(np.sign(R[0])) if np.ptp(np.sign(R)) == 0.0 else 0.0


def _robustness(key: str) -> Robustness:
    return robustness(PUBLISHED_GAITS[key])


def _nearly_all(key: str) -> bool:
    return _robustness(key).margin > _NEAR_RIGHT_ANGLE


def _greater_advantage_over_99() -> bool:
    """Whether the margin of printed Gait 2 exceeds that of the 99 % gait by more than the 80 %."""
    gait = PUBLISHED_GAITS["ch06_gait_2"].gait
    own, near, far = (smallest_margin(gait.biased(eta), _VEHICLE) for eta in (1.0, 0.99, 0.8))
    return own > near and own - near > own - far


def _red_beats_blue() -> bool:
    margins = {key: _robustness(key).margin_exact for key in ("ch06_gait_2", "ch06_gait_3")}
    return margins["ch06_gait_3"] > margins["ch06_gait_2"]


def _partial_scaling_can_harm() -> bool:
    return any(
        (row := _robustness(key)).margin_biased is not None and row.margin_biased < row.margin
        for key in ("ch06_gait_3", "ch06_gait_4")
    )


def _angles_on_lines(key: str) -> bool:
    """Whether the printed angles lie on the lines of their color, to half their last digit."""
    published = PUBLISHED_GAITS[key]
    first, second, third, fourth = published.gait.angles(np.arange(4) / 4.0).T
    if published.color == "blue":
        offset = 2.0 * delta(_VEHICLE)
        first, second = offset - first, -offset - second
    return bool(np.abs(np.stack([third - first, fourth - second])).max() < 0.0005)


def _one_color_is_accepted(color: str) -> bool:
    return check_path(rectangle((0.2, 0.8), (-0.8, -0.2), color), _VEHICLE).accepted


_GAITS: Final = {f"ch06_gait_{i}": f"Gait {i}" for i in (1, 2, 3, 4)}
_FIGURES: Final = dict(zip(_GAITS, (21, 23, 25, 27), strict=True))
_SIGN: Final = dict(zip(_GAITS, (-1.0, -1.0, -1.0, 1.0), strict=True))
_BLUE: Final = ("ch06_gait_1", "ch06_gait_2")

CLAIMS = (
    AnalysisClaim(
        draft(
            "ch. 6, Sec. 2, Eq. (1)", "Eq. (1), term by term, is the determinant at any attitude"
        ),
        partial(terms_hold, "R_phi", EQ_1_ROLL, _VEHICLE),
        case="terms with sin φ",
        refuted="-2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4, as in Eq. (4).",
    ),
    *(
        AnalysisClaim(
            draft(f"ch. 6, Sec. {section}", f"{name} is printed correctly, term by term"),
            partial(terms_hold, part, printed, _VEHICLE),
        )
        for section, name, part, printed in (
            ("2, Eq. (2)", "R at level attitude", "R", EQ_19),
            ("3, Eq. (4)", "R_φ", "R_phi", EQ_4),
            ("3, Eq. (5)", "R_θ", "R_theta", EQ_17.R_theta),
            ("3, Eq. (6)", "R", "R", EQ_19),
        )
    ),
    AnalysisClaim(
        draft(
            "ch. 6, Sec. 3, Fig. 4",
            "Roots (α₃, α₄) for a grid point inside, on a side, in a corner",
        ),
        _counts,
        published=("2", "3", "5"),
    ),
    AnalysisClaim(
        draft("ch. 6, Sec. 3, Figs. 5-10", "α₃ lies on two planes, and so does α₄"), _on_two_planes
    ),
    AnalysisClaim(
        draft("ch. 6, Sec. 3", "Classes of roots by their planes"),
        lambda: float(len(root_classes(_grid()))),
        published="7",
    ),
    AnalysisClaim(
        draft("ch. 6, Sec. 3", "Some root mixes the planes: (+,-) or (-,+)"),
        lambda: bool(_classes(lambda root: True) & {"(+,-)", "(-,+)"}),
        published=False,
    ),
    AnalysisClaim(
        draft(
            "ch. 6, Sec. 3, Figs. 11-14",
            "Roots with R > 0 are of the classes (+,+), (+,?) and (?,+) only",
        ),
        lambda: _classes(lambda root: root.R > _ZERO) <= {"(+,+)", "(+,?)", "(?,+)"},
        why="Where both pairs of planes meet within half a grid step there are also (?,?): "
        "three grid points next to P.",
    ),
    AnalysisClaim(
        draft("ch. 6, Sec. 3, Figs. 11-14", "At most one root with R > 0"),
        lambda: sum(root.R > _ZERO for root in _inside()) == len(_positive_points()),
    ),
    AnalysisClaim(
        draft(
            "ch. 6, Sec. 3",
            "The points with R > 0 fill the triangle (-7, 7), (-7, -5), (5, 7) in π/16",
        ),
        _triangle_is_the_published,
        refuted="They reach (-7, -7) and (7, 7), and include the untilted vehicle, whose R is 4.",
    ),
    AnalysisClaim(
        draft("ch. 6, Sec. 3, Figs. 15-16", "Roots with R < 0 cover all seven classes"),
        lambda: len(_classes(lambda root: root.R < -_ZERO)) == 7,
        refuted="Blue roots, those with a minus, have R = 0 exactly; with the printed coefficients "
        "the sign of R there is rounding.",
    ),
    AnalysisClaim(
        draft(
            "ch. 6, Sec. 3",
            "For an (α₁, α₂) with R < 0 there may be two usable roots, red and blue",
        ),
        lambda: any(
            sum(root.R < -_ZERO for root in cell) == 2
            for row in _grid()[1:-1]
            for cell in row[1:-1]
        ),
        refuted="Only red ones are usable: " + RANK,
    ),
    AnalysisClaim(
        draft("ch. 6, Sec. 6", "On (+,+) α₁ = α₃ and α₂ = α₄"),
        lambda: all(
            abs(root.alpha_3 - root.alpha_1) + abs(root.alpha_4 - root.alpha_2) < _ZERO
            for root in _inside()
            if (root.plane_3, root.plane_4) == ("+", "+")
        ),
    ),
    *(
        AnalysisClaim(
            draft("ch. 6, Sec. 4, Theorem 1", "A closed path in one color gives a continuous gait"),
            partial(_one_color_is_accepted, color),
            case=color,
        )
        for color in ("red", "blue")
    ),
    *(
        AnalysisClaim(
            draft("ch. 6, Sec. 5", "The printed angles lie on the surface"),
            partial(_angles_on_lines, key),
            case=name,
        )
        for key, name in _GAITS.items()
    ),
    *(
        AnalysisClaim(
            draft("ch. 6, Sec. 5", "Sign of R along the whole gait, on the exact lines"),
            partial(_signs, key),
            case=name,
            published=_SIGN[key],
            refuted=RANK + " R is 0." if key in _BLUE else "",
        )
        for key, name in _GAITS.items()
    ),
    *(
        robustness_claim(
            f"ch. 6, Sec. 5, Fig. {_FIGURES[key]}", key, name, RANK if key in _BLUE else ""
        )
        for key, name in _GAITS.items()
    ),
    *(
        AnalysisClaim(
            draft(
                f"ch. 6, Sec. 5, Fig. {_FIGURES[key]}",
                "Nearly all attitudes within 90 degrees are admissible",
            ),
            partial(_nearly_all, key),
            case=_GAITS[key],
        )
        for key in ("ch06_gait_3", "ch06_gait_4")
    ),
    AnalysisClaim(
        draft(
            "ch. 6, Sec. 6, Figs. 23, 28",
            "Gait 2, as printed, has a greater advantage over the gait with a bias of 99 % "
            "than over that of 80 %",
        ),
        _greater_advantage_over_99,
        why="By the margin the printed Gait 2 has none over either: 0.7251 rad compared with "
        "0.7285 and 0.7851. The diagrams compare rounding.",
    ),
    AnalysisClaim(
        draft("ch. 6, Sec. 6", "Gaits on (+,+) have more acceptable attitudes than those on (-,-)"),
        _red_beats_blue,
    ),
    AnalysisClaim(
        draft("ch. 6, Sec. 6", "Scaling only α₃ and α₄ may make a gait less robust"),
        _partial_scaling_can_harm,
    ),
)
