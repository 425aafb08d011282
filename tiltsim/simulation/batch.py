"""Many flights at once: what sweeps, Monte Carlo studies and stability maps are made of.

Flights in MuJoCo under one law share a `mujoco.batch.Batch`: a row is a flight, with a model and
parameters of its own, and all cores step rows natively. A row records its own samples, and stops
by itself when it has them all or is lost; its place goes to the next flight at once. So memory
holds as many flights as there are rows, however many are flown.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import RECORDER
from tiltsim.engines.callback import control_callback
from tiltsim.flight.end import End
from tiltsim.flight.flight import Flight
from tiltsim.laws.assembling import assemble
from tiltsim.plants.engine_choice import native_pays_off
from tiltsim.plants.factory import make_plant
from tiltsim.plants.flight_model import flight_model, model_cache_key
from tiltsim.plants.mujoco_plant import MujocoPlant, quiet_warnings
from tiltsim.scenario.vehicle import VehicleTable
from tiltsim.simulation.monitor import TerminationMonitor
from tiltsim.simulation.simulate import fly_chunk, simulate_assembly
from tiltsim_controllers.mathematics.scalar import Floats

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario

ROWS_PER_THREAD: Final = 24
"""Rows of a batch: enough of them that no thread waits long for the last one of a call."""

MEMORY: Final = 256 * 2**20
"""Bytes that the samples of all rows may take together."""

CALL_TIME: Final = 0.25
"""How long (s) a batch flies before Python looks at the rows and at the keyboard."""

WINDOW: Final = 512
"""How many scenarios are looked at together to find those that share a batch."""


@dataclass(frozen=True)
class FlightResult:
    """What is kept of one flight among many.

    Attributes
    ----------
    scenario
        What was flown.
    end
        How it ended.
    metrics
        The flight in numbers; see `tiltsim.scenario.metric_names.METRICS`.
    flight
        The flight itself, None unless its samples were asked for.
    """

    scenario: Scenario
    end: End
    metrics: dict[str, float | bool]
    flight: Flight | None = None


def fly(
    scenarios: Sequence[Scenario], *, threads: int | None = None, keep_samples: bool = False
) -> Iterator[FlightResult]:
    """Fly scenarios and yield their results, in their order, as they become known.

    Parameters
    ----------
    scenarios
        What to fly; they may differ in anything. Those of one law in MuJoCo that do not ask for
        the Python engine are flown in batches where they are long enough together.
    threads
        How many to use at most; None takes all cores.
    keep_samples
        Whether results hold their flights. Without them memory does not grow with the number of
        scenarios.

    Yields
    ------
    FlightResult
        The same, bit for bit, as `tiltsim.simulate` gives for the scenario by itself; only
        ``realtime_factor`` counts the time that the flight took of all threads together.

    Raises
    ------
    KeyboardInterrupt
        When interrupted from the keyboard; results yielded before are complete.
    """
    threads = threads or os.cpu_count() or 1
    native = native_pays_off(scenarios)
    with ThreadPoolExecutor(threads) as pool:
        for start in range(0, len(scenarios), WINDOW):
            window = [assemble(scenario) for scenario in scenarios[start : start + WINDOW]]
            yield from _fly_window(window, native, threads, pool, keep_samples)


def _fly_window(
    assemblies: Sequence[Assembly],
    native: bool,
    threads: int,
    pool: ThreadPoolExecutor,
    keep_samples: bool,
) -> Iterator[FlightResult]:
    """Fly group by group, and put the results back into their order."""
    groups: dict[object, list[int]] = {}
    for index, assembly in enumerate(assemblies):
        groups.setdefault(_way_to_fly(assembly, native), []).append(index)
    done: dict[int, FlightResult] = {}
    following = 0

    def result(flight: Flight) -> FlightResult:
        if flight.end.kind == "interrupted":
            raise KeyboardInterrupt
        kept = flight if keep_samples else None
        return FlightResult(flight.scenario, flight.end, flight.metrics(), kept)

    for way, indices in groups.items():
        chosen = [assemblies[index] for index in indices]
        flown: Iterator[tuple[int, FlightResult]]
        if way == "alone":
            flown = ((index, result(simulate_assembly(a))) for index, a in enumerate(chosen))
        elif way == "thesis":
            for one_of_each in {assembly.loop: assembly for assembly in chosen}.values():
                make_plant(one_of_each, engine="native")  # prepares native code before threads do
            flown = enumerate(
                _in_order(
                    lambda a: result(simulate_assembly(a, engine="native")), chosen, threads, pool
                )
            )
        else:
            flown = _BatchFlight(chosen, threads, pool, result).results()
        for place, outcome in flown:
            done[indices[place]] = outcome
            while following in done:
                yield done.pop(following)
                following += 1


def _way_to_fly(assembly: Assembly, native: bool) -> object:
    """``alone``, on the ``thesis`` plant in threads, or what the rows of a batch have in common."""
    scenario, loop = assembly.scenario, assembly.loop
    simulation = scenario.simulation
    natively = simulation.engine == "native" or (simulation.engine == "auto" and native)
    checked = loop.monitoring.sign_check_values is not None
    if not natively or not checked or scenario.controller.is_external:
        return "alone"
    if simulation.plant == "thesis":
        return "thesis"
    # A stop of the tilt servos is a constraint, which gives a state more numbers, and ground gives
    # the model more shapes; a law with a layer around it has states and controls of its own.
    vehicle = scenario.vehicle
    file = vehicle.mjcf if isinstance(vehicle, VehicleTable) else None
    return loop, vehicle.tilt_servo.angle_limit is not None, scenario.ground is not None, file


def _in_order(
    fly: Callable[[Assembly], FlightResult],
    assemblies: Sequence[Assembly],
    threads: int,
    pool: ThreadPoolExecutor,
) -> Iterator[FlightResult]:
    """Results of flights that do not need MuJoCo's callback, some of them under way at a time."""
    waiting: deque[Future[FlightResult]] = deque()
    for assembly in assemblies:
        waiting.append(pool.submit(fly, assembly))
        if len(waiting) > 2 * threads:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


