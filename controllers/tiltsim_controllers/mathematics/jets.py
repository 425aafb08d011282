"""Jets: a quantity with its first and second time derivative, carried through arithmetic.

A quantity that depends on time through several steps (tilt angles, torque-free force, attitude)
gets its derivatives by the chain rule. Jets apply the rule step by step, exact to rounding and
without finite differences. A jet is a triple ``(value, first, second)``.
"""

from __future__ import annotations

from tiltsim_controllers.mathematics.scalar import scalar

Jet = tuple[float, float, float]
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
