"""The loop that a measured angular acceleration closes through the reaction of the rotors.

A rotor of inertia ``J`` whose speed ``varpi`` follows a command ``c`` with a lag ``T``, ``varpi' =
(c - varpi) / T``, turns the body by its reaction as soon as the command moves. A law that feeds the
measured angular acceleration back with the gains ``K`` counters with ``c' = M^-1 K J d varpi'``,
``d`` the thrust axes and ``M`` its decoupling matrix. With the eigenvalues ``mu`` of ``-M^-1 K J
d`` the difference ``e = c - varpi`` obeys ``e' = -(1 + mu) e / T``: the lag's pole ``-1/T`` moves
to ``-(1 + mu) / T``. At tilts of zero, and in every trot, ``mu`` is ``K_yaw J / K_m`` with the
published matrix and ``K_yaw J / (2 varpi K_m)`` with the exact one, in yaw, and 0 otherwise. At
other tilts it can be larger, or negative where tilted thrusts turn the body against the reaction.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, exp, hypot, inf, pi, sin

import numpy as np
from numpy.typing import ArrayLike

from tiltsim_controllers.analysis.torque_free import LEVEL, controlled_axes, torque_free_forces
from tiltsim_controllers.laws.attitude_altitude import EXACT_DECOUPLING
from tiltsim_controllers.laws.gains import Gains
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.effectiveness import ROTOR_FLOATS, SPIN_SIGN, force_and_torque


def attitude_feedback(gains: Gains, inertia: Floats) -> Floats:
    """Torque rate (N m/s) against a torque (N m) whose acceleration is fed back, shape (3, 3)."""
    fed_back = np.diag([gains.roll_1, gains.pitch_1, gains.yaw_1])
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
    """The ``mu`` up to which the loop is stable if the law is held over steps.

    Over a step, ``e`` becomes ``E e - mu (1 - E) e'`` with ``E = exp(-step / T)`` and ``e'`` of
    ``latency_steps`` before: ``z^k (z - E) = -mu (1 - E)``. The first root to leave the unit circle
    does so where the left side is real and negative.

    Args:
        step: Control time step, s.
        time_constant: ``T``, s.
        latency_steps: ``k``.
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
