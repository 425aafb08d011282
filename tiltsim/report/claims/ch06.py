"""Chapter 6: four-dimensional gait surfaces and the Two Color Map."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from math import pi
from typing import Final

import numpy as np

from tiltsim.report.claim import AnalysisClaim
from tiltsim.report.claims.ch03 import EQ_17, EQ_19
from tiltsim.report.measures import EVERY_TERM, terms, terms_hold
from tiltsim.report.statement import read_statements
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


THESIS: Final = read_statements("ch06", every_term=EVERY_TERM)

CLAIMS = (
    AnalysisClaim(
        THESIS["ch6-eq-1"],
        partial(terms_hold, "R_phi", EQ_1_ROLL, _VEHICLE),
        refuted="-2.880 s1 c2 s3 s4 sin φ cos θ should be s1 c2 c3 s4, as in Eq. (4).",
    ),
    *(
        AnalysisClaim(statement, partial(terms_hold, part, printed, _VEHICLE))
        for statement, part, printed in (
            (THESIS["ch6-eq-2"], "R", EQ_19),
            (THESIS["ch6-eq-4"], "R_phi", EQ_4),
            (THESIS["ch6-eq-5"], "R_theta", EQ_17.R_theta),
            (THESIS["ch6-eq-6"], "R", EQ_19),
        )
    ),
    AnalysisClaim(THESIS["ch6-roots"], _counts, published=("2", "3", "5")),
    AnalysisClaim(THESIS["ch6-planes"], _on_two_planes),
    AnalysisClaim(THESIS["ch6-classes"], lambda: float(len(root_classes(_grid()))), published="7"),
    AnalysisClaim(
        THESIS["ch6-no-mixed"],
        lambda: bool(_classes(lambda root: True) & {"(+,-)", "(-,+)"}),
        published=False,
    ),
    AnalysisClaim(
        THESIS["ch6-positive-classes"],
        lambda: not any("-" in name for name in _classes(lambda root: root.R > _ZERO)),
    ),
    AnalysisClaim(
        THESIS["ch6-one-positive"],
        lambda: sum(root.R > _ZERO for root in _inside()) == len(_positive_points()),
    ),
    AnalysisClaim(
        THESIS["ch6-triangle"],
        _triangle_is_the_published,
        refuted="They reach (-7, -7) and (7, 7), and include the untilted vehicle, whose R is 4.",
    ),
    AnalysisClaim(
        THESIS["ch6-negative-classes"],
        lambda: len(_classes(lambda root: root.R < -_ZERO)) == 7,
        refuted="Blue roots, those with a minus, have R = 0 exactly; with the printed coefficients "
        "the sign of R there is rounding.",
    ),
    AnalysisClaim(
        THESIS["ch6-two-usable"],
        lambda: any(
            sum(root.R < -_ZERO for root in cell) == 2
            for row in _grid()[1:-1]
            for cell in row[1:-1]
        ),
        refuted="Only red ones are usable: " + RANK,
    ),
    AnalysisClaim(THESIS["ch6-top-triangle"], _upper_triangle_is_blue_only),
    AnalysisClaim(
        THESIS["ch6-equal-pairs"],
        lambda: all(
            abs(root.alpha_3 - root.alpha_1) + abs(root.alpha_4 - root.alpha_2) < _ZERO
            for root in _inside()
            if (root.plane_3, root.plane_4) == ("+", "+")
        ),
    ),
    *(
        AnalysisClaim(THESIS["ch6-theorem-1"], partial(_one_color_is_accepted, color), case=color)
        for color in ("red", "blue")
    ),
)
