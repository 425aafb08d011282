"""Stability of the linear error dynamics (ch. 4, Propositions 4 and 5), and the rotors' reaction.

A rotor of inertia ``J`` whose speed ``varpi`` follows a command ``c`` with a lag ``T``, ``varpi' =
(c - varpi) / T``, turns the body by its reaction as soon as the command moves. A law that feeds the
measured angular acceleration back with the gains ``K`` counters with ``c' = M^-1 K J d varpi'``,
``d`` the thrust axes and ``M`` its decoupling matrix. With the eigenvalues ``mu`` of ``-M^-1 K J
d`` the difference ``e = c - varpi`` obeys ``e' = -(1 + mu) e / T``: the lag's pole ``-1/T`` moves
to ``-(1 + mu) / T``. At tilts of zero, and in every trot, ``mu`` is ``K_yaw J / K_m`` with the
published matrix and ``K_yaw J / (2 varpi K_m)`` with the exact one, in yaw, and 0 otherwise. At
other tilts it can be larger, or negative where tilted thrusts turn the body against the reaction.
"""

from collections.abc import Sequence
from math import atan2, cos, exp, hypot, inf, pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.analysis.torque_free import LEVEL, controlled_axes, torque_free_forces
from tiltsim_controllers.laws.attitude_altitude import EXACT_DECOUPLING, PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.gains import Gains, IntegralGains
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.rotors import ROTOR_FLOATS, SPIN_SIGN, force_and_torque


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


def third_order_loop(name: str, gains: Sequence[float], loop_gain: float) -> ErrorLoop:
    """The loop ``y''' + N K1 y'' + N K2 y' + N K3 y = 0`` (Eqs. 35-38), ``N`` the loop gain."""
    k1, k2, k3 = scaled = [loop_gain * gain for gain in gains]
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
        third_order_loop(name, own, 1.0 if name == "altitude" else factor)
        for name, own in gains.loops.items()
    ]
    position = (1.0, *gains.position)
    stable = is_hurwitz(position)
    condition = "" if stable else f"position gains {list(position[1:])} must both be positive"
    return [*third_order, ErrorLoop("position", position, stable, condition)]


def feedforward_loops(gains: Gains, integral: IntegralGains) -> list[ErrorLoop]:
    """The loops of the controller with gait feed-forward, with its integrals."""
    further = integral._asdict()
    return [
        linear_loop(name, (*own, further[name]) if further.get(name) else own)
        for name, own in {**gains.loops, "position": gains.position}.items()
    ]


def attitude_feedback(gains: Gains, inertia: Floats) -> Floats:
    """Torque rate (N m/s) against a torque (N m) whose acceleration is fed back, shape (3, 3)."""
    fed_back = np.diag(gains.attitude_1)
    return np.asarray(inertia @ fed_back @ np.linalg.inv(inertia))


def reaction_gains(
    table: Sequence[float],
    hovers: Sequence[tuple[ArrayLike, ArrayLike]],
    *,
    fed_back: Floats,
    rotor_inertia: float,
    decoupling: float,
    dimension: int = 1,
    norm: str = "speed",
) -> Floats:
    """The three ``mu`` of level hovers with fixed tilts, ascending, real, shape (M, 3).

    Args:
        table: Table of the rotors, as the controller assumes them.
        hovers: Tilt angles (rad) and rotor speeds (rad/s) of each; hovers in which a rotor stands
            still are left out.
        fed_back: `attitude_feedback`.
        rotor_inertia: Inertia of one rotor about its axis, kg m^2.
        decoupling: The form of the decoupling matrix.
        dimension: How many components of force are controlled.
        norm: In which the controller's inputs are the least, "speed" or "thrust".
    """
    turning = [(tilts, speeds) for tilts, speeds in hovers if np.all(speeds)]
    if not turning:
        return np.empty((0, 3))
    angles, speeds = (np.array(part) for part in zip(*turning, strict=True))
    force, torque = force_and_torque(table, angles)
    axes = controlled_axes(
        torque_free_forces(force, torque), np.tile(LEVEL, (len(angles), 1)), dimension
    )
    gain = 2.0 * np.abs(speeds)[:, np.newaxis]
    one_each = decoupling != EXACT_DECOUPLING or norm != "speed"
    lifts = axes @ force * (gain if norm == "speed" else 1.0)
    matrix = np.concatenate([torque if one_each else torque * gain, lifts], axis=-2)
    per_torque_rate = np.linalg.pinv(matrix)[..., :3]
    if norm != "speed":
        per_torque_rate = per_torque_rate / np.swapaxes(gain, -1, -2)
    spins = np.array(table[SPIN_SIGN::ROTOR_FLOATS])
    reactions = -rotor_inertia * spins * force / np.linalg.norm(force, axis=-2, keepdims=True)
    return np.sort(np.linalg.eigvals(fed_back @ reactions @ per_torque_rate).real)


def largest_held_gain(step: float, time_constant: float, latency_steps: int) -> float:
    """The ``mu`` up to which the loop is stable if the law is held over steps (s).

    With the lag ``T = time_constant`` (s) and ``k = latency_steps``, ``e`` becomes over a step
    ``E e - mu (1 - E) e'``, with ``E = exp(-step / T)`` and ``e'`` of k steps before:
    ``z^k (z - E) = -mu (1 - E)``. The first root to leave the unit circle does so where the left
    side is real and negative.
    """
    decay = exp(-step / time_constant)
    if decay == 1.0:
        return inf
    low, high = 0.0, pi
    for _ in range(60):  # the phase of the left side grows with the angle of z
        angle = 0.5 * (low + high)
        phase = latency_steps * angle + atan2(sin(angle), cos(angle) - decay)
        low, high = (angle, high) if phase < pi else (low, angle)
    return hypot(cos(low) - decay, sin(low)) / (1.0 - decay)
