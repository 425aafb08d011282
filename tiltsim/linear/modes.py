"""Modes of a linear system: eigenvalues with the states that take part in them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from tiltsim.linear.coordinates import parted
from tiltsim_controllers.mathematics.scalar import Floats

EQUAL: Final = 1e-4
"""Poles within this share of their size belong to one mode: rounding splits a multiple pole by the
root of its error."""

NEUTRAL: Final = 1e-6  # rad/s
"""Poles below this are zero."""

SHARE: Final = 0.1  # states with less than this share of the largest part in a mode are not listed

WORDS: Final = {
    **dict.fromkeys(("x", "vx", "integral_x"), "x"),
    **dict.fromkeys(("y", "vy", "integral_y"), "y"),
    **dict.fromkeys(("z", "vz", "integral_z"), "altitude"),
    **dict.fromkeys(("rotation_x", "roll", "p"), "roll"),
    **dict.fromkeys(("rotation_y", "pitch", "q"), "pitch"),
    **dict.fromkeys(("rotation_z", "yaw", "r"), "yaw"),
}
"""Names of modes by their states."""

KINDS: Final = {
    "alpha": "tilt servos",
    "rotor": "rotors",
    "speed": "rotors",
    "tilt": "actuators",
    "state": "controller",
    "estimation": "estimator",
    "instruments": "instruments",
}
"""Names of modes by the kind of their states."""


@dataclass(frozen=True)
class Mode:
    """A pole, or a pair or group of equal ones."""

    name: str  # by the states that take the largest part
    frequency: float  # magnitude of the pole, rad/s
    damping: float  # ratio, 1 for a stable real pole, negative where it grows
    states: tuple[str, ...]  # names, the largest part first
    count: int  # number of poles, a pair counted as two

    @property
    def growth_rate(self) -> float:
        """The real part of the pole, 1/s; negative where the mode decays."""
        return -self.damping * self.frequency

    def report(self) -> dict[str, Any]:
        """Entries of the JSON report."""
        return {**vars(self), "states": list(self.states)}


def spectrum(matrix: Floats, error: float) -> tuple[Any, Any, Any]:
    """Eigenvalues, right and left eigenvectors of a matrix known to an error.

    An error of the matrix splits a multiple eigenvalue with too few eigenvectors by its root, but
    hardly moves the mean of the parts: where the split is no larger than the error explains, each
    part is replaced by the mean. Others keep their values, as all do for an error of 0; it is a
    share of the largest entry of a row.
    """
    values, vectors = np.linalg.eig(matrix)
    values, left = values.astype(complex), np.linalg.pinv(vectors)
    of_rows = error * np.abs(matrix).max(axis=1)
    # To first order; summed over a row, and for a pair from both sides.
    unsure = 4.0 * (np.abs(left) @ of_rows) * np.abs(vectors).sum(axis=0)
    apart, sizes = np.abs(values[:, None] - values), np.abs(values)
    near = EQUAL * np.minimum(sizes[:, None], sizes)
    together = apart <= np.minimum(unsure[:, None] + unsure, near)
    for _ in range(len(values)):  # chains as well
        together = together @ together
    return (together @ values) / together.sum(axis=1), vectors, left


def exponents(eigenvalues: Floats, timestep: float | None) -> Floats:
    """The poles (rad/s) of a system's eigenvalues.

    In discrete time they are ``log(eigenvalue) / timestep``, minus infinity for states that are
    forgotten at once.
    """
    if timestep is None:
        return eigenvalues
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.log(eigenvalues.astype(complex)) / timestep)


def is_stable(matrix: Floats, poles: Floats, timestep: float | None) -> bool:
    """Whether small disturbances die out, but for states that stay where they are put.

    All poles have a negative real part or are zero; each pole at zero has an eigenvector, so that
    the states along it do not grow. An undamped swing is not stable: it never dies out.
    """
    neutral = np.abs(poles) <= NEUTRAL
    if (poles.real[~neutral] >= -NEUTRAL).any():
        return False
    count = int(neutral.sum())
    if count == 0:
        return True
    moving = matrix if timestep is None else (matrix - np.eye(len(matrix))) / timestep
    singular_values = np.linalg.svd(moving, compute_uv=False)
    return int((singular_values <= NEUTRAL * max(1.0, singular_values[0])).sum()) >= count


def modes_of(
    matrix: Floats,
    names: Sequence[str],
    timestep: float | None,
    error: float = 0.0,
    prefixes: Sequence[str] = (),
) -> tuple[Mode, ...]:
    """The modes of a system, sorted from fastest growth to fastest decay.

    Args:
        matrix: The system matrix, shape (n, n).
        names: Names of its states.
        timestep: s; None in continuous time.
        error: See `spectrum`.
        prefixes: Beginnings of the names of companions' and objects' states.
    """
    eigenvalues, vectors, left = spectrum(matrix, error)
    poles = exponents(eigenvalues, timestep)
    left_over = [
        int(i)
        for i in np.argsort(-poles.real, kind="stable")
        if poles[i].imag >= 0.0 and np.isfinite(poles[i])
    ]
    found = []
    while left_over:
        pole = poles[left_over[0]]
        near = EQUAL * max(abs(pole), NEUTRAL / EQUAL)
        group = [i for i in left_over if abs(poles[i] - pole) <= near]
        left_over = [i for i in left_over if i not in group]
        part = np.abs(np.einsum("ik,ki->i", vectors[:, group], left[group]))
        # The logarithm of a negative real eigenvalue is complex, yet it has no partner.
        count = sum(2 if eigenvalues[i].imag > 0.0 else 1 for i in group)
        found.append(_mode(pole, part, names, count, prefixes))
    return tuple(found)


def labeled(prefix: str, word: str) -> str:
    """A word for a motion of the vehicle or object whose names begin with a prefix."""
    return f"{prefix[:-1]} {word}" if prefix else word


def _mode(
    pole: complex, part: Floats, names: Sequence[str], count: int, prefixes: Sequence[str]
) -> Mode:
    share = np.round(part / part.max(), 6)  # equal ones keep their order
    order = [int(i) for i in np.argsort(-share, kind="stable") if share[i] >= SHARE]
    states = tuple(names[i] for i in order)
    words = [
        (prefix, WORDS.get(name) or KINDS.get(name.partition("_")[0], name))
        for prefix, name in (parted(state, prefixes) for state in states)
    ]
    # Rotors take part in all motions that they make: they name a mode only where they are alone.
    moving = [each for each in dict.fromkeys(words) if each[1] not in KINDS.values()]
    name = ", ".join(labeled(*each) for each in moving[:3] or words[:1])
    frequency = float(abs(pole))
    if frequency <= NEUTRAL:
        return Mode(name, 0.0, 0.0, states, count)
    return Mode(name, frequency, float(-pole.real / frequency), states, count)
