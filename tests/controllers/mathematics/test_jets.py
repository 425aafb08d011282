"""Jets against sympy's derivatives."""

from __future__ import annotations

import pytest
import sympy

from tiltsim_controllers.mathematics.jets import jet_product, jet_sum

T = sympy.symbols("t")
X = 1 + T / 2 - T**2 / 3 + T**3
Y = sympy.Rational(-7, 10) + T / 5 + 2 * T**2


def jet(expression):
    """An expression in ``t`` with its derivatives at zero, as floats."""
    return tuple(float(sympy.diff(expression, T, order).subs(T, 0)) for order in range(3))


CASES = {
    "sum": (lambda x, y: jet_sum(0.3, x, -2.0, y), sympy.Rational(3, 10) * X - 2 * Y),
    "product": (jet_product, X * Y),
}


@pytest.mark.parametrize("case", CASES)
def test_derivatives_are_sympys(case):
    function, expression = CASES[case]
    assert function(jet(X), jet(Y)) == pytest.approx(jet(expression), rel=1e-14, abs=1e-14)
