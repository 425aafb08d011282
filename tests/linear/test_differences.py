"""Derivatives by differences, where the function is smooth and where it is not."""

from __future__ import annotations

import numpy as np
import pytest

from tiltsim.linear.newton import CENTRAL, HALF_STENCIL, jacobian


def derivative(function, stencil=HALF_STENCIL):
    return jacobian(lambda each: map(function, each), np.full(2, 5e-3), stencil)


def test_a_smooth_function_is_evaluated_once_at_each_place():
    calls = []

    def function(at):
        calls.append(at)
        return np.array([np.sin(at[0]), np.exp(at[1]) + at[0]])

    found = derivative(function)
    assert found.matrix == pytest.approx(np.array([[1.0, 0.0], [1.0, 1.0]]), abs=1e-12)
    assert not found.corners.any()
    assert len(calls) == 1 + 2 * 6


@pytest.mark.parametrize("stencil", [HALF_STENCIL, CENTRAL])
@pytest.mark.parametrize("distance", [4e-3, 5e-4, 2e-5, 2e-6])
def test_no_step_passes_a_limit(distance, stencil):
    """A value that a limit holds, on either side of it, and one without."""

    def function(at):
        return np.array([min(at[0], distance), max(at[1], distance), at[0] + 2.0 * at[1]])

    found = derivative(function, stencil)
    assert found.matrix == pytest.approx(np.array([[1.0, 0.0], [0.0, 0.0], [1.0, 2.0]]), abs=1e-9)
    assert not found.corners.any()


@pytest.mark.parametrize("stencil", [HALF_STENCIL, CENTRAL])
def test_a_corner_at_the_point_is_reported_where_it_is(stencil):
    found = derivative(lambda at: np.array([at[0], max(at[1], 0.0) + at[0]]), stencil)
    assert found.corners.tolist() == [[False, False], [False, True]]
    assert found.matrix == pytest.approx(np.array([[1.0, 0.0], [1.0, 0.5]]))


def test_drag_at_rest_has_no_slope():
    """Derivative of ``v |v|``, whose second derivative jumps."""
    found = derivative(lambda at: np.array([at[0] * abs(at[0]) + at[1], at[1]]))
    assert abs(found.matrix[0, 0]) < 1e-5
    assert not found.corners.any()


def test_where_a_function_is_not_defined_steps_are_shorter():
    found = derivative(lambda at: np.array([np.log(4e-3 + at[0]) if at[0] > -4e-3 else np.nan]))
    assert found.matrix[0] == pytest.approx([250.0, 0.0], rel=1e-6)
