"""Closed loops: a control law, as scalar code, around one of the MuJoCo models."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from controllers.records import record_dtype, record_size


class Sizes(NamedTuple):
    """Lengths of the vectors that a loop reads and writes."""

    qpos: int
    qvel: int
    act: int
    ctrl: int


@dataclass(frozen=True)
class Loop:
    """What the engines need to close one loop.

    Attributes
    ----------
    model
        Name of the MJCF model.
    sizes
        Lengths of its vectors.
    parameters
        Record at the head of `userdata`; its first field is ``signature``. A table of floats, for
        gaits of any length, may follow it.
    controls
        Scalar function ``(time, qpos, qvel, act, parameters, table) -> ctrl``: the whole step.
    refresh
        Scalar function ``(ctrl, act) -> ctrl``: what moves between the samples of a held law.
    """

    model: str
    sizes: Sizes
    parameters: type[tuple[Any, ...]]
    controls: Callable[..., tuple[float, ...]]
    refresh: Callable[..., tuple[float, ...]]

    @cached_property
    def signature(self) -> float:
        """A checksum of the layout of `userdata`, which tells our models from foreign ones."""
        layout = (self.model, self.sizes, record_dtype(self.parameters))
        return float(zlib.crc32(repr(layout).encode()))

    @cached_property
    def record_size(self) -> int:
        """Number of floats of the parameter record."""
        return record_size(self.parameters)
