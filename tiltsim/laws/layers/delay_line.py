"""Commands under way between a controller and its actuators, as activations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Final

from tiltsim.laws.tiltrotor import four
from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar

COMMANDS: Final = 8
"""Commands of a controller: four tilt angles (rad), four rotor accelerations (rad/s^2)."""

EXTERNAL_COMMANDS: Final = 9
"""Commands from outside: the last says whether the rotors' are speeds (rad/s), taken at once."""


@scalar
def first_eight(values: Vector) -> Values:
    """The first eight values."""
    return (*four(values, 0), *four(values, 4))


@scalar
def undelayed(act: Vector, sent: Values) -> Values:
    """Without latency the commands sent take effect."""
    return sent


@cache
def held_line(size: int) -> Callable[..., Values]:
    """Scalar code of a delay line that its plant moves: activations of rate zero."""
    at_rest = (0.0,) * size

    @scalar
    def rates(act: Vector, sent: Values, control_timestep: float) -> Values:
        return at_rest

    return rates


@cache
def delay_line(first: int, steps: int) -> tuple[Callable[..., Values], Callable[..., Values]]:
    """Scalar code of a line of activations that passes commands on by one place per control step.

    The newest commands are at ``first``, the oldest ``8 (steps - 1)`` after them. Returns
    ``delivered(act, sent)``, the commands that arrive, and ``rates(act, sent, control_timestep)``,
    by which each place holds its neighbour's commands at the next control step.
    """
    if steps == 0:
        return undelayed, held_line(0)
    oldest = first + COMMANDS * (steps - 1)
    _, older_rates = delay_line(first + COMMANDS, steps - 1)

    @scalar
    def delivered(act: Vector, sent: Values) -> Values:
        return first_eight(act[oldest:])

    @scalar
    def rates(act: Vector, sent: Values, control_timestep: float) -> Values:
        here = first_eight(act[first:])
        return (
            (sent[0] - here[0]) / control_timestep,
            (sent[1] - here[1]) / control_timestep,
            (sent[2] - here[2]) / control_timestep,
            (sent[3] - here[3]) / control_timestep,
            (sent[4] - here[4]) / control_timestep,
            (sent[5] - here[5]) / control_timestep,
            (sent[6] - here[6]) / control_timestep,
            (sent[7] - here[7]) / control_timestep,
            *older_rates(act, here, control_timestep),
        )

    return delivered, rates
