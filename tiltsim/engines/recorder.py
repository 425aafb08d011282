"""Recording of samples by machine code."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.programs import HEAD_SIZE, SIDES, RecorderHead
from tiltsim_controllers.mathematics.records import flatten, record_dtype
from tiltsim_controllers.mathematics.scalar import Floats


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
        # After the last row there is room for the number that tells whether it ends the flight.
        self._memory = np.zeros(HEAD_SIZE + SIDES + samples * self._width + 1)
        self._head = self._memory[:HEAD_SIZE].view(record_dtype(RecorderHead))
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
        self._memory[:HEAD_SIZE] = list(flatten(head))
        if len(checked) > SIDES:
            raise ValueError(f"{loop.dynamics.model}: {len(checked)} sign checks, at most {SIDES}")
        for index, value in enumerate(checked):
            self._memory[HEAD_SIZE + index] = copysign(1.0, value)

    @property
    def address(self) -> float:
        """For the `Header` in `userdata`; exact, since addresses are below 2^53."""
        return float(self._memory.ctypes.data)

    @property
    def samples(self) -> Floats:
        """The samples taken so far, shape (N, len(loop.sample_fields))."""
        taken = int(self._head["samples"][0])
        start = HEAD_SIZE + SIDES
        return self._memory[start : start + taken * self._width].reshape(taken, self._width)

    @property
    def terminated(self) -> bool:
        """Whether the last sample ends the flight."""
        return bool(self._head["terminated"][0])

    @property
    def full(self) -> bool:
        """Whether all samples have been taken."""
        return bool(self._head["samples"][0] == self._head["capacity"][0])
