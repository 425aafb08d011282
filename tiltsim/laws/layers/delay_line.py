"""Commands under way between a controller and its actuators, as activations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from tiltsim_controllers.mathematics.scalar import Values, Vector, scalar
from tiltsim_controllers.mathematics.vectors import componentwise, entries_of


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
def delay_line(
    first: int, steps: int, commands: int
) -> tuple[Callable[..., Values], Callable[..., Values]]:
    """Scalar code of a line of activations that passes commands on by one place per control step.

    The newest of so many commands are at ``first``, the oldest last of them all. Returns
    ``delivered(act, sent)``, the commands that arrive, and ``rates(act, sent, control_timestep)``,
    by which each place holds its neighbour's commands at the next control step.
    """
    if steps == 0:
        return undelayed, held_line(0)
    arriving = entries_of(first + commands * (steps - 1), commands)
    newest = entries_of(first, commands)
    moved = componentwise("moved", "sent, here, timestep", "(sent# - here#) / timestep", commands)
    _, older_rates = delay_line(first + commands, steps - 1, commands)

    @scalar
    def delivered(act: Vector, sent: Values) -> Values:
        return arriving(act)

    @scalar
    def rates(act: Vector, sent: Values, control_timestep: float) -> Values:
        here = newest(act)
        return (*moved(sent, here, control_timestep), *older_rates(act, here, control_timestep))

    return delivered, rates
