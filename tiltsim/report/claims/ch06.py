"""Chapter 6: four-dimensional gait surfaces and the Two Color Map."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from math import pi
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim
from tiltsim.report.claims.ch03 import EQ_17, EQ_19
from tiltsim.report.measures import terms, terms_hold
from tiltsim.report.statement import Statement
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


def _upper_triangle_is_blue_only() -> bool:
    """Whether no point with a red root of R > 0 has another red root, so only (-,-) is left."""
    for row in _grid()[1:-1]:
        for cell in row[1:-1]:
            classes = {f"({root.plane_3},{root.plane_4})" for root in cell if root.R <= _ZERO}
            positive = any(root.R > _ZERO for root in cell)
            if positive and not classes <= {"(-,-)", "(-,?)", "(?,-)", "(?,?)"}:
                return False
    return True


def _one_color_is_accepted(color: str) -> bool:
    return check_path(rectangle((0.2, 0.8), (-0.8, -0.2), color), _VEHICLE).accepted


_EVERY_TERM: Final = (
    "Every product of sines and cosines has the printed coefficient, to 0.001, and none is missing"
)


def _printed(part: str, source: str, text: str, thesis: str) -> Statement:
    return Statement(
        id=f"ch6-{part}", source=source, text=text, thesis=thesis, criterion=_EVERY_TERM
    )


EQ_1 = Statement(
    id="ch6-eq-1",
    source="ch. 6, Sec. 2, Eq. (1)",
    text="Eq. (1), term by term, is the determinant at any attitude",
    thesis="“… the necessary condition [22] to receive an invertible decoupling matrix in our "
    "tilt-rotor is given by” Eq. (1).",
    criterion=_EVERY_TERM,
    finding="slips",
)
PARTS: Final = (
    (
        _printed(
            "eq-2",
            "ch. 6, Sec. 2, Eq. (2)",
            "R at level attitude is printed correctly, term by term",
            "“… substituting φ = 0 and θ = 0 into Formula (1) yields” Eq. (2).",
        ),
        "R",
        EQ_19,
    ),
    (
        _printed(
            "eq-4",
            "ch. 6, Sec. 3, Eq. (4)",
            "R_φ is printed correctly, term by term",
            "Eq. (4), the coefficient of φ in Formula (3).",
        ),
        "R_phi",
        EQ_4,
    ),
    (
        _printed(
            "eq-5",
            "ch. 6, Sec. 3, Eq. (5)",
            "R_θ is printed correctly, term by term",
            "Eq. (5), the coefficient of θ in Formula (3).",
        ),
        "R_theta",
        EQ_17.R_theta,
    ),
    (
        _printed(
            "eq-6",
            "ch. 6, Sec. 3, Eq. (6)",
            "R is printed correctly, term by term",
            "Eq. (6), the part of Formula (3) without φ and θ.",
        ),
        "R",
        EQ_19,
    ),
)
COUNTS = Statement(
    id="ch6-roots",
    source="ch. 6, Sec. 3, Fig. 4",
    text="Roots (α₃, α₄) for a grid point inside, on a side, in a corner",
    thesis="“… the number of roots of (α₃, α₄) is 2 in the middle”; “Each corner … returns 5 "
    "roots”; “the rest (α₁, α₂) on the side returns 3 roots”.",
    criterion="The closed form gives these numbers at every one of the 17 x 17 grid points",
    finding="map",
    pictures=("map",),
)
PLANES = Statement(
    id="ch6-planes",
    source="ch. 6, Sec. 3, Figs. 5-10",
    text="α₃ lies on two planes, and so does α₄",
    thesis="“Figure 9 shows that both α₃ lie on the two planes”; “Figure 10 shows that both α₄ "
    "also lie on another two planes.”",
    criterion="Every root inside the grid has α₃ = α₁ or 2δ - α₁, and α₄ = α₂ or -2δ - α₂, to 1e-9",
    finding="map",
    pictures=("map",),
)
CLASSES = Statement(
    id="ch6-classes",
    source="ch. 6, Sec. 3",
    text="Classes of roots by their planes",
    thesis="“… there are only 7 categories of the roots of (α₃, α₄).”",
    criterion="Seven classes occur, if planes closer than half a grid step count as intersecting "
    "(“?”)",
)
NO_MIXED = Statement(
    id="ch6-no-mixed",
    source="ch. 6, Sec. 3",
    text="Some root mixes the planes: (+,-) or (-,+)",
    thesis="“Note that no roots of (α₃, α₄) belong to (+,-) or (-,+).”",
    criterion="Neither class occurs inside the grid",
)
POSITIVE_CLASSES = Statement(
    id="ch6-positive-classes",
    source="ch. 6, Sec. 3, Figs. 11-14",
    text="Roots with R > 0 lie on no minus plane: (+,+), (+,?) and (?,+)",
    thesis="“Note that both roots of (α₃, α₄) receiving positive R … belong to (+,+), (+,?), and "
    "(?,+) types.”",
    criterion="No root with R > 0 has a minus plane",
    note="Three grid points next to P, where both pairs of planes meet within half a grid step, "
    "are (?,?) by the reading of “?” with which ch6-classes finds the seven categories.",
)
ONE_POSITIVE = Statement(
    id="ch6-one-positive",
    source="ch. 6, Sec. 3, Figs. 11-14",
    text="At most one root with R > 0",
    thesis="“… there is only one root of (α₃, α₄) meeting R > 0 for each (α₁, α₂) in the "
    "triangular area.”",
    criterion="No grid point has two roots with R > 0",
)
TRIANGLE_OF_R = Statement(
    id="ch6-triangle",
    source="ch. 6, Sec. 3",
    text="The points with R > 0 fill the triangle (-7, 7), (-7, -5), (5, 7) in π/16",
    thesis="“This triangular area is governed by three vertices: (-7π/16, 7π/16), (-7π/16, "
    "-5π/16), (5π/16, 7π/16).”",
    criterion="The grid points with a root of R > 0 are exactly those of the printed triangle",
    finding="triangle",
    pictures=("map",),
)
NEGATIVE_CLASSES = Statement(
    id="ch6-negative-classes",
    source="ch. 6, Sec. 3, Figs. 15-16",
    text="Roots with R < 0 cover all seven classes",
    thesis="“Both roots of (α₃, α₄) receiving negative R …, Figures 15 and 16, covers all seven "
    "types.”",
    criterion="All seven classes occur among the roots with R < -1e-9",
    finding="blue",
)
TWO_USABLE = Statement(
    id="ch6-two-usable",
    source="ch. 6, Sec. 3",
    text="For an (α₁, α₂) with R < 0 there may be two usable roots, red and blue",
    thesis="“… the number of the roots of (α₃, α₄) receiving negative R … is 1 or 2.”",
    criterion="Some grid point has two roots with R < -1e-9",
    finding="blue",
)
TOP_TRIANGLE = Statement(
    id="ch6-top-triangle",
    source="ch. 6, Sec. 4, Fig. 18",
    text="In the triangular region on the top only (-,-) has no positive R",
    thesis="“While (α₁, α₂) in the triangular region on the top, receive one applicable (α₃, α₄) "
    "only, the type of which is (-,-).”",
    criterion="Where one root has R > 0, the other lies on no plus plane",
    note="That it is applicable is refuted with the other statements on blue (ch6-two-usable).",
)
EQUAL_PAIRS = Statement(
    id="ch6-equal-pairs",
    source="ch. 6, Sec. 6",
    text="On (+,+) α₁ = α₃ and α₂ = α₄",
    thesis="“The tilting angles on the (+,+) surface satisfy α₁ = α₃, α₂ = α₄.”",
    criterion="To 1e-9 for every root of this class",
)
CONTINUOUS = Statement(
    id="ch6-theorem-1",
    source="ch. 6, Sec. 4, Theorem 1",
    text="A closed path in one color gives a continuous gait",
    thesis="“The planned gait is continuous if … The adjacent (α₁, α₂) are in the same color or "
    "do not violate the rule in Figure 17.”",
    criterion="The planner accepts a rectangle in this color as continuous",
)

CLAIMS = (
    AnalysisClaim(
        EQ_1,
        partial(terms_hold, "R_phi", EQ_1_ROLL, _VEHICLE),
        refuted="-2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4, as in Eq. (4).",
    ),
    *(
        AnalysisClaim(statement, partial(terms_hold, part, printed, _VEHICLE))
        for statement, part, printed in PARTS
    ),
    AnalysisClaim(COUNTS, _counts, published=("2", "3", "5")),
    AnalysisClaim(PLANES, _on_two_planes),
    AnalysisClaim(CLASSES, lambda: float(len(root_classes(_grid()))), published="7"),
    AnalysisClaim(
        NO_MIXED, lambda: bool(_classes(lambda root: True) & {"(+,-)", "(-,+)"}), published=False
    ),
    AnalysisClaim(
        POSITIVE_CLASSES,
        lambda: not any("-" in name for name in _classes(lambda root: root.R > _ZERO)),
    ),
    AnalysisClaim(
        ONE_POSITIVE, lambda: sum(root.R > _ZERO for root in _inside()) == len(_positive_points())
    ),
    AnalysisClaim(
        TRIANGLE_OF_R,
        _triangle_is_the_published,
        refuted="They reach (-7, -7) and (7, 7), and include the untilted vehicle, whose R is 4.",
    ),
    AnalysisClaim(
        NEGATIVE_CLASSES,
        lambda: len(_classes(lambda root: root.R < -_ZERO)) == 7,
        refuted="Blue roots, those with a minus, have R = 0 exactly; with the printed coefficients "
        "the sign of R there is rounding.",
    ),
    AnalysisClaim(
        TWO_USABLE,
        lambda: any(
            sum(root.R < -_ZERO for root in cell) == 2
            for row in _grid()[1:-1]
            for cell in row[1:-1]
        ),
        refuted="Only red ones are usable: " + RANK,
    ),
    AnalysisClaim(TOP_TRIANGLE, _upper_triangle_is_blue_only),
    AnalysisClaim(
        EQUAL_PAIRS,
        lambda: all(
            abs(root.alpha_3 - root.alpha_1) + abs(root.alpha_4 - root.alpha_2) < _ZERO
            for root in _inside()
            if (root.plane_3, root.plane_4) == ("+", "+")
        ),
    ),
    *(
        AnalysisClaim(CONTINUOUS, partial(_one_color_is_accepted, color), case=color)
        for color in ("red", "blue")
    ),
)
