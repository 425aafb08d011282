"""The interface of the plants."""

from typing import Protocol

import numpy as np

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
        """Take ``samples`` samples, one every ``steps`` physics steps: shape (samples, fields).

        None where a sample or the physics engine shows that the flight ended on the way; the state
        of the plant is then undefined.
        """
        rows = []
        for _ in range(samples):
            self.advance(steps)
            rows.append(take_sample(self))
        return None if self.fault() else np.array(rows)

    def observe(self) -> tuple[float, ...]:
        """The present values of a sample's fields after the time: `ClosedLoop.sample_fields`."""

    def fault(self) -> str:
        """The fault that the physics engine has reported so far, in a few words; else empty."""


def take_sample(plant: Plant) -> Floats:
    """The present sample, shape (fields,); see `ClosedLoop.sample_fields`."""
    return np.array([plant.time, *plant.observe()])
