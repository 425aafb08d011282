"""Newton's method on states with rotations, and derivatives by central differences.

A stencil of sixth order leaves of its step of 5e-3 a relative error of some 1e-16, and rounding one
of 1e-12 to 1e-10: on every plant and with every layer, derivatives about as good as exact ones.
That holds where the function is smooth within the stencil. A limit or a dead zone within it shows
in the highest differences, which a smooth function hardly has: there the steps are shortened until
the corner lies outside, or else it is reported.
"""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tiltsim.linear.coordinates import Coordinates
from tiltsim_controllers.mathematics.scalar import Floats

STEP: Final = 5e-3  # for coordinates of order one; larger ones are moved by this share of them

ERROR: Final = 2e-11
"""Error of `HALF_STENCIL` as a share of the largest entry of a row, against symbolic
derivatives."""
SHORTER: Final = (1.0, 0.1, 0.01, 1e-3, 1e-4)
"""Shares of a step that are tried until the function is smooth within it."""
BETTER: Final = 0.2
"""Shorter steps count where they leave this share of the highest differences, else are rounding."""
QUIET: Final = 1e-10  # SI units; smaller values may be rounding
CORNER: Final = 1e-3
"""Larger shares of the highest differences, at every step, are a corner at the point itself."""
ITERATIONS: Final = 30
HALVINGS: Final = 12
GOOD: Final = 0.1  # a step that shrinks the value to this share needs no new derivative
NEAR: Final = 1e-5  # steps of the differences; so near the derivative is the same
NEUTRAL: Final = 1e-9
"""Directions in which the function changes less than this share of the largest are left alone."""


class Stencil(NamedTuple):
    """Where a function is evaluated, and weights of its differences and sums from side to side."""

    offsets: tuple[float, ...]  # in steps, either way
    weights: tuple[float, ...]  # of differences: the derivative
    odd: tuple[float, ...]  # of differences, and of sums: these vanish for smooth functions
    even: tuple[float, ...]
    smooth: float  # they vanish up to this share of the largest change by a step


HALF_STENCIL: Final = Stencil(
    (1.0, 2.0, 3.0), (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0), (5.0, -4.0, 1.0), (15.0, -6.0, 1.0), 1e-6
)
"""Sixth order; its fifth and sixth differences vanish."""


AVERAGED: Final = HALF_STENCIL._replace(smooth=0.1)
"""For flights over a period: an event within it that passes from one time step to the next is a
small corner, which the stencil averages out."""

CENTRAL: Final = Stencil((0.02,), (25.0,), (0.0,), (1.0,), AVERAGED.smooth)
"""Central differences, a third of the evaluations, for long flights: second order at a step of
1e-4."""


class Derivative(NamedTuple):
    """The derivative of a function of a vector at a point."""

    matrix: Floats  # shape (values, entries)
    corners: NDArray[np.bool_]
    """Whether a value has a corner along an entry there, so that its derivative is the mean of
    both sides; the same shape."""


def steps_at(values: Floats) -> Floats:
    """Steps of the differences for coordinates near these values."""
    return np.asarray(STEP * np.maximum(1.0, np.abs(values)))


def jacobian(
    function: Callable[[list[Floats]], Iterable[Floats]],
    steps: Floats,
    stencil: Stencil = HALF_STENCIL,
) -> Derivative:
    """Derivative at zero of a function of a vector.

    Args:
        function: Maps several vectors, each as long as ``steps``, to their values, one by one.
        steps: Step of each entry, shape (entries,).
        stencil: `HALF_STENCIL`, `AVERAGED` or `CENTRAL`.
    """
    offsets = [sign * offset for offset in stencil.offsets for sign in (1.0, -1.0)]
    matrix = roughness = reach = np.zeros(0)
    left = np.arange(len(steps))
    for share in SHORTER:
        moved = [share * at * row for row in np.diag(steps)[left] for at in offsets]
        here, *values = function([np.zeros(len(steps)), *moved])
        sides = np.reshape(values, (len(left), len(stencil.offsets), 2, len(here)))
        differences, sums = sides[:, :, 0] - sides[:, :, 1], sides.sum(axis=2) - 2.0 * here
        if share == 1.0:
            reach = np.fmax.reduce(np.abs(differences[:, 0]), initial=QUIET)[:, None]
            matrix = np.full((len(here), len(steps)), np.nan)
            roughness = np.full(matrix.shape, np.inf)
        slopes = _weighted(stencil.weights, differences) / (share * steps[left])
        odd, even = _weighted(stencil.odd, differences), _weighted(stencil.even, sums)
        rough = np.maximum(0.0, np.maximum(np.abs(odd), np.abs(even)) - QUIET) / (share * reach)
        better = rough < BETTER * roughness[:, left]  # not where it is NaN
        matrix[:, left] = np.where(better, slopes, matrix[:, left])
        roughness[:, left] = np.where(better, rough, roughness[:, left])
        left = left[~(rough.max(axis=0) <= stencil.smooth)]
        if not len(left):
            break
    return Derivative(matrix, roughness > max(CORNER, stencil.smooth))


def _weighted(weights: tuple[float, ...], of: Floats) -> Floats:
    """A sum over the offsets, values in rows and entries in columns."""
    return np.asarray(np.einsum("j,ijk->ki", weights, of))


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
    each = partial(map, function)
    return _derivative_of_each(each, coordinates, state, stencil).matrix


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
    values = coordinates.between(coordinates.level(state), state)
    turning = np.array(coordinates.turns, dtype=int)[:, None] + np.arange(3)
    values[turning] = 0.0
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
