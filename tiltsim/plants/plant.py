"""The interface of a plant."""

from __future__ import annotations

from typing import Protocol

from tiltsim.engines.base import EngineName
from tiltsim_controllers.mathematics.scalar import Floats


class Plant(Protocol):
    """A vehicle under control, advanced step by step and restartable from its state."""

    engine: EngineName

    @property
    def time(self) -> float:
        """Simulated time, s."""

    @property
    def state(self) -> Floats:
        """Everything that the future depends on, as a vector; assign it to restart there."""

    @state.setter
    def state(self, value: Floats) -> None: ...

    def advance(self, steps: int) -> None:
        """Take physics steps."""

    def record(self, samples: int, steps: int) -> Floats | None:
        """Take ``samples`` times ``steps`` physics steps and a sample after each time.

        None where a sample or the physics engine tells that something has gone wrong on the way;
        what state the plant is in then is open.
        """

    def observe(self) -> tuple[float, ...]:
        """The values of a sample after its time; see `ClosedLoop.sample_fields`."""

    def fault(self) -> str:
        """What the physics engine has found wrong so far, in a few words; else empty."""
