"""Which engine flies a scenario."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.engines.base import EngineName
from tiltsim.engines.cache import native_code_is_cached
from tiltsim.laws.assembling import loop_of
from tiltsim.scenario.scenario import Scenario

MIN_STEPS_TO_LOAD: Final = 15_000
"""Flights of at least this many steps repay loading the native engine, once it is compiled."""

MIN_STEPS_TO_COMPILE: Final = 100_000
"""Flights of at least this many steps repay compiling it first."""


def choose_engine(scenario: Scenario, loop: ClosedLoop) -> EngineName:
    """The engine that a scenario requests for its loop.

    ``auto`` weighs the flight's length against the start-up time of the native engine. A user's
    own controller always flies in Python.
    """
    if scenario.controller.is_external:
        return "python"
    if scenario.simulation.engine != "auto":
        return scenario.simulation.engine
    pays_off = _pays_off(scenario.simulation.steps, [native_name(scenario, loop)])
    return "native" if pays_off else "python"


def native_name(scenario: Scenario, loop: ClosedLoop) -> str:
    """File name of the compiled code of a scenario's loop."""
    simulation = scenario.simulation
    return loop.native_name(simulation.plant, simulation.solver)


def native_pays_off(scenarios: Iterable[Scenario]) -> bool:
    """Whether flights are together long enough for the native engine."""
    steps, names = 0, set()
    for scenario in scenarios:
        steps += scenario.simulation.steps
        names.add(native_name(scenario, loop_of(scenario)))
    return _pays_off(steps, names)


def _pays_off(steps: int, names: Iterable[str]) -> bool:
    cached = all(map(native_code_is_cached, names))
    return steps >= (MIN_STEPS_TO_LOAD if cached else MIN_STEPS_TO_COMPILE)


def with_engine(scenario: Scenario, engine: EngineName) -> Scenario:
    """The scenario with another engine; a user's own controller keeps its own, Python."""
    if scenario.controller.is_external:
        return scenario
    simulation = scenario.simulation.model_copy(update={"engine": engine})
    return scenario.model_copy(update={"simulation": simulation})
