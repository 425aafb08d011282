"""Final states of flights from many initial states."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from tiltsim.engines.base import EngineName
from tiltsim.flight.end import End
from tiltsim.flight.flight import Flight
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.batch import fly_each
from tiltsim.vehicles.spans import in_last_second
from tiltsim_controllers.mathematics.scalar import Floats

ANGLES: Final = ("roll", "pitch", "yaw")


class FinalStates:
    """Flights of one scenario from other initial states: where each of them ends.

    Args:
        axes: Whose errors count: some of x, y and z.
    """

    def __init__(self, axes: str) -> None:
        self._axes = axes
        self.engine: EngineName | None = None
        """The engine of the last flight."""

    def fly(self, scenarios: Sequence[Scenario]) -> Iterator[tuple[End, Floats]]:
        """The end of each flight, and means over its last second, shape (3 + axes,).

        They are the angles (rad), which may exceed a revolution, and the errors (m).
        """
        return fly_each(scenarios, self._final, os.cpu_count() or 1)

    def _final(self, flight: Flight) -> tuple[End, Floats]:
        self.engine = flight.engine
        timestep = flight.scenario.simulation.timestep
        last = in_last_second(flight.samples[:, 0], timestep)
        columns = replace(flight, samples=flight.samples[last]).columns
        angles = [np.unwrap(columns[name]).mean() for name in ANGLES]
        errors = [(columns[f"{axis}_ref"] - columns[axis]).mean() for axis in self._axes]
        return flight.end, np.array([*angles, *errors])
