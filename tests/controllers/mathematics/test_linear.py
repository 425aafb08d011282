"""Linear equations of traced functions against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from tiltsim_controllers.mathematics.linear import determinant, kernel, solved, solved_symmetric

SIZES = (1, 2, 3, 4)


@pytest.mark.parametrize("size", SIZES)
def test_square_equations_are_solved(size):
    random = np.random.default_rng(size)
    for _ in range(10):
        matrix, desired = random.normal(size=(size, size)), random.normal(size=size)
        assert determinant(matrix) == pytest.approx(np.linalg.det(matrix), rel=1e-12)
        expected = np.linalg.solve(matrix, desired)
        np.testing.assert_allclose(solved(matrix, desired), expected, rtol=1e-10)


@pytest.mark.parametrize("size", SIZES[1:])
def test_the_kernel_is_across_the_rows_and_as_long_as_their_volume(size):
    rows = np.random.default_rng(size).normal(size=(size - 1, size))
    found = kernel(rows)
    np.testing.assert_allclose(rows @ found, 0.0, atol=1e-14)
    assert np.linalg.norm(found) == pytest.approx(np.sqrt(np.linalg.det(rows @ rows.T)), rel=1e-12)
    assert np.linalg.det(np.vstack([found, rows])) > 0.0


def test_a_singular_matrix_has_no_solution():
    assert np.isnan(solved(np.array([[1.0, 2.0], [2.0, 4.0]]), np.ones(2))).all()


@pytest.mark.parametrize("size", [1, 3, 6])
def test_symmetric_equations_are_solved(size):
    random = np.random.default_rng(size)
    rows, desired = random.normal(size=(size, size + 2)), random.normal(size=size)
    found = solved_symmetric(np.tril(rows @ rows.T), desired)
    np.testing.assert_allclose(found, np.linalg.solve(rows @ rows.T, desired), rtol=1e-9)
