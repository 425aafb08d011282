"""Limits and faults of the tilt servos and rotors.

Everything is a function of time, state and parameters, so that it can be evaluated at every
integrator stage and restarted anywhere.
"""

from functools import cache
from math import exp
from typing import Any

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.records import make_record_type, vector_of


def rate_limited_command(command: Any, angle: Any, reach: float) -> Any:
    """The set points (rad) that drive servos to their commands within their rate limit.

    The servo ``alpha'' = omega^2 (command - alpha) - 2 zeta omega alpha'`` is a velocity loop
    ``alpha'' = 2 zeta omega (v - alpha')`` inside a position loop ``v = omega / (2 zeta)
    (command - alpha)``. Limiting ``v`` to ``max_rate`` keeps the set point within the reach (rad)
    of the present angle, ``2 zeta / omega max_rate``; it is infinite without a limit.
    """
    return xp.clip(command, angle - reach, angle + reach)


@cache
def faults_record(rotors: int) -> Any:
    """The type of the faults of a number of rotors and of their times.

    The fault of a tilt servo is listed at the rotor with its number.
    """
    each = vector_of(rotors)
    return make_record_type(
        "Faults",
        thrust_time=each,  # s, from which thrust and drag torque are reduced
        thrust_factor=each,
        stuck_time=each,  # s, from which the tilt servo holds one angle
        stuck_angle=each,  # rad
    )


def thrust_factors(time: Any, faults: Any) -> Any:
    """Remaining fractions of the rotors' thrust and drag torque at a time (s), shape (N,)."""
    return xp.where(time >= faults.thrust_time, faults.thrust_factor, 1.0)


def servo_commands(time: Any, commands: Any, faults: Any) -> Any:
    """The angles (rad, (M,)) that tilt servos turn to: their commands unless they are stuck."""
    tilts = len(commands)
    return xp.where(time >= faults.stuck_time[:tilts], faults.stuck_angle[:tilts], commands)


def held_gain(bandwidth: float, step: float) -> float:
    """The gain (1/s) of a rate that is held over a step (s), 0 if continuous.

    At the end of each step the value is where a lag of this bandwidth (1/s) would be.
    """
    return (1.0 - exp(-bandwidth * step)) / step if step > 0.0 else bandwidth
