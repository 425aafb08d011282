"""Parameters of the gaits, as a flight knows them.

Every gait is a piecewise polynomial or a harmonic motion of each tilt angle; its numbers are the
first of a flight's ``knots``.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Final, NamedTuple

NO_KNOTS: Final = (0.0,)
"""The knots of a flight without tilt angles."""

FIXED: Final = 0.0
LINEAR: Final = 1.0
CUBIC: Final = 2.0
HARMONIC: Final = 3.0

POWERS: Final = {FIXED: 1, LINEAR: 2, CUBIC: 4}
"""Coefficients of a polynomial, by the type of the gait: highest power first."""


class GaitParameters(NamedTuple):
    """Parameters of a gait.

    The knots of a piecewise polynomial are rows: the time (s) at which a piece begins, from 0 on,
    then the coefficients of each tilt angle (rad, s). The knots of a harmonic gait are ``mean``,
    ``cosine`` and ``sine`` (rad) of each tilt angle.
    """

    type: float
    period: float = 1.0  # s; of a gait that does not repeat, its last time
    scale: float = 1.0  # factor of all angles (ch. 5, Eq. 16: 1/n)
    bias: float = 1.0  # [eta] factor of alpha_3 and alpha_4 (ch. 6, Eqs. 12-15)
    keyframes: float = 1.0  # number of pieces
    repeats: float = 1.0  # 1 or 0: whether the gait starts over after its period


def check_phases(phases: Sequence[float]) -> None:
    """Raise `ValueError` for phases that make no gait through keyframes, in order."""
    if len(phases) < 2 or phases[0] != 0.0 or phases[-1] != 1.0:
        raise ValueError(f"keyframe phases {phases}: must start at 0 and end at 1")
    if any(later < earlier for earlier, later in itertools.pairwise(phases)):
        raise ValueError(f"keyframe phases {phases}: must not decrease")
    if phases[1] == 0.0 or phases[-2] == 1.0:
        raise ValueError(f"keyframe phases {phases}: only one row may be at 0 and one at 1")
    if any(third == first for first, third in zip(phases, phases[2:], strict=False)):
        raise ValueError(f"keyframe phases {phases}: at most two rows may share a phase")
