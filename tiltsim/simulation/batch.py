"""Many flights at once, as in sweeps, Monte Carlo studies and stability maps."""

import os
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from os import PathLike
from typing import Any, Final, TypeVar

from tiltsim.closed_loop.assembly import Assembly, program_key
from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import assemble
from tiltsim.plants.plant import native_pays_off
from tiltsim.scenario.loading import as_scenario
from tiltsim.scenario.own_parts import require_trust
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.vehicle import VehicleTable
from tiltsim.simulation.native_batch import LaneBatch, fly_in_mujoco, lanes_for
from tiltsim.simulation.simulate import simulate_assembly
from tiltsim.system.arguments import (
    Report,
    check_progress,
    reported,
    true_or_false,
    warn_user,
    whole_number,
)
from tiltsim.system.processes import ProcessDiedError, in_order, in_processes
from tiltsim.system.text import short_repr

PARTS: Final = 4  # parts of the scenarios that each process gets in turn

_START: Final[dict[str, Any]] = {
    "object": {"__all__": {"velocity"}},
    "payload": {"swing", "swing_damping"},
}
"""Keys of things beside the vehicle that are no part of its model."""

WINDOW: Final = 2048  # number of scenarios that are grouped into batches at a time

Result = TypeVar("Result")


@dataclass(frozen=True, repr=False)
class FlightResult:
    """The result of one flight among many."""

    scenario: Scenario
    end: End
    metrics: dict[str, float | bool]  # see `tiltsim.scenario.metric_names.METRICS`
    flight: Flight | None = None  # the flight itself, if its samples are kept

    @property
    def has_failed(self) -> bool:
        """Whether the controller failed, and was given in Python: see the warning of `simulate`."""
        return self.end.kind == "failed" and self.scenario.own_controller is not None

    def __repr__(self) -> str:
        """The scenario and the end, in one line."""
        name = self.scenario.address or self.scenario.title
        return f"<FlightResult of {name}: {self.end.kind} at {self.end.time:g} s>"


