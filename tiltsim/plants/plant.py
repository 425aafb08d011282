"""The interface of plants, and the choice of their engine."""

from collections.abc import Iterable
from typing import Final, Protocol

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.base import EngineName
from tiltsim.scenario.scenario import Scenario
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


MIN_STEPS_TO_COMPILE: Final = 4_000
"""Flights of at least this many steps repay compiling the native engine: it takes 0.1 to 0.4 s of
CPU, a step in Python 0.05 to 0.3 ms longer."""


def choose_engine(assembly: Assembly, engine: EngineName | None = None) -> EngineName:
    """The engine of a flight.

    ``auto`` weighs the flight's length against the time to compile. A user's own controller that is
    called at control samples, and a law that cannot be traced, always fly in Python.

    Args:
        assembly: The flight.
        engine: Engine in place of the scenario's.
    """
    scenario = assembly.scenario
    if scenario.controller.is_external or not assembly.loop.is_traceable:
        return "python"
    if engine is not None:
        return engine
    if scenario.simulation.engine != "auto":
        return scenario.simulation.engine
    return "native" if native_pays_off([scenario]) else "python"


def native_pays_off(scenarios: Iterable[Scenario]) -> bool:
    """Whether flights are together long enough for the native engine."""
    return sum(scenario.simulation.steps for scenario in scenarios) >= MIN_STEPS_TO_COMPILE


def with_engine(scenario: Scenario, engine: EngineName) -> Scenario:
    """The scenario with another engine; a user's own controller keeps its own, Python."""
    if scenario.controller.is_external:
        return scenario
    simulation = scenario.simulation.model_copy(update={"engine": engine})
    return scenario.model_copy(update={"simulation": simulation})
