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
    """Choose one engine for flights in several processes, and compile it for all of them.

    Args:
        scenarios: The flights, or examples of them.
        steps: Physics steps of all flights; default: of ``scenarios``.

    Returns:
        "native" if the flights together repay compilation, else None, the choice of each scenario.
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
                plant.record(1, 1)  # on the thesis plant compiled separately from `advance`
                plant.advance(1)
            ready.add(kind)
    return "native"
