"""Derivatives of functions of a vector by central differences.

A stencil of sixth order leaves of its step of 5e-3 a relative error of some 1e-16, and rounding one
of 1e-12 to 1e-10: on every plant and with every layer, derivatives about as good as exact ones.
That holds where the function is smooth within the stencil. A limit or a dead zone within it shows
in the highest differences, which a smooth function hardly has: there the steps are shortened until
the corner lies outside, or else it is reported.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tiltsim_controllers.mathematics.scalar import Floats

STEP: Final = 5e-3
"""For coordinates of order one; larger ones are moved by this share of them."""


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

ERROR: Final = 2e-11
"""Error of `HALF_STENCIL` as a share of the largest entry of a row, against symbolic
derivatives."""

AVERAGED: Final = HALF_STENCIL._replace(smooth=0.1)
"""For flights over a period: an event within it that passes from one time step to the next is a
small corner, which the stencil averages out."""

CENTRAL: Final = Stencil((0.02,), (25.0,), (0.0,), (1.0,), AVERAGED.smooth)
"""Central differences, a third of the evaluations, for long flights: second order at a step of
1e-4."""

SHORTER: Final = (1.0, 0.1, 0.01, 1e-3, 1e-4)
"""Shares of a step that are tried until the function is smooth within it."""

BETTER: Final = 0.2
"""Shorter steps count where they leave this share of the highest differences, else are rounding."""

QUIET: Final = 1e-10  # SI units; smaller values may be rounding

CORNER: Final = 1e-3
"""Larger shares of the highest differences, at every step, are a corner at the point itself."""


class Derivative(NamedTuple):
    """The derivative of a function of a vector at a point.

    Attributes:
        matrix: Shape (values, entries).
        corners: Whether a value has a corner along an entry there, so that its derivative is the
            mean of both sides; the same shape.
    """

    matrix: Floats
    corners: NDArray[np.bool_]


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
