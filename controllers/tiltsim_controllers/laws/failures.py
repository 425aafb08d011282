"""Rotors that a controller knows to have failed: their columns leave its matrix."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf
from typing import Any, Final, NamedTuple

from tiltsim_controllers.mathematics.scalar import Values, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, vectors_of
from tiltsim_controllers.vehicle.effectiveness import Rows


class Failure(NamedTuple):
    """A failed rotor and when it is known: from then on the controller uses the others."""

    rotor: float = 0.0  # from 1, 0 for none
    known_from: float = inf  # s


UNHARMED: Final = Failure()
"""All rotors work, as far as is known."""


@cache
def health_of(length: int) -> Callable[..., Any]:
    """Scalar code ``(time, failure)``: 1 for a rotor that works as far as is known, else 0."""
    known = "time >= failure.known_from and failure.rotor == @ + 1.0"
    return componentwise("health", "time, failure", f"0.0 if {known} else 1.0", length)


@cache
def masked_of(length: int) -> Callable[..., Rows]:
    """Scalar code ``(works, rows)``: rows of F and tau without the columns of failed rotors."""
    product = vectors_of(length).product

    @scalar
    def masked(works: Values, rows: Rows) -> Rows:
        fx, fy, fz, tx, ty, tz = rows
        return (
            *(product(works, fx), product(works, fy), product(works, fz)),
            *(product(works, tx), product(works, ty), product(works, tz)),
        )

    return masked
