"""Limits and faults of the tilt servos and rotors.

Everything is a function of time, state and parameters, so that it can be evaluated at every
integrator stage and restarted anywhere.
"""

from __future__ import annotations

from math import exp, inf
from typing import NamedTuple

from tiltsim_controllers.mathematics.scalar import scalar


@scalar
def rate_limited_command(command: float, angle: float, reach: float) -> float:
    """The set point (rad) that drives a servo to its command within its rate limit.

    The servo ``alpha'' = omega^2 (command - alpha) - 2 zeta omega alpha'`` is a velocity loop
    ``alpha'' = 2 zeta omega (v - alpha')`` inside a position loop ``v = omega / (2 zeta)
    (command - alpha)``. Limiting ``v`` to ``max_rate`` keeps the set point within the ``reach``
    ``2 zeta / omega max_rate`` (rad) of the present ``angle`` (rad).
    """
    if command > angle + reach:
        return angle + reach
    if command < angle - reach:
        return angle - reach
    return command


class RotorFault(NamedTuple):
    """The faults of one rotor and their times; none by default."""

    thrust_time: float = inf  # s, from which thrust and drag torque are reduced
    thrust_factor: float = 1.0
    stuck_time: float = inf  # s, from which the tilt servo holds one angle
    stuck_angle: float = 0.0  # rad


@scalar
def thrust_factor(time: float, fault: RotorFault) -> float:
    """Remaining fraction of a rotor's thrust and drag torque at a time (s), 1 without a fault."""
    return fault.thrust_factor if time >= fault.thrust_time else 1.0


@scalar
def servo_command(time: float, command: float, fault: RotorFault) -> float:
    """The angle (rad) that a tilt servo turns to at a time (s): its command unless it is stuck."""
    return fault.stuck_angle if time >= fault.stuck_time else command


def held_gain(bandwidth: float, step: float) -> float:
    """The gain (1/s) of a rate that is held over a step (s), 0 if continuous.

    At the end of each step the value is where a lag of this bandwidth (1/s) would be.
    """
    return (1.0 - exp(-bandwidth * step)) / step if step > 0.0 else bandwidth
