"""Which samples of a flight a metric covers, by physics steps instead of sums of their lengths."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from tiltsim_controllers.mathematics.scalar import Floats

SETTLED: Final = 20.0
"""Time (s) from which on the supremum of the position error is taken."""

_ROUNDING: Final = 1e-9  # relative, of a time over a time step


def in_last_second(time: Floats, timestep: float) -> npt.NDArray[np.bool_]:
    """The samples of the last second, both ends included; ``time`` and ``timestep`` in s."""
    steps = np.rint(time / timestep)
    within: npt.NDArray[np.bool_] = steps[-1] - steps <= (1.0 + _ROUNDING) / timestep
    return within


def when_settled(time: Floats, timestep: float) -> npt.NDArray[np.bool_]:
    """The samples from `SETTLED` on; ``time`` and ``timestep`` in s."""
    settled: npt.NDArray[np.bool_] = (
        np.rint(time / timestep) >= (1.0 - _ROUNDING) * SETTLED / timestep
    )
    return settled
