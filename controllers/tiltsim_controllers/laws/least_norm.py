"""The shortest solution of a few linear equations, by orthogonal factors of their rows.

The rows are made orthonormal one after the other (modified Gram-Schmidt); the solution moves along
each until its equation holds. It stays in their span, which makes it the solution nearest to where
it began. Normal equations would square the condition number.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import nan, sqrt
from typing import Final, NamedTuple

from tiltsim_controllers.mathematics.scalar import Values, scalar
from tiltsim_controllers.mathematics.vectors import vectors_of, written_out

RANK_TOLERANCE: Final = 1e-24
"""Squared share of a row that earlier rows leave it, below which it depends on them: rounding
leaves about 1e-32, a flying vehicle 1e-11 or more."""


@scalar
def inverse_length(rest: float, whole: float) -> float:
    """One over the length of what is left of a row, from its square and that of the whole row.

    NaN where next to nothing is left.
    """
    return 1.0 / sqrt(rest) if rest > RANK_TOLERANCE * whole else nan


class Orthogonal(NamedTuple):
    """Scalar functions of rows of one length."""

    rejected: Callable[..., Values]  # (row, unit): without its share along a unit row
    unit: Callable[..., Values]  # (rest, whole): what is left of a row, of length 1, or NaN
    orthonormal: Callable[..., tuple[Values, Values, Values]]  # (a, b, c): unit rows of their span
    remainder: Callable[..., Values]  # (row, units): without its share in three unit rows


@cache
def orthogonal_of(length: int) -> Orthogonal:
    """The functions for rows of a length."""
    dot, scaled, add_scaled = vectors_of(length)[:3]

    @scalar
    def rejected(row: Values, unit: Values) -> Values:
        return add_scaled(row, -dot(unit, row), unit)

    @scalar
    def unit_row(rest: Values, whole: Values) -> Values:
        return scaled(inverse_length(dot(rest, rest), dot(whole, whole)), rest)

    @scalar
    def orthonormal(a: Values, b: Values, c: Values) -> tuple[Values, Values, Values]:
        first = unit_row(a, a)
        second = unit_row(rejected(b, first), b)
        third = unit_row(rejected(rejected(c, first), second), c)
        return first, second, third

    @scalar
    def remainder(row: Values, units: tuple[Values, Values, Values]) -> Values:
        return rejected(rejected(rejected(row, units[0]), units[1]), units[2])

    return Orthogonal(rejected, unit_row, orthonormal, remainder)


@cache
def nearest_of(length: int, equations: int) -> Callable[..., Values]:
    """The solution nearest to a start, of a number of equations in as many unknowns as ``length``.

    A scalar function ``(start, rows, units, desired)``; ``units`` are orthonormal, the first few
    spanning as many of the rows.
    """
    dot, _, add_scaled = vectors_of(length)[:3]

    @scalar
    def reached(x: Values, row: Values, unit: Values, desired: float) -> Values:
        return add_scaled(x, (desired - dot(row, x)) / dot(row, unit), unit)

    text = "start"
    for k in range(equations):
        text = f"reached({text}, rows[{k}], units[{k}], desired[{k}])"
    name = f"nearest_{length}_{equations}"
    nearest: Callable[..., Values] = written_out(
        name, "start, rows, units, desired", text, reached=reached
    )
    return nearest
