"""Choose between the Python and the native engine."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from tiltsim.engines.base import EngineName
from tiltsim.engines.cache import native_code_is_cached
from tiltsim.laws.assembling import loop_of
from tiltsim.scenario.scenario import Scenario


def with_engine(scenario: Scenario, engine: EngineName) -> Scenario:
    """The scenario with its engine chosen; a user's own controller stays in Python."""
    if scenario.controller.law == "python":
        return scenario
    simulation = scenario.simulation.model_copy(update={"engine": engine})
    return scenario.model_copy(update={"simulation": simulation})


MIN_STEPS_TO_LOAD: Final = 15_000
"""Flights of at least this many steps repay loading the native engine, once it is compiled."""


MIN_STEPS_TO_COMPILE: Final = 100_000
"""Flights of at least this many steps repay compiling it first."""


def choose_engine(scenario: Scenario) -> EngineName:
    """The engine a scenario asks for; ``auto`` weighs the flight's length against start-up.

    A user's own controller is Python, whatever is asked for.
    """
    if scenario.controller.law == "python":
        return "python"
    if scenario.simulation.engine != "auto":
        return scenario.simulation.engine
    return "native" if native_pays_off([scenario]) else "python"


def native_pays_off(scenarios: Iterable[Scenario]) -> bool:
    """Whether flights are together long enough for the native engine."""
    steps, names = 0, set()
    for scenario in scenarios:
        steps += scenario.simulation.steps
        names.add(loop_of(scenario).native_name(scenario.simulation.plant))
    cached = all(map(native_code_is_cached, names))
    return steps >= (MIN_STEPS_TO_LOAD if cached else MIN_STEPS_TO_COMPILE)
