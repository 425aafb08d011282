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

from math import atan2, cos, exp, hypot, inf, pi, sin
from typing import TYPE_CHECKING

import numpy as np

from tiltsim_controllers.analysis.singularity import decoupling_matrix, force_matrix
from tiltsim_controllers.analysis.statics import hover_rotor_speeds
from tiltsim_controllers.laws.attitude_altitude import EXACT_DECOUPLING, Gains
from tiltsim_controllers.vehicle.parameters import SPIN, Vehicle

if TYPE_CHECKING:
    from tiltsim_controllers.mathematics.scalar import Floats


def reaction_gains(
    tilts: Floats, gains: Gains, vehicle: Vehicle, rotor_inertia: float, decoupling: float
) -> Floats:
    """The three ``mu`` of level hovers with fixed tilts, ascending, real, shape (M, 3).

    Args:
        tilts: Tilt angles, rad, shape (N, 4); those without a hover in which all rotors turn are
            left out.
        gains: Of the controller.
        vehicle: As the controller assumes it.
        rotor_inertia: Of one rotor about its axis, kg m^2.
        decoupling: The form of the decoupling matrix.
    """
    found = [(row, hover_rotor_speeds((*row,), vehicle)) for row in tilts.tolist()]
    hovers = [(row, speeds) for row, speeds in found if speeds is not None and all(speeds)]
    if not hovers:
        return np.empty((0, 3))
    angles, speeds = (np.array(part) for part in zip(*hovers, strict=True))
    matrix = decoupling_matrix(angles, 0.0, 0.0, vehicle)
    scaled = slice(0 if decoupling == EXACT_DECOUPLING else 3, 4)
    matrix[:, scaled] *= 2.0 * np.abs(speeds)[:, np.newaxis]
    per_torque_rate = np.linalg.inv(matrix)[..., :3]
    reactions = -rotor_inertia * force_matrix(angles) * SPIN
    fed_back = np.array([[gains.roll_1], [gains.pitch_1], [gains.yaw_1]])
    return np.sort(np.linalg.eigvals(fed_back * reactions @ per_torque_rate).real)


def largest_held_gain(step: float, time_constant: float, latency_steps: int) -> float:
    """The ``mu`` up to which the loop is stable if the law is held over steps.

    Over a step, ``e`` becomes ``E e - mu (1 - E) e'`` with ``E = exp(-step / T)`` and ``e'`` of
    ``latency_steps`` before: ``z^k (z - E) = -mu (1 - E)``. The first root to leave the unit circle
    does so where the left side is real and negative.

    Args:
        step: Of control, s.
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
