"""Choice of the engine that flies a scenario."""

from collections.abc import Iterable
from typing import Final

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.base import EngineName
from tiltsim.scenario.scenario import Scenario

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
