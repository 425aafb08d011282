"""Vectors, and linear equations with fewer equations than unknowns, for traced functions."""

from typing import Any, Final

import numpy as np

from tiltsim_controllers.code.arrays import xp

RANK_TOLERANCE: Final = 1e-24
"""Squared share of a row that the earlier rows leave, below which it depends on them: rounding
leaves about 1e-32, a flying vehicle 1e-11 or more."""


def cross(a: Any, b: Any) -> Any:
    """The vector product ``a x b``, shape (3,)."""
    return xp.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def norm(vector: Any) -> Any:
    """The length of a vector of any shape (N,)."""
    return xp.sqrt(vector @ vector)


def rejection(vector: Any, unit: Any) -> Any:
    """A vector without its component along a unit vector, both of shape (N,)."""
    return vector - (unit @ vector) * unit


def unit_remainder(row: Any, units: Any) -> Any:
    """The part of a row orthogonal to unit rows, scaled to length 1; NaN for rounding."""
    rest = row
    for unit in units:
        rest = rejection(rest, unit)
    square = rest @ rest
    independent = square > RANK_TOLERANCE * (row @ row)
    return xp.where(independent, 1.0 / xp.sqrt(xp.where(independent, square, 1.0)), xp.nan) * rest


def _is_plain(*arrays: Any) -> bool:
    """Whether arrays hold floats, for which NumPy's own functions are faster."""
    return all(type(array) is np.ndarray and array.dtype == float for array in arrays)


def determinant(matrix: Any) -> Any:
    """The determinant of a small square matrix, by expansion along its rows.

    A trace finds equal minors and omits the entries that it knows to be zero.
    """
    if _is_plain(matrix):
        return np.linalg.det(matrix)
    return _minor(matrix, tuple(range(len(matrix))), {})


def kernel(matrix: Any) -> Any:
    """The vector across the rows of a matrix (M - 1, M), as long as the volume that they span."""
    columns = np.arange(matrix.shape[1])
    if _is_plain(matrix):
        others = [np.delete(columns, j) for j in columns]
        return (-1.0) ** columns * np.linalg.det(matrix[:, others].swapaxes(0, 1))
    return _across(matrix, tuple(columns.tolist()), {})


_Minors = dict[tuple[int, ...], Any]


def _minor(matrix: Any, columns: tuple[int, ...], known: _Minors) -> Any:
    """The determinant of these columns of the last rows, by expansion along the first of them."""
    if not columns:
        return 1.0
    if columns not in known:
        row = matrix[len(matrix) - len(columns)][np.array(columns)]
        known[columns] = row @ _across(matrix, columns, known)
    return known[columns]


def _across(matrix: Any, columns: tuple[int, ...], known: _Minors) -> Any:
    """The kernel of these columns of the last rows, one fewer."""
    others = (columns[:j] + columns[j + 1 :] for j in range(len(columns)))
    minors = [_minor(matrix, kept, known) for kept in others]
    return xp.array([(-1.0) ** j * minor for j, minor in enumerate(minors)])


def solved(matrix: Any, desired: Any) -> Any:
    """The ``x`` with ``matrix x = desired``, shapes (M, M) and (M,); NaN where it is singular.

    A trace has Cramer's rule.
    """
    if _is_plain(matrix, desired):
        try:
            return np.linalg.solve(matrix, desired)
        except np.linalg.LinAlgError:
            return np.full(len(desired), np.nan)
    rows = np.arange(len(matrix))
    cofactors = xp.array([(-1.0) ** int(i) * kernel(matrix[np.delete(rows, i)]) for i in rows])
    volume = matrix[0] @ cofactors[0]
    return desired @ cofactors / xp.where(volume == 0.0, xp.nan, volume)


def orthonormal_rows(matrix: Any) -> list[Any]:
    """Orthonormal rows (N,) with the span of the M <= N rows of a matrix (modified Gram-Schmidt).

    Normal equations would square the condition number. The first k span the first k rows of the
    matrix; NaN from the first dependent row on.
    """
    units: list[Any] = []
    for row in matrix:
        units.append(unit_remainder(row, units))
    return units


def nearest_solution(matrix: Any, desired: Any, start: Any, units: Any = None) -> Any:
    """The solution ``x`` of ``matrix x = desired`` that is nearest to a start.

    It moves from the start along each unit row until the equation of that row holds, and so stays
    in the span of the rows.

    Args:
        matrix: Shape (M, N), M <= N.
        desired: Shape (M,).
        start: Shape (N,).
        units: `orthonormal_rows` of the matrix, where they are known.
    """
    x = start
    for row, unit, value in zip(matrix, units or orthonormal_rows(matrix), desired):
        x = x + (value - row @ x) / (row @ unit) * unit
    return x


def least_norm(matrix: Any, desired: Any) -> Any:
    """The shortest ``x`` with ``matrix x = desired``, shapes (M, N), M <= N, and (M,).

    A second pass removes rounding errors. NaN where the rows depend on each other.
    """
    units = orthonormal_rows(matrix)
    first = nearest_solution(matrix, desired, xp.zeros(matrix.shape[1]), units)
    return nearest_solution(matrix, desired, first, units)


def solved_symmetric(matrix: Any, desired: Any) -> Any:
    """The ``x`` with ``matrix x = desired`` of a positive definite matrix (M, M), by ``L D L^T``.

    Its lower triangle is read.
    """
    size = len(desired)
    lower: list[list[Any]] = [[None] * size for _ in range(size)]
    pivots: list[Any] = []
    x: list[Any] = []
    for i in range(size):
        scaled: list[Any] = []  # entries of the row times the pivots
        for j in range(i):
            scaled.append(matrix[i, j] - sum(scaled[k] * lower[j][k] for k in range(j)))
            lower[i][j] = scaled[j] / pivots[j]
        pivots.append(matrix[i, i] - sum(s * e for s, e in zip(scaled, lower[i])))
        x.append(desired[i] - sum(lower[i][k] * x[k] for k in range(i)))
    for i in reversed(range(size)):
        x[i] = x[i] / pivots[i] - sum(lower[k][i] * x[k] for k in range(i + 1, size))
    return xp.array(x)
