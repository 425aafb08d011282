"""Native code for flights in several processes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from typing import Final

from tiltsim.engines.base import EngineName
from tiltsim.engines.cache import (
    announce_native_code,
    native_code_is_cacheable,
    native_code_is_cached,
)
from tiltsim.laws.assembling import assemble, loop_of
from tiltsim.plants.engine_choice import MIN_STEPS_TO_COMPILE, native_name, with_engine
from tiltsim.plants.factory import make_plant
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.processes import ProcessDiedError, in_processes

MIN_STEPS_TO_SHARE: Final = {"mujoco": 15_000, "thesis": 25_000, "rigid_body": 25_000}
"""Steps of all flights of one loop that repay compiling it, where others are compiled, too.

Measured over the library: a loop takes 1 to 5 s to compile for MuJoCo, 3 to 18 s for equations,
and a step in Python takes 0.05 to 0.3 ms longer than natively. Near these limits, in loops of
multirotors, it is 2 to 5 s and 0.25 ms for MuJoCo, 7 to 13 s and 0.3 ms for equations.
"""


def shared_engine(scenarios: Sequence[Scenario], steps: int) -> EngineName | None:
    """Choose one engine for flights in several processes, and compile it for all of them.

    Args:
        scenarios: Examples of the flights.
        steps: Physics steps of all flights.

    Returns:
        "native" if the flights together repay compilation, else None, the choice of each scenario.
    """
    if steps < MIN_STEPS_TO_COMPILE:
        return None
    _compile([*_examples(scenarios).values()])
    return "native"


def compile_together(scenarios: Sequence[Scenario], jobs: int) -> frozenset[str]:
    """Compile on several processes what repays it in flights on several processes.

    Args:
        scenarios: All flights.
        jobs: Processes; a single one compiles what it flies itself.

    Returns:
        The names of these loops and of those compiled before, for `with_compiled`.
    """
    if sum(scenario.simulation.steps for scenario in scenarios) < MIN_STEPS_TO_COMPILE:
        return frozenset()
    examples, steps = _examples(scenarios), Counter[str]()
    for scenario in scenarios:
        steps[_name(scenario)] += scenario.simulation.steps
    cached = frozenset(filter(native_code_is_cached, examples))  # each loads in 0.05 s
    missing = [
        name
        for name, example in examples.items()
        if name not in cached and steps[name] >= MIN_STEPS_TO_SHARE[example.simulation.plant]
    ]
    if jobs > 1 and native_code_is_cacheable():
        for name in missing:
            announce_native_code(name)
        # A scenario's loops on both plants share most of their code.
        by_address = groupby((examples[name] for name in missing), lambda one: one.address)
        for _, future in in_processes(_compile, [[*group] for _, group in by_address], jobs):
            error = future.exception()
            # Without memory for both, the processes that fly compile for themselves.
            if error is not None and not isinstance(error, ProcessDiedError):
                raise error
    return cached.union(missing)


def with_compiled(scenario: Scenario, names: frozenset[str]) -> Scenario:
    """The scenario natively if its engine is auto and its loop is one of `compile_together`."""
    compiled = scenario.simulation.engine == "auto" and _name(scenario) in names
    return with_engine(scenario, "native") if compiled else scenario


def _name(scenario: Scenario) -> str:
    return native_name(scenario, loop_of(scenario))


def _examples(scenarios: Sequence[Scenario]) -> dict[str, Scenario]:
    """A scenario of each loop that may fly natively, by its name."""
    return {
        _name(scenario): scenario
        for scenario in scenarios
        if scenario.simulation.engine in ("auto", "native") and not scenario.controller.is_external
    }


def _compile(scenarios: Sequence[Scenario]) -> None:
    for scenario in scenarios:
        make_plant(assemble(scenario), engine="native").record(1, 1)
