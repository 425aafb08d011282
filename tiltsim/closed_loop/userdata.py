"""Layout of MuJoCo's `userdata`, and the times at which a control step is evaluated."""

from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.scalar import Floats, Vector


class Header(NamedTuple):
    """The beginning of `userdata`, before the parameters of the closed loop.

    MuJoCo's own time is a sum of time steps, whose rounding would decide on which side of an event
    an evaluation lies, so time follows from a count of evaluations. As part of MuJoCo's state it
    also decides when a held controller samples: a saved state restarts even between two samples.
    """

    timestep: float = 0.0  # s, physics
    evaluations_per_step: float = 1.0  # of the control callback, by the integrator
    control_period: float = 0.0  # evaluations between samples of a held law; 0 if continuous
    evaluations: float = 0.0  # since time zero
    recorder: float = 0.0  # address of the memory that samples go to, 0 while none are recorded


HEADER_SIZE: Final = len(Header._fields)
TIMESTEP, EVALUATIONS_PER_STEP, CONTROL_PERIOD, EVALUATIONS, RECORDER = range(HEADER_SIZE)
"""Places of the fields of the `Header` in `userdata`."""

_AFTER: Final = 1.0 + 2.0**-48
_BEFORE: Final = 1.0 - 2.0**-48
"""Factors that put a time on one side of an event, by more than rounding moves either of them."""


def steps_taken(header: Vector | Floats) -> int:
    """Physics steps since time zero, by the `Header`."""
    return int(header[EVALUATIONS] // header[EVALUATIONS_PER_STEP])


def just_after(time: Any) -> Any:
    """A time (s) at which an event at ``time`` has begun."""
    return time * _AFTER


def just_before(time: Any) -> Any:
    """A time (s) at which an event at ``time`` has not begun."""
    return time * _BEFORE


def evaluation_time(evaluations: Any, evaluations_per_step: Any, timestep: Any) -> Any:
    """Time (s) for the next evaluation of the control step.

    An event between two steps, as a fault or a corner of a gait, belongs wholly to the later one:
    a step begins just after its first instant, and the last stage of RK4 sees the end of its step
    as it is just before.

    Args:
        evaluations: Since time zero.
        evaluations_per_step: 4 for RK4, else 1.
        timestep: s.
    """
    step = xp.floor(evaluations / evaluations_per_step)
    stage = evaluations - step * evaluations_per_step
    begin, end = just_after(step * timestep), just_before((step + 1.0) * timestep)
    return xp.where(stage == 0.0, begin, xp.where(stage == 3.0, end, (step + 0.5) * timestep))
