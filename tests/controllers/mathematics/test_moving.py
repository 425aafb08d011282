"""Quantities with derivatives against sympy's derivatives."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from tiltsim_controllers.mathematics.moving import (
    Moving,
    angle,
    cosine,
    cross,
    sine,
    square_root,
    stacked,
    where,
)

T = sympy.symbols("t")
X = 1 + T / 2 - T**2 / 3 + T**3
Y = sympy.Rational(-7, 10) + T / 5 + 2 * T**2


def moving(expression):
    """An expression in ``t`` with its derivatives at zero."""
    return Moving(*(float(sympy.diff(expression, T, k).subs(T, 0)) for k in range(3)))


CASES = {
    "sum": (lambda x, y: 0.3 * x + y * -2.0 + 1.0, sympy.Rational(3, 10) * X - 2 * Y + 1),
    "difference": (lambda x, y: 2.0 - x - (y - 3.0), 5 - X - Y),
    "product": (lambda x, y: x * y, X * Y),
    "quotient": (lambda x, y: x / y / 2.0, X / Y / 2),
    "reciprocal": (lambda x, _: 3.0 / x, 3 / X),
    "square root": (lambda x, _: square_root(x), sympy.sqrt(X)),
    "sine": (lambda _, y: sine(y), sympy.sin(Y)),
    "cosine": (lambda _, y: cosine(y), sympy.cos(Y)),
    "angle": (lambda x, y: angle(y, x), sympy.atan2(Y, X)),
    "angle past a right one": (lambda x, y: angle(x, y), sympy.atan2(X, Y)),
    "angle to a fixed side": (lambda x, _: angle(x, -2.0), sympy.atan2(X, -2)),
    "a composition": (lambda x, y: sine(x * y) / square_root(x), sympy.sin(X * Y) / sympy.sqrt(X)),
}


def parts(quantity):
    return [quantity.value, quantity.rate, quantity.acceleration]


@pytest.mark.parametrize("name", CASES)
def test_derivatives_are_exact(name):
    function, expression = CASES[name]
    found, expected = function(moving(X), moving(Y)), moving(expression)
    np.testing.assert_allclose(parts(found), parts(expected), rtol=1e-13)


@pytest.mark.parametrize("name", ["square root", "sine", "cosine", "angle"])
def test_the_functions_take_plain_numbers(name):
    function, expression = CASES[name]
    x, y = (float(e.subs(T, 0)) for e in (X, Y))
    assert function(x, y) == pytest.approx(float(expression.subs(T, 0)), rel=1e-14)


def test_vectors_and_matrices_move():
    x, y, turn = moving(X), moving(Y), np.array([[0.0, -1.0, 2.0], [1.0, 0.5, 0.0]])
    vector, fixed = stacked(x, y, 2.0), np.array([0.3, -0.2, 0.7])
    whole = sympy.Matrix([X, Y, 2])
    for found, expected in (
        (turn @ vector, sympy.Matrix(turn) * whole),
        (cross(vector, fixed), whole.cross(sympy.Matrix(fixed))),
        (fixed * vector, whole.multiply_elementwise(sympy.Matrix(fixed))),
    ):
        rows = [parts(moving(entry)) for entry in expected]
        np.testing.assert_allclose(np.transpose(parts(found)), rows, rtol=1e-13, atol=1e-15)
    square = parts(vector @ vector)
    np.testing.assert_allclose(square, parts(moving(whole.dot(whole))), rtol=1e-13)


def test_a_condition_takes_one_side_with_its_derivatives():
    x = moving(X)
    assert parts(where(x.value > 0.0, x, 2.0)) == parts(x)
    assert parts(where(x.value > 3.0, x, 2.0)) == [2.0, 0.0, 0.0]