def fly(
    scenarios: Iterable[Scenario | str | PathLike[str] | Mapping[str, Any]],
    *,
    threads: int | None = None,
    jobs: int = 1,
    keep_samples: bool = False,
    progress: Report | bool | None = None,
) -> Iterator[FlightResult]:
    """Fly scenarios and yield their results, in their order, as they become available.

    Args:
        scenarios: Scenarios to fly, each anything that `tiltsim.load_scenario` takes; they may
            differ in anything. Scenarios that share a closed loop and do not request the Python
            engine are flown in batches if they are long enough together, flights of the jax engine
            always.
        threads: Maximum number of threads of each process; None shares out all cores.
        jobs: Processes, for controllers in Python, whose flights threads do not speed up. A script
            has to call this under ``if __name__ == "__main__":``, and functions given in Python
            come from a module that other processes can import.
        keep_samples: Whether results hold their flights. Without them memory does not grow with the
            number of scenarios.
        progress: True for a bar; or a function, called with the number of finished flights.

    Yields:
        Bit-identical to `tiltsim.simulate` of the scenario, but for rounding with the jax engine
        and with ``simulation.batch_functions = "quick"``; ``realtime_factor`` is computed from the
        flight's share of the time of all threads. If custom controllers fail, Python warns of the
        first, as in `tiltsim.simulate`.

    Raises:
        InputError: At once, if an argument or a scenario is invalid, or a scenario names Python
            code and was not loaded with ``trusted=True``; later, if a vehicle cannot be built or a
            custom controller cannot be used.
        KeyboardInterrupt: If interrupted; results yielded before are complete.
    """
    is_one = isinstance(scenarios, str | Mapping | Scenario) or getattr(scenarios, "shape", 1) == ()
    if is_one or not isinstance(scenarios, Iterable):
        raise InputError(f"scenarios = {short_repr(scenarios)}: must be a list of scenarios")
    jobs, cores = whole_number("jobs", jobs), os.cpu_count() or 1
    threads = max(1, cores // jobs) if threads is None else whole_number("threads", threads)
    true_or_false("keep_samples", keep_samples)
    check_progress(progress)
    chosen = [as_scenario(scenario) for scenario in scenarios]
    for scenario in chosen:
        require_trust(scenario)

    result = partial(_result, keep_samples)
    flying = partial(fly_each, chosen, result, threads)
    if jobs > 1 and len(chosen) > 1:
        flying = partial(_fly_on_processes, chosen, result, threads, jobs)
    return _with_progress(flying, len(chosen), progress)


def _result(keep: bool, flight: Flight) -> FlightResult:
    return FlightResult(flight.scenario, flight.end, flight.metrics(), flight if keep else None)


def _fly_on_processes(
    scenarios: Sequence[Scenario],
    finish: Callable[[Flight], FlightResult],
    threads: int,
    jobs: int,
    finished: Callable[[], None],
) -> Iterator[FlightResult]:
    """Fly as `fly_each` does, on several processes."""
    size = -(-len(scenarios) // (PARTS * jobs))
    starts = range(0, len(scenarios), size)
    try:
        parts = [
            (start, pickle.dumps([(one, one._own) for one in scenarios[start : start + size]]))
            for start in starts
        ]
    except (AttributeError, TypeError, pickle.PicklingError) as error:
        raise InputError(_not_importable(jobs, error)) from None

    def flown() -> Iterator[tuple[int, FlightResult]]:
        work = partial(_fly_part, jobs, finish, threads)
        for (start, _), future in in_processes(work, parts, jobs):
            if isinstance(future.exception(), ProcessDiedError):
                reason = 'a script has to call fly under if __name__ == "__main__"'
                raise InputError(f"jobs = {jobs}: {future.exception()}; {reason}")
            for place, result in enumerate(future.result(), start):
                scenario, flight = scenarios[place], result.flight
                if flight is not None:
                    flight = replace(flight, assembly=assemble(scenario))
                yield place, replace(result, scenario=scenario, flight=flight)

    yield from in_order(_counted(flown(), finished))


def _fly_part(
    jobs: int, finish: Callable[[Flight], FlightResult], threads: int, part: tuple[int, bytes]
) -> list[FlightResult]:
    """Results of the scenarios of a part, in the process that flies them."""
    try:
        scenarios = []
        for scenario, own in pickle.loads(part[1]):
            scenario._own = own
            scenarios.append(scenario)
    except (AttributeError, ImportError) as error:
        raise InputError(_not_importable(jobs, error)) from None
    return [*fly_each(scenarios, finish, threads)]


def _not_importable(jobs: int, error: Exception) -> str:
    return (
        f"jobs = {jobs}: other processes cannot import a function given in Python "
        f"({' '.join(str(error).split())}); define it in a module, or leave jobs out"
    )


def _with_progress(
    flying: Callable[[Callable[[], None]], Iterator[FlightResult]],
    total: int,
    progress: Report | bool | None,
) -> Iterator[FlightResult]:
    with reported(progress, "flights", total) as report:
        number, warned = count(1), False
        results = flying(lambda: report(next(number)))
        for place, result in enumerate(results, start=1):
            if result.has_failed and not warned:
                warned = True
                warn_user(f"flight {place}: {result.end.message}")
            yield result


def fly_each(
    scenarios: Sequence[Scenario],
    finish: Callable[[Flight], Result],
    threads: int,
    finished: Callable[[], None] = lambda: None,
) -> Iterator[Result]:
    """Fly as `fly` does, and yield what ``finish`` makes of each flight, in their order.

    Samples are freed unless it keeps them. Raises `KeyboardInterrupt` if interrupted.

    Args:
        scenarios: Scenarios to fly.
        finish: Makes a result of a flight.
        threads: Maximum number of threads.
        finished: Called after every flight, also one that waits for others before it.
    """

    def result(flight: Flight) -> Result:
        if flight.end.kind == "interrupted":
            raise KeyboardInterrupt
        return finish(flight)

    native = native_pays_off(scenarios)
    with ThreadPoolExecutor(threads) as pool:
        for start in range(0, len(scenarios), WINDOW):
            window = [assemble(scenario) for scenario in scenarios[start : start + WINDOW]]
            flown = _fly_window(window, native, threads, pool, result)
            yield from in_order(_counted(flown, finished))


def _counted(
    flown: Iterable[tuple[int, Result]], finished: Callable[[], None]
) -> Iterator[tuple[int, Result]]:
    for one in flown:
        finished()
        yield one


def _fly_window(
    assemblies: Sequence[Assembly],
    native: bool,
    threads: int,
    pool: ThreadPoolExecutor,
    result: Callable[[Flight], Result],
) -> Iterator[tuple[int, Result]]:
    """Fly group by group; yields places and results."""
    groups: dict[object, list[int]] = {}
    for index, assembly in enumerate(assemblies):
        groups.setdefault(_way_to_fly(assembly, native), []).append(index)
    for way, indices in groups.items():
        chosen = [assemblies[index] for index in indices]
        flown: Iterator[tuple[int, Result]]
        if way == "alone":
            flown = ((index, result(simulate_assembly(a))) for index, a in enumerate(chosen))
        elif chosen[0].scenario.simulation.engine == "jax":
            from tiltsim.simulation.array_batch import ArrayBatch

            flown = ArrayBatch(chosen, threads, pool, result).results()
        elif chosen[0].scenario.simulation.plant != "mujoco":
            flown = LaneBatch(chosen, lanes_for(len(chosen)), threads, pool, result).results()
        else:
            flown = fly_in_mujoco(chosen, threads, pool, result)
        yield from ((indices[place], outcome) for place, outcome in flown)


def _way_to_fly(assembly: Assembly, native: bool) -> object:
    """``alone``, or the properties that the flights of a batch share."""
    scenario = assembly.scenario
    simulation = scenario.simulation
    if simulation.engine == "jax":
        from tiltsim.simulation.array_batch import batch_key

        return batch_key(assembly)
    natively = simulation.engine == "native" or (simulation.engine == "auto" and native)
    if (
        not (natively and assembly.traced and assembly.loop.is_traceable)
        or scenario.controller.is_external
        or any(table.start or table.end for table in scenario.cable)  # each has its own model
    ):
        return "alone"
    key = program_key(assembly)
    if simulation.plant != "mujoco":
        held = simulation.control_steps > 0
        return key, simulation.solver, held, simulation.batch_functions
    # Stops of the tilt servos are constraints, which lengthen a state; ground and objects add
    # geoms; a layer has its own states and controls; a user's file may have other bodies.
    vehicles = [each.vehicle for each in (scenario, *scenario.companions)]
    added = scenario.model_dump_json(include={"object", "tool", "payload"}, exclude=_START)
    files = tuple(v.mjcf if isinstance(v, VehicleTable) else None for v in vehicles)
    stops = tuple(vehicle.tilt_servo.angle_limit is not None for vehicle in vehicles)
    return key, stops, scenario.ground is not None, added, files
