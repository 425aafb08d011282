"""Rotors that a controller knows to have failed: their columns leave its matrix."""

from __future__ import annotations

from math import inf
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import xp


class Failure(NamedTuple):
    """A failed rotor and when it is known: from then on the controller uses the others."""

    rotor: float = 0.0  # from 1, 0 for none
    known_from: float = inf  # s


UNHARMED: Final = Failure()
"""All rotors work, as far as is known."""


def working(time: Any, failure: Failure, rotors: int) -> Any:
    """1 for a rotor that works as far as is known, 0 for one that failed, shape (rotors,).

    Args:
        time: s.
        failure: The failure that is known of.
        rotors: Number of rotors.
    """
    known = time >= failure.known_from
    return xp.array(
        [xp.where(known & (failure.rotor == i), 0.0, 1.0) for i in range(1, rotors + 1)]
    )