class _Row:
    """One flight under way in a row of a batch."""

    def __init__(self, index: int, assembly: Assembly, plant: MujocoPlant) -> None:
        self.index, self.assembly, self.plant = index, assembly, plant
        self.watch = TerminationMonitor(assembly)
        self.first = np.array([plant.time, *plant.observe()])
        self.end = self.watch.judge(plant, self.first)
        simulation = assembly.scenario.simulation
        self.interval = simulation.record_steps
        full, rest = divmod(simulation.steps, self.interval)
        self.intervals = [self.interval] * full + [rest] * (rest > 0)
        last = self.intervals[-1]
        self.recorder = plant.recorder(len(self.intervals), self.interval, last)
        self.saved = [(0, plant.state)]  # steps and state, at the begin of the last two calls
        self.wall_time = 0.0

    @property
    def steps(self) -> int:
        """Steps from which all samples have been taken."""
        taken = len(self.recorder.samples)
        return sum(self.intervals) if self.recorder.full else taken * self.interval

    def save(self, state: Floats) -> None:
        """Keep where a call begins."""
        time, timestep = float(state[0]), self.assembly.scenario.simulation.timestep
        state = state.copy()
        self.saved = [self.saved[-1], (round(time / timestep), state)]

    def finish(self) -> Flight:
        """The flight; the end of a lost one is looked for step by step, as a single flight does."""
        samples = list(self.recorder.samples)
        if self.recorder.terminated:
            samples.pop()
        if self.end is None and len(samples) < len(self.intervals):
            samples = self._look_for_the_end(samples)
        end = self.end or End("completed", float(samples[-1][0]))
        everything = np.array([self.first, *samples])
        return Flight(self.assembly, everything, end, "native", self.wall_time)

    def _look_for_the_end(self, samples: list[Floats]) -> list[Floats]:
        steps, state = self.saved[0]
        plant = self.plant
        header = plant.header_offset
        state = state.copy()
        state[header + RECORDER] = 0.0
        plant.state = state
        plant.advance(sum(self.intervals[: len(samples)]) - steps)
        for interval in self.intervals[len(samples) :]:
            found, self.end = fly_chunk(plant, self.watch, 1, interval)
            samples.extend(found)
            if self.end is not None:
                break
        return samples


