"""Jets: a quantity with its first and second time derivative, carried through arithmetic.

A quantity that depends on time through several steps (tilt angles, torque-free force, attitude)
gets its derivatives by the chain rule. Jets apply the rule step by step, exact to rounding and
without finite differences. A jet is a triple ``(value, first, second)``.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

from tiltsim_controllers.mathematics.scalar import scalar

Jet = tuple[float, float, float]
Jets3 = tuple[Jet, Jet, Jet]
Jets4 = tuple[Jet, Jet, Jet, Jet]


@scalar
def jet_sum(a: float, x: Jet, b: float, y: Jet) -> Jet:
    """The linear combination ``a x + b y``.

    Args:
        a, b: constant factors
        x, y: the jets
    """
    return a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2]


@scalar
def jet_scaled(a: float, x: Jet) -> Jet:
    """The product ``a x`` with constant ``a``."""
    return a * x[0], a * x[1], a * x[2]


@scalar
def jet_product(x: Jet, y: Jet) -> Jet:
    """The product ``x y``."""
    return (x[0] * y[0], x[1] * y[0] + x[0] * y[1], x[2] * y[0] + 2.0 * x[1] * y[1] + x[0] * y[2])


@scalar
def jet_quotient(x: Jet, y: Jet) -> Jet:
    """The quotient ``x / y``."""
    value = x[0] / y[0]
    first = (x[1] - value * y[1]) / y[0]
    return value, first, (x[2] - 2.0 * first * y[1] - value * y[2]) / y[0]


@scalar
def jet_square_root(x: Jet) -> Jet:
    """The square root of a positive ``x``."""
    value = sqrt(x[0])
    first = 0.5 * x[1] / value
    return value, first, (0.5 * x[2] - first * first) / value


@scalar
def jet_sine(x: Jet) -> Jet:
    """The sine of ``x`` in rad."""
    s, c = sin(x[0]), cos(x[0])
    return s, c * x[1], c * x[2] - s * x[1] * x[1]


@scalar
def jet_cosine(x: Jet) -> Jet:
    """The cosine of ``x`` in rad."""
    s, c = sin(x[0]), cos(x[0])
    return c, -s * x[1], -s * x[2] - c * x[1] * x[1]


@scalar
def jet_angle(y: Jet, x: Jet) -> Jet:
    """The angle ``atan2(y, x)`` in rad, of a non-zero vector."""
    square = x[0] * x[0] + y[0] * y[0]
    first = (x[0] * y[1] - y[0] * x[1]) / square
    growth = x[0] * x[1] + y[0] * y[1]
    second = (x[0] * y[2] - y[0] * x[2] - 2.0 * first * growth) / square
    return atan2(y[0], x[0]), first, second
