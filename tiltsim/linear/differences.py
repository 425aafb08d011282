"""Derivatives of functions of a vector by central differences of sixth order.

The functions are smooth code on doubles. A stencil of sixth order leaves of its step of 5e-3 a
relative error of some 1e-16, and rounding one of 1e-12 to 1e-10: on every plant and with every
layer, derivatives about as good as exact ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

import numpy as np

from tiltsim_controllers.mathematics.scalar import Floats

STEP: Final = 5e-3
"""For coordinates of order one; larger ones are moved by this share of them."""

HALF_STENCIL: Final = ((1.0, 3.0 / 4.0), (2.0, -3.0 / 20.0), (3.0, 1.0 / 60.0))
"""Offsets in steps, and weights; those on the other side are the negative ones."""

ERROR: Final = 2e-11
"""Of derivatives by it, as a share of the largest of their row; measured against symbolic ones."""

CENTRAL: Final = ((0.02, 25.0),)
"""The same with a third of the evaluations, for long flights: second order at a step of 1e-4."""

Stencil = tuple[tuple[float, float], ...]


def steps_at(values: Floats) -> Floats:
    """Steps of the differences for coordinates near these values."""
    return np.asarray(STEP * np.maximum(1.0, np.abs(values)))


def jacobian(
    function: Callable[[list[Floats]], Iterable[Floats]],
    steps: Floats,
    stencil: Stencil = HALF_STENCIL,
) -> Floats:
    """Derivative at zero of a function of a vector, shape (values, len(steps)).

    Args:
        function: Of several vectors as long as ``steps``, each on its own: their values in turn.
        steps: By which each entry is moved.
        stencil: `HALF_STENCIL` or `CENTRAL`.
    """
    moved = np.diag(steps)
    offsets = [sign * offset for offset, _ in stencil for sign in (1.0, -1.0)]
    values = iter(function([offset * row for row in moved for offset in offsets]))
    columns = []
    for step in steps.tolist():
        column: Floats = np.zeros(1)
        for _, weight in stencil:
            ahead, behind = next(values), next(values)
            column = column + weight / step * (ahead - behind)
        columns.append(column)
    return np.array(columns).T
