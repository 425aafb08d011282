"""Layout of MuJoCo's `userdata`."""

from __future__ import annotations

from typing import Final, NamedTuple


class Header(NamedTuple):
    """The beginning of `userdata`, before the parameters of the closed loop.

    A held controller counts the evaluations of the callback, so that MuJoCo's state alone decides
    when to sample: a saved state restarts between two samples, too.
    """

    control_period: float = 0.0  # evaluations between samples of a held law; 0 if continuous
    evaluations: float = 0.0  # since the last sample
    recorder: float = 0.0  # address of the memory that samples go to, 0 while none are recorded


HEADER_SIZE: Final = len(Header._fields)
CONTROL_PERIOD, EVALUATIONS, RECORDER = range(HEADER_SIZE)
"""Where in `userdata` the fields of the `Header` lie."""