class _BatchFlight:
    """Scenarios of one law, flown in one batch; a row that has ended makes room for the next."""

    def __init__(
        self,
        assemblies: Sequence[Assembly],
        threads: int,
        pool: ThreadPoolExecutor,
        result: Callable[[Flight], FlightResult],
    ) -> None:
        self._waiting = deque(enumerate(assemblies))
        self._threads, self._pool, self._result = threads, pool, result
        self._knots = max(len(assembly.setup.knots) for assembly in assemblies)
        self._models: dict[str, mujoco.MjModel] = {}
        simulations = [assembly.scenario.simulation for assembly in assemblies]
        largest = max(s.steps // s.record_steps for s in simulations) + 2
        fitting = MEMORY // (8 * len(assemblies[0].loop.sample_fields) * largest)
        self._size = max(1, min(len(assemblies), ROWS_PER_THREAD * threads, fitting))

    def results(self) -> Iterator[tuple[int, FlightResult]]:
        """Pairs of a scenario's place and its result, in the order in which they come."""
        from mujoco.batch import Batch

        unfinished: deque[tuple[int, Future[FlightResult]]] = deque()
        rows: list[_Row | None] = [None] * self._size
        batch: Any = None
        steps = 256
        while True:
            for place in range(self._size):
                while rows[place] is None and self._waiting:
                    new = self._take_next()
                    if new.end is not None:
                        unfinished.append((new.index, self._hand_over(new)))
                        continue
                    if batch is None:
                        batch = Batch(new.plant.model, self._size, self._threads)
                    rows[place] = new
                    batch.state[place] = new.saved[-1][1]
                    batch.state[place, new.plant.header_offset + RECORDER] = new.recorder.address
            flying = {place: row for place, row in enumerate(rows) if row is not None}
            if flying:
                steps = self._fly(batch, flying, steps)
                for place, row in flying.items():
                    if row.recorder.full or row.recorder.terminated or batch.warning[place].any():
                        batch.warning[place] = 0
                        rows[place] = None
                        lost = not row.recorder.full or row.recorder.terminated
                        if lost:  # its end is looked for with MuJoCo's callback, which is global
                            flight = row.finish()
                            future = self._pool.submit(self._result, flight)
                        else:
                            future = self._hand_over(row)
                        unfinished.append((row.index, future))
            while unfinished and (unfinished[0][1].done() or not flying):
                index, future = unfinished.popleft()
                yield index, future.result()
            if len(unfinished) > 2 * self._size:  # metrics cannot keep up: wait for them
                index, future = unfinished.popleft()
                yield index, future.result()
            if not flying and not self._waiting:
                return

    def _take_next(self) -> _Row:
        index, assembly = self._waiting.popleft()
        key = model_cache_key(assembly.scenario)
        model = self._models.get(key)
        if model is None:
            if len(self._models) > 2 * self._size:
                self._models.clear()
            model = self._models[key] = flight_model(assembly, self._knots)
        return _Row(index, assembly, MujocoPlant(assembly, model, "native"))

    def _hand_over(self, row: _Row) -> Future[FlightResult]:
        return self._pool.submit(lambda: self._result(row.finish()))

    def _fly(self, batch: Any, flying: dict[int, _Row], steps: int) -> int:
        """Fly the rows for some steps each; how many to take next."""
        places = np.array(list(flying), dtype=np.int32)
        any_model = next(iter(flying.values())).plant.model
        by_place = [
            row.plant.model if row else any_model for row in map(flying.get, range(self._size))
        ]
        batch.set_models(by_place)
        steps = max(steps, *(row.interval for row in flying.values()), 1)
        for place, row in flying.items():
            row.save(batch.state[place])
        before = batch.bind("time")[places].copy()
        callback = next(iter(flying.values())).plant.callback
        start = perf_counter()
        with control_callback(callback), quiet_warnings():
            batch.rollout(steps, record=(), ids=places)
        seconds = perf_counter() - start
        flown = batch.bind("time")[places] - before
        share = seconds * min(self._threads, len(flying)) / max(float(flown.sum()), 1e-9)
        for row, time in zip(flying.values(), flown.tolist(), strict=True):
            row.wall_time += share * time
        return max(64, min(int(steps * CALL_TIME / max(seconds, 1e-9)), 2 * steps))
