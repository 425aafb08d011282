"""Newton's method on states with rotations."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tiltsim.linear.coordinates import Coordinates
from tiltsim.linear.differences import HALF_STENCIL, Derivative, Stencil, jacobian, steps_at
from tiltsim_controllers.mathematics.scalar import Floats

ITERATIONS: Final = 30
HALVINGS: Final = 12
GOOD: Final = 0.1  # a step that shrinks the value to this share needs no new derivative
NEAR: Final = 1e-5  # steps of the differences; so near the derivative is the same
NEUTRAL: Final = 1e-9
"""Directions in which the function changes less than this share of the largest are left alone."""


OfEach = Callable[[list[Floats]], Iterable[Floats]]
"""A function of several states, each on its own: their values in turn."""


class Root(NamedTuple):
    """A state, the value there, and the function's derivative by coordinates, with its corners."""

    state: Floats
    value: Floats
    derivative: Floats
    corners: NDArray[np.bool_]

    @property
    def residual(self) -> float:
        """The largest entry of the value."""
        return float(np.abs(self.value).max())


def derivative_at(
    function: Callable[[Floats], Floats],
    coordinates: Coordinates,
    state: Floats,
    stencil: Stencil = HALF_STENCIL,
) -> Floats:
    """Derivative of a function of the state by its coordinates.

    Args:
        function: Function of a state.
        coordinates: Coordinates of the state.
        state: State at which the derivative is taken.
        stencil: Stencil of the differences.
    """
    return _derivative_of_each(
        lambda states: [function(each) for each in states], coordinates, state, stencil
    ).matrix


def _derivative_of_each(
    function: OfEach, coordinates: Coordinates, state: Floats, stencil: Stencil
) -> Derivative:
    """`derivative_at` for a function of several states."""
    steps = coordinate_steps(coordinates, state)
    return jacobian(
        lambda moved: function([coordinates.moved(state, by) for by in moved]), steps, stencil
    )


def _is_near(coordinates: Coordinates, start: Floats, end: Floats) -> bool:
    """Whether the derivatives at two states are the same."""
    moved = coordinates.between(start, end) / coordinate_steps(coordinates, start)
    return bool(np.abs(moved).max() <= NEAR)


def coordinate_steps(coordinates: Coordinates, state: Floats) -> Floats:
    """Steps of the differences; a turn is of order one whatever the attitude."""
    values = state
    if coordinates.rotation:
        first, after = coordinates.first, coordinates.first + coordinates.rotation
        values = np.concatenate((state[:first], np.zeros(3), state[after:]))
    return steps_at(values)


def solve(
    function: OfEach,
    coordinates: Coordinates,
    state: Floats,
    tolerance: float,
    stencil: Stencil = HALF_STENCIL,
) -> Root:
    """A state near another at which a function of it vanishes, or nearly so.

    Steps have the least norm, so that states along which nothing changes stay as they are, and are
    halved until the value shrinks. Ends where it is below the tolerance or shrinks no more. The
    derivative is only updated where that pays off.

    Args:
        function: Maps several states to their values, one by one: one value per coordinate, NaN
            where it is not defined.
        coordinates: Coordinates of the state.
        state: Where to begin.
        tolerance: Bound of the largest entry of the value.
        stencil: Stencil of the differences.
    """

    def derivative_here() -> Derivative:
        return _derivative_of_each(function, coordinates, state, stencil)

    (value,), derived_at = function([state]), state
    derivative, renew = derivative_here(), False
    for _ in range(ITERATIONS):
        if np.abs(value).max() <= tolerance:
            break
        if renew:
            derived_at, derivative = state, derivative_here()
        if not np.isfinite(derivative.matrix).all():
            break
        scale = coordinate_steps(coordinates, state)
        step = scale * np.linalg.lstsq(derivative.matrix * scale, -value, rcond=NEUTRAL)[0]
        for _ in range(HALVINGS):
            moved = coordinates.moved(state, step)
            (its_value,) = function([moved])
            if np.linalg.norm(its_value) < np.linalg.norm(value):
                break
            step = 0.5 * step
        else:
            if renew or _is_near(coordinates, derived_at, state):
                break
            renew = True
            continue
        renew = bool(np.linalg.norm(its_value) > GOOD * np.linalg.norm(value))
        state, value = moved, its_value
    if not _is_near(coordinates, derived_at, state):
        derivative = derivative_here()
    return Root(state, value, *derivative)
