"""The interface of the plants."""

from __future__ import annotations

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
        """Take ``samples`` samples, each after so many physics steps: shape (samples, fields).

        None where a sample or the physics engine shows that the flight ended on the way; the state
        of the plant is then undefined.
        """

    def observe(self) -> tuple[float, ...]:
        """The present values of a sample's fields after the time; see `Loop.sample_fields`."""

    def fault(self) -> str:
        """The fault that the physics engine has reported so far, in a few words; else empty."""


def take_sample(plant: Plant) -> Floats:
    """The present sample, shape (fields,); see `ClosedLoop.sample_fields`."""
    return np.array([plant.time, *plant.observe()])


def record_step_by_step(plant: Plant, samples: int, steps: int) -> Floats | None:
    """`Plant.record` by alternating `Plant.advance` and `Plant.observe`."""
    rows = []
    for _ in range(samples):
        plant.advance(steps)
        rows.append(take_sample(plant))
    return None if plant.fault() else np.array(rows)
