"""Routh-Hurwitz stability of the linear error dynamics (ch. 4, Propositions 4 and 5)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tiltsim_controllers.laws.attitude_altitude import PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.gains import Gains, IntegralGains


class ErrorLoop(NamedTuple):
    """The linear error dynamics of one output."""

    name: str
    polynomial: tuple[float, ...]  # characteristic, monic, highest power first
    stable: bool
    condition: str  # the first Routh condition that fails, with its numbers; empty when stable


def routh_first_column(polynomial: Sequence[float]) -> list[float]:
    """First column of the Routh array of a polynomial, highest power first.

    All roots have negative real parts if and only if every entry is positive. The column ends at
    the first entry that is not positive.
    """
    upper = [float(value) for value in polynomial[0::2]]
    lower = [float(value) for value in polynomial[1::2]]
    column = [upper[0]]
    while lower:
        column.append(lower[0])
        if lower[0] <= 0.0:
            break
        padded = [*lower, 0.0]
        upper, lower = (
            lower,
            [upper[i + 1] - upper[0] * padded[i + 1] / lower[0] for i in range(len(upper) - 1)],
        )
    return column


def is_hurwitz(polynomial: Sequence[float]) -> bool:
    """Whether all roots of the polynomial (highest power first) have negative real parts."""
    if polynomial[0] < 0.0:
        polynomial = [-value for value in polynomial]
    return all(value > 0.0 for value in polynomial) and all(
        value > 0.0 for value in routh_first_column(polynomial)
    )


def third_order_loop(name: str, gains: tuple[float, float, float], loop_gain: float) -> ErrorLoop:
    """The loop ``y''' + N K1 y'' + N K2 y' + N K3 y = 0`` (Eqs. 35-38), ``N`` the loop gain."""
    k1, k2, k3 = scaled = tuple(loop_gain * gain for gain in gains)
    condition = f"{name} K1 K2 = {k1 * k2:g} must exceed K3 = {k3:g}"
    return _loop(name, "K", gains, (1.0, *scaled), condition)


def linear_loop(name: str, gains: Sequence[float]) -> ErrorLoop:
    """The loop with the characteristic polynomial ``s^n + gains[0] s^(n-1) + ...``."""
    column = routh_first_column((1.0, *gains))
    condition = (
        f"{name} {list(gains)}: entry {len(column)} of the Routh array's first column is "
        f"{column[-1]:g}, must be positive"
    )
    return _loop(name, "k", gains, (1.0, *gains), condition)


def _loop(
    name: str, key: str, gains: Sequence[float], polynomial: tuple[float, ...], condition: str
) -> ErrorLoop:
    """A loop; if it is unstable, with its first gain that is not positive, or else a condition."""
    if is_hurwitz(polynomial):
        return ErrorLoop(name, polynomial, True, "")
    numbered = enumerate(gains, start=1)
    wrong = (f"{name} {key}{i} = {gain:g} must be positive" for i, gain in numbered if gain <= 0.0)
    return ErrorLoop(name, polynomial, False, next(wrong, condition))


def error_loops(gains: Gains, hover_rotor_speed: float, decoupling: float) -> list[ErrorLoop]:
    """The loops of the attitude-altitude controller with a form of the decoupling matrix.

    The published matrix lacks the factor ``2 |varpi|`` in its attitude rows, so that factor, taken
    at hover, is an additional gain of the attitude loops.
    """
    factor = 2.0 * hover_rotor_speed if decoupling == PUBLISHED_DECOUPLING else 1.0
    third_order = [
        third_order_loop("roll", (gains.roll_1, gains.roll_2, gains.roll_3), factor),
        third_order_loop("pitch", (gains.pitch_1, gains.pitch_2, gains.pitch_3), factor),
        third_order_loop("yaw", (gains.yaw_1, gains.yaw_2, gains.yaw_3), factor),
        third_order_loop("altitude", (gains.altitude_1, gains.altitude_2, gains.altitude_3), 1.0),
    ]
    position = (1.0, gains.position_1, gains.position_2)
    stable = is_hurwitz(position)
    condition = "" if stable else f"position gains {list(position[1:])} must both be positive"
    return [*third_order, ErrorLoop("position", position, stable, condition)]


def feedforward_loops(gains: Gains, integral: IntegralGains) -> list[ErrorLoop]:
    """The loops of the controller with gait feed-forward, with its integrals."""
    altitude = (gains.altitude_1, gains.altitude_2, gains.altitude_3)
    position = (gains.position_1, gains.position_2)
    with_altitude = (*altitude, integral.altitude) if integral.altitude else altitude
    with_position = (*position, integral.position) if integral.position else position
    return [
        linear_loop("roll", (gains.roll_1, gains.roll_2, gains.roll_3)),
        linear_loop("pitch", (gains.pitch_1, gains.pitch_2, gains.pitch_3)),
        linear_loop("yaw", (gains.yaw_1, gains.yaw_2, gains.yaw_3)),
        linear_loop("altitude", with_altitude),
        linear_loop("position", with_position),
    ]
