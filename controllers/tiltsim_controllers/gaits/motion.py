"""The planned tilt angles with rates and accelerations, at a time.

Every gait is a piecewise polynomial or a harmonic motion of each tilt angle; its numbers are the
first of a flight's ``knots``.
"""

import itertools
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.splines import piece_at, polynomial_derivatives

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


@traceable
def planned_tilts(time: Any, gait: GaitParameters, knots: Any, tilts: int) -> Any:
    """The tilt angles (rad) of a gait with their rates and accelerations.

    At a jump and at a corner the values after it hold, except that the first half of a trot's
    period includes its end, as printed in ch. 4.

    Args:
        time: s, shape (...).
        gait: Type and parameters.
        knots: Table data of a flight, which begins with the gait's.
        tilts: Number of tilt angles, M.

    Returns:
        Angles, rates (rad/s) and accelerations (rad/s^2), shape (M, 3, ...).
    """
    if not tilts:
        return xp.zeros((0, 3, *np.shape(time)))
    if gait.type == HARMONIC:
        turning = 2.0 * xp.pi / gait.period
        mean, cosine, sine = xp.array(knots[: 3 * tilts]).reshape(tilts, 3).T
        c, s = xp.cos(turning * time), xp.sin(turning * time)
        rows = [
            xp.array([mean[i] + cosine[i] * c + sine[i] * s, sine[i] * c - cosine[i] * s,
                      -cosine[i] * c - sine[i] * s])
            for i in range(tilts)
        ]  # fmt: skip
        factors = xp.array([1.0, turning, turning * turning])
        motion = xp.array([(factors * row.T).T for row in rows])
    else:
        powers, pieces = POWERS[gait.type], int(gait.keyframes)
        if gait.repeats and gait.type != FIXED:
            time = time - xp.floor(time / gait.period) * gait.period
        row = piece_at(time, pieces, 0, 1 + powers * tilts, knots)
        since = 0.0 * time if gait.type == FIXED else xp.maximum(time - row[0], 0.0)
        coefficients = row[1:].reshape(tilts, powers, *row.shape[1:]).swapaxes(0, 1)
        motion = polynomial_derivatives(since, coefficients, 2).swapaxes(0, 1)
    back = gait.scale * gait.bias if tilts == 4 else gait.scale
    return xp.array([(gait.scale if i < 2 else back) * motion[i] for i in range(tilts)])


@traceable
def anticipated_tilts(time: Any, gait: GaitParameters, knots: Any, tilts: int, half: float) -> Any:
    """The planned tilt angles with rounded corners, for the attitude.

    The rates of a piecewise linear gait jump at its corners, which the body cannot follow. The
    corner is known in advance, so the body starts to turn ``half`` before and ends ``half`` after
    it; the errors before and after cancel to first order. Smooth gaits and jumps, which have no
    rates, are unchanged.

    Args:
        time, gait, knots, tilts: See `planned_tilts`.
        half: Time before and after a corner, s.

    Returns:
        See `planned_tilts`.
    """
    if gait.type != LINEAR:
        return planned_tilts(time, gait, knots, tilts)
    before = planned_tilts(time - half, gait, knots, tilts)
    after = planned_tilts(time + half, gait, knots, tilts)
    return rounded_corner(before[:, 0], before[:, 1], after[:, 0], after[:, 1], half)


def rounded_corner(start: Any, start_rate: Any, stop: Any, stop_rate: Any, half: Any) -> Any:
    """Motion along two straight lines with a rounded corner, in the middle of a time window.

    The window contains at most one corner, where the lines meet. The second derivative is the
    kernel ``15/16 (1 - (x/half)^2)^2 / half`` of area one around the corner.

    Args:
        start, stop: Values at the ends of the window, shape (M,).
        start_rate, stop_rate: Rates at its ends, 1/s, shape (M,).
        half: Half the length of the window, s.

    Returns:
        Value, rate and acceleration, shape (M, 3).
    """
    middle = start + half * start_rate
    bend = stop_rate - start_rate
    turns = xp.where(bend == 0.0, 1.0, bend)
    since = xp.clip((stop - middle - half * start_rate) / turns - half, -half, half)
    u = since / xp.where(half > 0.0, half, 1.0)
    second = u * u
    fourth, left = second * second, 1.0 - second
    value = half * (0.5 * u + (15.0 * second - 5.0 * fourth + second * fourth + 5.0) / 32.0)
    rate = 0.5 + u * (15.0 - 10.0 * second + 3.0 * fourth) / 16.0
    acceleration = 0.9375 * (left * left) / xp.where(half > 0.0, half, 1.0)
    return xp.stack([middle + bend * value, start_rate + bend * rate, bend * acceleration], 1)
