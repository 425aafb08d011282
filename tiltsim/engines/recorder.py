"""Recording of samples by compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, isfinite
from typing import Final, NamedTuple

import numpy as np
from numba import carray
from numba.extending import register_jitable

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.limits import SINGULAR, WITHIN_LIMITS
from tiltsim.engines.compiling import INNER
from tiltsim.engines.native_memory import bytes_at, floats_at
from tiltsim_controllers.mathematics.records import flatten, record_dtype, record_size
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.references.trajectories import ReferenceParameters


class RecorderHead(NamedTuple):
    """The head of a recorder's memory; `SIDES` floats and the samples follow."""

    left: float  # evaluations before the next sample
    interval: float  # evaluations between samples
    last_interval: float  # evaluations between the last two samples
    samples: float  # taken so far
    capacity: float  # maximum number of samples
    terminated: float  # 1 once a sample has ended the flight
    follows_position: float  # whether the horizontal position has a limit
    reference: ReferenceParameters


SIDES: Final = 17
"""How many sign checks a loop may have."""

_RECORDER: Final = record_dtype(RecorderHead)
_RECORDER_SIZE: Final = record_size(RecorderHead)


@register_jitable(**INNER)
def sample_is_due(recorder):  # type: ignore[no-untyped-def]
    """Whether to record a sample at this evaluation, which is counted."""
    head = carray(bytes_at(recorder), (1,), _RECORDER)
    left = head[0].left
    head[0].left = left - 1.0
    return left == 0.0


@register_jitable(**INNER)
def record_sample(recorder, time, values, checked, limit_exceeded, knots):  # type: ignore[no-untyped-def]
    """Record a sample; end the recording where the `TerminationMonitor` would end the flight.

    Args:
        recorder: Address of a `Recorder`'s memory.
        time, values: The time (s) and the fields after it.
        checked: The numbers that must keep their signs.
        limit_exceeded, knots: See `tiltsim.closed_loop.vehicle_kind.VehicleKind`; knots of gait and
            reference.
    """
    head = carray(bytes_at(recorder), (1,), _RECORDER)
    samples = int(head[0].samples)
    capacity = int(head[0].capacity)
    if samples >= capacity or head[0].terminated != 0.0:
        return
    width = 1 + len(values)
    rest = carray(floats_at(recorder + 8 * _RECORDER_SIZE), (SIDES + capacity * width,))
    start = SIDES + samples * width
    rest[start] = time
    finite = True
    for index in range(len(values)):
        rest[start + 1 + index] = values[index]
        finite = finite and isfinite(values[index])
    terminated = not finite
    if finite:
        reference, follows_position = head[0].reference, head[0].follows_position
        code = limit_exceeded(time, values, reference, knots, follows_position)
        terminated = code != WITHIN_LIMITS
    for index in range(len(checked)):
        side = 0.0 if abs(checked[index]) < SINGULAR else copysign(1.0, checked[index])
        if side == 0.0 or side != rest[index]:
            terminated = True
    if terminated:
        head[0].terminated = 1.0
    head[0].samples = samples + 1.0
    interval = head[0].interval if samples + 2 < capacity else head[0].last_interval
    head[0].left = interval - 1.0


@register_jitable(**INNER)
def recording_is_over(recorder):  # type: ignore[no-untyped-def]
    """Whether there is no room for another sample, or the last one ended the flight."""
    head = carray(bytes_at(recorder), (1,), _RECORDER)
    return head[0].terminated != 0.0 or head[0].samples == head[0].capacity


class Recorder:
    """Memory for the samples of one flight, to which native code writes.

    The callback takes a sample before every so many steps, the first after a full interval. Once
    there is no room for more, or a sample ends the flight, it returns NaN controls: MuJoCo warns of
    them and a batch stops there.

    Args:
        assembly: The flight.
        samples: How many to take.
        interval, last_interval: Evaluations of the control step between samples, and between the
            last two.
        checked: The numbers that must keep their signs, as they are now; see `Monitoring`.
    """

    def __init__(
        self,
        assembly: Assembly,
        samples: int,
        interval: int,
        last_interval: int,
        checked: Sequence[float],
    ) -> None:
        loop = assembly.loop
        self._width = len(loop.sample_fields)
        self._memory = np.zeros(_RECORDER_SIZE + SIDES + samples * self._width)
        self._head = self._memory[:_RECORDER_SIZE].view(_RECORDER)
        head = RecorderHead(
            left=interval if samples > 1 else last_interval,
            interval=interval,
            last_interval=last_interval,
            samples=0.0,
            capacity=samples,
            terminated=0.0,
            follows_position=assembly.follows_position,
            reference=assembly.reference,
        )
        self._memory[:_RECORDER_SIZE] = list(flatten(head))
        if len(checked) > SIDES:
            raise ValueError(f"{loop.dynamics.model}: {len(checked)} sign checks, at most {SIDES}")
        for index, value in enumerate(checked):
            self._memory[_RECORDER_SIZE + index] = copysign(1.0, value)

    @property
    def address(self) -> float:
        """For the `Header` in `userdata`; exact, since addresses are below 2^53."""
        return float(self._memory.ctypes.data)

    @property
    def samples(self) -> Floats:
        """The samples taken so far, shape (N, len(loop.sample_fields))."""
        taken = int(self._head["samples"][0])
        start = _RECORDER_SIZE + SIDES
        return self._memory[start : start + taken * self._width].reshape(taken, self._width)

    @property
    def terminated(self) -> bool:
        """Whether the last sample ends the flight."""
        return bool(self._head["terminated"][0])

    @property
    def full(self) -> bool:
        """Whether all samples have been taken."""
        return bool(self._head["samples"][0] == self._head["capacity"][0])
