"""One engine for several flights."""

from __future__ import annotations

from collections.abc import Sequence

from tiltsim.engines.base import EngineName
from tiltsim.laws.assembling import assemble, loop_of
from tiltsim.plants.engine_choice import MIN_STEPS_TO_COMPILE
from tiltsim.plants.factory import make_plant
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.interrupts import reraise_swallowed_interrupts


def shared_engine(scenarios: Sequence[Scenario], steps: int | None = None) -> EngineName | None:
    """The native engine where the flights together repay compiling it, None elsewhere.

    What the scenarios need is compiled here once, for all processes to load. Where they are but
    examples of the flights to come, ``steps`` is the physics steps of all flights.
    """
    if steps is None:
        steps = sum(scenario.simulation.steps for scenario in scenarios)
    if steps < MIN_STEPS_TO_COMPILE:
        return None
    ready: set[tuple[object, str]] = set()
    for scenario in scenarios:
        kind = (loop_of(scenario), scenario.simulation.plant)
        if kind not in ready and not scenario.controller.is_external:
            with reraise_swallowed_interrupts():
                plant = make_plant(assemble(scenario), engine="native")
                plant.record(1, 1)  # on the thesis plant compiled apart from `advance`
                plant.advance(1)
            ready.add(kind)
    return "native"
