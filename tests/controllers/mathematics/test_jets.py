"""Jets against sympy's derivatives."""

from __future__ import annotations

import pytest
import sympy

from tiltsim_controllers.mathematics.jets import (
    jet_angle,
    jet_cosine,
    jet_product,
    jet_quotient,
    jet_sine,
    jet_square_root,
    jet_sum,
)

T = sympy.symbols("t")
X = 1 + T / 2 - T**2 / 3 + T**3
Y = sympy.Rational(-7, 10) + T / 5 + 2 * T**2


def jet(expression):
    """An expression in ``t`` with its derivatives at zero, as floats."""
    return tuple(float(sympy.diff(expression, T, order).subs(T, 0)) for order in range(3))


CASES = {
    "sum": (lambda x, y: jet_sum(0.3, x, -2.0, y), sympy.Rational(3, 10) * X - 2 * Y),
    "product": (jet_product, X * Y),
    "quotient": (jet_quotient, X / Y),
    "square root": (lambda x, _: jet_square_root(x), sympy.sqrt(X)),
    "sine": (lambda _, y: jet_sine(y), sympy.sin(Y)),
    "cosine": (lambda _, y: jet_cosine(y), sympy.cos(Y)),
    "angle": (lambda x, y: jet_angle(y, x), sympy.atan2(Y, X)),
    "angle past a right one": (lambda x, y: jet_angle(x, y), sympy.atan2(X, Y)),
    "a composition": (
        lambda x, y: jet_quotient(jet_sine(jet_product(x, y)), jet_square_root(x)),
        sympy.sin(X * Y) / sympy.sqrt(X),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_derivatives_are_sympys(case):
    function, expression = CASES[case]
    assert function(jet(X), jet(Y)) == pytest.approx(jet(expression), rel=1e-14, abs=1e-14)
