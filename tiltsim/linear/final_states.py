"""Where flights from many initial states end, on the fastest engine that flies them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib.util import find_spec
from typing import Final

import numpy as np

from tiltsim.arrays.values import LiftError
from tiltsim.engines.base import EngineName
from tiltsim.flight.end import End
from tiltsim.flight.flight import Flight
from tiltsim.plants.engine_choice import with_engine
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.batch import fly_each
from tiltsim.vehicles.spans import in_last_second
from tiltsim_controllers.mathematics.scalar import Floats

ANGLES: Final = ("roll", "pitch", "yaw")

MIN_STEPS_ON_ARRAYS: Final = 5_000_000
"""Flights of at least so many steps together repay compiling their loop in JAX."""


class FinalStates:
    """Flights of one scenario from other initial states: where each of them ends.

    They fly on arrays of JAX, if the scenario leaves the engine open, flies on equations of motion,
    and is long enough for it; elsewhere, and without JAX, as `tiltsim.fly` does.

    Args:
        scenario: The scenario.
        flights: How many there will be, about.
        axes: Whose errors count: some of x, y and z.
    """

    def __init__(self, scenario: Scenario, flights: int, axes: str) -> None:
        simulation, self._axes = scenario.simulation, axes
        self.engine: EngineName | None = None
        """Which flew the last of them."""
        many = flights * simulation.steps >= MIN_STEPS_ON_ARRAYS
        on_equations = simulation.plant != "mujoco" and simulation.engine == "auto"
        self._on_arrays = many and on_equations and find_spec("jax") is not None

    def fly(self, scenarios: Sequence[Scenario]) -> Iterator[tuple[End, Floats]]:
        """The end of each flight, and means over its last second, shape (3 + axes,).

        They are the angles (rad), which may exceed a revolution, and the errors (m).
        """
        threads = os.cpu_count() or 1
        if self._on_arrays:
            lifted = [with_engine(scenario, "jax") for scenario in scenarios]
            try:
                yield from fly_each(lifted, self._final, threads)
                return
            except LiftError:  # such as noise; raised before the first result
                self._on_arrays = False
        yield from fly_each(scenarios, self._final, threads)

    def _final(self, flight: Flight) -> tuple[End, Floats]:
        self.engine = flight.engine
        timestep = flight.scenario.simulation.timestep
        last = in_last_second(flight.samples[:, 0], timestep)
        columns = replace(flight, samples=flight.samples[last]).columns
        angles = [np.unwrap(columns[name]).mean() for name in ANGLES]
        errors = [(columns[f"{axis}_ref"] - columns[axis]).mean() for axis in self._axes]
        return flight.end, np.array([*angles, *errors])
