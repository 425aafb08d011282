"""Quantities with their first two time derivatives, carried through arithmetic by the chain rule.

A quantity that depends on time through several steps (tilt angles, torque-free force, attitude)
gets its derivatives step by step, exact to rounding and without finite differences. `sine`,
`cosine`, `square_root`, `angle` and `where` also take plain numbers, so that a formula is written
once for values alone and for values with derivatives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.linear import cross as plain_cross


@dataclass(frozen=True, slots=True)
class Moving:
    """A number, vector or matrix that moves."""

    value: Any  # at this time
    rate: Any  # its time derivative
    acceleration: Any  # the second one

    __array_ufunc__ = None  # arrays leave operators to this class

    def __getitem__(self, key: Any) -> Moving:
        return Moving(self.value[key], self.rate[key], self.acceleration[key])

    def __neg__(self) -> Moving:
        return Moving(-self.value, -self.rate, -self.acceleration)

    def __add__(self, other: Any) -> Moving:
        if not isinstance(other, Moving):
            return Moving(self.value + other, self.rate, self.acceleration)
        return Moving(
            self.value + other.value, self.rate + other.rate, self.acceleration + other.acceleration
        )

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self + -other

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        return product(lambda x, y: x * y, self, other)

    __rmul__ = __mul__

    def __matmul__(self, other: Any) -> Any:
        return product(lambda x, y: x @ y, self, other)

    def __rmatmul__(self, other: Any) -> Any:
        return product(lambda x, y: x @ y, other, self)

    def __truediv__(self, other: Any) -> Any:
        if not isinstance(other, Moving):
            return self * (1.0 / other)
        value = self.value / other.value
        rate = (self.rate - value * other.rate) / other.value
        second = self.acceleration - 2.0 * rate * other.rate - value * other.acceleration
        return Moving(value, rate, second / other.value)

    def __rtruediv__(self, other: Any) -> Any:
        return at_rest(other) / self


def product(multiply: Callable[[Any, Any], Any], x: Any, y: Any) -> Any:
    """Any product of two quantities, one of which moves; ``multiply`` is linear in both."""
    if not isinstance(x, Moving):
        return Moving(*(multiply(x, part) for part in (y.value, y.rate, y.acceleration)))
    if not isinstance(y, Moving):
        return Moving(*(multiply(part, y) for part in (x.value, x.rate, x.acceleration)))
    return Moving(
        multiply(x.value, y.value),
        multiply(x.rate, y.value) + multiply(x.value, y.rate),
        multiply(x.acceleration, y.value)
        + 2.0 * multiply(x.rate, y.rate)
        + multiply(x.value, y.acceleration),
    )


def at_rest(value: Any) -> Moving:
    """A quantity that does not move; its derivatives fit every shape."""
    return Moving(value, 0.0, 0.0)


def value_of(x: Any) -> Any:
    """The value of a quantity, with or without derivatives."""
    return x.value if isinstance(x, Moving) else x


def stacked(*parts: Any) -> Moving:
    """Quantities as the entries of one array."""
    moving = [part if isinstance(part, Moving) else at_rest(part) for part in parts]
    return Moving(
        xp.array([part.value for part in moving]),
        xp.array([part.rate for part in moving]),
        xp.array([part.acceleration for part in moving]),
    )


def where(condition: Any, yes: Any, no: Any) -> Any:
    """One of two quantities by a condition."""
    if not (isinstance(yes, Moving) or isinstance(no, Moving)):
        return xp.where(condition, yes, no)
    pair = [side if isinstance(side, Moving) else at_rest(side) for side in (yes, no)]
    first, second = ((side.value, side.rate, side.acceleration) for side in pair)
    return Moving(*(xp.where(condition, a, b) for a, b in zip(first, second, strict=True)))


def cross(x: Any, y: Any) -> Any:
    """The vector product of moving vectors, shape (3,)."""
    return product(plain_cross, x, y)


def _outer(x: Any, value: Any, first: Any, second: Any) -> Any:
    """A function of a quantity, by its value and its first two derivatives at that value."""
    if not isinstance(x, Moving):
        return value
    return Moving(value, first * x.rate, first * x.acceleration + second * x.rate * x.rate)


def sine(x: Any) -> Any:
    """The sine of an angle, rad."""
    s = xp.sin(value_of(x))
    return _outer(x, s, xp.cos(value_of(x)), -s)


def cosine(x: Any) -> Any:
    """The cosine of an angle, rad."""
    c = xp.cos(value_of(x))
    return _outer(x, c, -xp.sin(value_of(x)), -c)


def square_root(x: Any) -> Any:
    """The square root of a positive number."""
    root = xp.sqrt(value_of(x))
    if not isinstance(x, Moving):
        return root
    rate = 0.5 * x.rate / root
    return Moving(root, rate, (0.5 * x.acceleration - rate * rate) / root)


def angle(y: Any, x: Any) -> Any:
    """The angle ``atan2(y, x)``, rad, of a vector that is not zero."""
    value = xp.arctan2(value_of(y), value_of(x))
    if not (isinstance(y, Moving) or isinstance(x, Moving)):
        return value
    y, x = (part if isinstance(part, Moving) else at_rest(part) for part in (y, x))
    square = x.value * x.value + y.value * y.value
    rate = (x.value * y.rate - y.value * x.rate) / square
    growth = x.value * x.rate + y.value * y.rate
    second = x.value * y.acceleration - y.value * x.acceleration - 2.0 * rate * growth
    return Moving(value, rate, second / square)
