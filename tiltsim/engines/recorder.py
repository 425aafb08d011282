"""Recording of samples by machine code."""

from collections.abc import Sequence
from math import copysign, inf
from typing import Final

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.programs import HEAD_SIZE, SIDES, RecorderHead
from tiltsim_controllers.mathematics.records import flatten
from tiltsim_controllers.mathematics.scalar import Floats

SAMPLES, CAPACITY, TERMINATED = map(
    RecorderHead._fields.index, ("samples", "capacity", "terminated")
)

UNLIMITED: Final = (inf, inf, inf, 0.0, inf)
"""The head, up to its capacity, of a recorder that never takes a sample."""


def recorder_head(
    assembly: Assembly, left: int, samples: int, interval: int, last_interval: int
) -> list[float]:
    """The head of a recorder.

    Args:
        assembly: The flight.
        left: Evaluations of the control step before the first sample.
        samples: How many to take.
        interval, last_interval: Evaluations between samples, and between the last two.
    """
    head = RecorderHead(
        left=left,
        interval=interval,
        last_interval=last_interval,
        samples=0.0,
        capacity=samples,
        terminated=0.0,
        follows_position=assembly.follows_position,
        reference=assembly.reference,
    )
    return [*flatten(head)]


class Recorder:
    """Memory for the samples of one flight, to which native code writes.

    The callback takes a sample before the step that ends an interval, the first after a full one.
    Once there is no room for more, or a sample ends the flight, it returns NaN controls: MuJoCo
    warns of them and a batch stops there.

    Args:
        assembly: The flight.
        samples: How many to take.
        interval, last_interval: Evaluations of the control step between samples, and between the
            last two.
        checked: The numbers that must keep their signs, as they are now; see `ClosedLoop`.

    Attributes:
        head: The head and the signs to keep, shape (HEAD_SIZE + SIDES,).
        rows: All samples, shape (samples, len(loop.sample_fields)).
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
        width = len(loop.sample_fields)
        # After the last row there is room for the number that shows whether it ends the flight.
        self._memory = np.zeros(HEAD_SIZE + SIDES + samples * width + 1)
        self.head = self._memory[: HEAD_SIZE + SIDES]
        self.rows = self._memory[HEAD_SIZE + SIDES : -1].reshape(samples, width)
        left = interval if samples > 1 else last_interval
        self.head[:HEAD_SIZE] = recorder_head(assembly, left, samples, interval, last_interval)
        if len(checked) > SIDES:
            raise ValueError(f"{loop.model}: {len(checked)} sign checks, at most {SIDES}")
        for index, value in enumerate(checked):
            self.head[HEAD_SIZE + index] = copysign(1.0, value)

    @property
    def address(self) -> float:
        """For the `Header` in `userdata`; exact, since addresses are below 2^53."""
        return float(self._memory.ctypes.data)

    @property
    def samples(self) -> Floats:
        """The samples taken so far, shape (N, len(loop.sample_fields))."""
        return self.rows[: int(self.head[SAMPLES])]

    @property
    def terminated(self) -> bool:
        """Whether the last sample ends the flight."""
        return bool(self.head[TERMINATED])

    @property
    def full(self) -> bool:
        """Whether all samples have been taken."""
        return bool(self.head[SAMPLES] == self.head[CAPACITY])
