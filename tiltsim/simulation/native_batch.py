"""Flights with one closed loop, stepped together by all cores.

A row of the batch is a flight with its own model and parameters. It records its own samples and
stops when it has all of them or ends early; its place goes to the next flight at once. So memory
holds one flight per row, for any number of flights.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from time import perf_counter
from typing import Any, Final, Generic, TypeVar

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import RECORDER, steps_taken
from tiltsim.engines.control import control_callback
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.plants.mujoco_plant import MujocoPlant, flight_model, model_cache_key
from tiltsim.plants.plant import take_sample
from tiltsim.simulation.simulate import TerminationMonitor, fly_intervals, intervals_of
from tiltsim_controllers.mathematics.scalar import Floats

ROWS_PER_THREAD: Final = 24
"""Rows of a batch: enough that no thread waits long for the last one of a call."""

MEMORY: Final = 256 * 2**20
"""Bytes of the samples of all rows together."""

CALL_TIME: Final = 0.25
"""Wall time (s) of a batch between checks of the rows and the keyboard."""

Result = TypeVar("Result")


class _Row:
    """A flight in a row of a batch."""

    def __init__(self, index: int, assembly: Assembly, plant: MujocoPlant) -> None:
        self.index, self.assembly, self.plant = index, assembly, plant
        self.monitor = TerminationMonitor(assembly)
        self.first = take_sample(plant)
        self.end = self.monitor.check(plant, self.first)
        self.interval = assembly.scenario.simulation.record_steps
        self.intervals = intervals_of(assembly)
        last = self.intervals[-1]
        self.recorder = plant.recorder(len(self.intervals), self.interval, last)
        self.saved = [(0, plant.state)]  # steps and state at the start of the last two calls
        self.wall_time = 0.0

    def save(self, state: Floats) -> None:
        """Save the state at the start of a call."""
        steps = steps_taken(state[self.plant.header_offset :])
        self.saved = [self.saved[-1], (steps, state.copy())]

    def finish(self) -> Flight:
        """The flight; an early end is located step by step, as for a single flight."""
        samples = list(self.recorder.samples)
        if self.recorder.terminated:
            samples.pop()
        if self.end is None and len(samples) < len(self.intervals):
            samples = self._locate_end(samples)
        end = self.end or End("completed", float(samples[-1][0]))
        everything = np.array([self.first, *samples])
        return Flight(self.assembly, everything, end, "native", self.wall_time)

    def _locate_end(self, samples: list[Floats]) -> list[Floats]:
        steps, state = self.saved[0]
        plant = self.plant
        header = plant.header_offset
        state = state.copy()
        state[header + RECORDER] = 0.0
        plant.state = state
        plant.advance(sum(self.intervals[: len(samples)]) - steps)
        found, self.end = fly_intervals(plant, self.monitor, self.intervals[len(samples) :])
        return samples + found


class NativeBatch(Generic[Result]):
    """Flights with one closed loop in a `mujoco.batch.Batch`.

    Args:
        assemblies: The flights, in the order of their places.
        threads: Number of threads that step rows.
        pool: Pool that computes the results.
        result: Makes the result of a flight.
    """

    def __init__(
        self,
        assemblies: Sequence[Assembly],
        threads: int,
        pool: ThreadPoolExecutor,
        result: Callable[[Flight], Result],
    ) -> None:
        self._waiting = deque(enumerate(assemblies))
        self._threads, self._pool, self._result = threads, pool, result
        self._knots = max(len(assembly.setup.knots) for assembly in assemblies)
        self._models: dict[str, mujoco.MjModel] = {}
        simulations = [assembly.scenario.simulation for assembly in assemblies]
        largest = max(s.steps // s.record_steps for s in simulations) + 2
        fitting = MEMORY // (8 * len(assemblies[0].loop.sample_fields) * largest)
        size = max(1, min(len(assemblies), ROWS_PER_THREAD * threads, fitting))
        self._rows: list[_Row | None] = [None] * size
        self._batch: Any = None
        self._unfinished: deque[tuple[int, Future[Result]]] = deque()

    def results(self) -> Iterator[tuple[int, Result]]:
        """Pairs of a flight's place and its result, in the order in which they become available."""
        steps = 256
        while True:
            self._fill_free_rows()
            flying = {place: row for place, row in enumerate(self._rows) if row is not None}
            if flying:
                steps = self._step(flying, steps)
                self._free_finished_rows(flying)
            while self._unfinished and (self._unfinished[0][1].done() or not flying):
                yield self._wait_for_next()
            if len(self._unfinished) > 2 * len(self._rows):  # the pool cannot keep up
                yield self._wait_for_next()
            if not flying and not self._waiting:
                return

    def _wait_for_next(self) -> tuple[int, Result]:
        index, future = self._unfinished.popleft()
        return index, future.result()

    def _fill_free_rows(self) -> None:
        from mujoco.batch import Batch

        for place in range(len(self._rows)):
            while self._rows[place] is None and self._waiting:
                row = self._take_next()
                if row.end is not None:
                    self._finish_in_pool(row)
                    continue
                if self._batch is None:
                    self._batch = Batch(row.plant.model, len(self._rows), self._threads)
                self._rows[place] = row
                self._batch.state[place] = row.saved[-1][1]
                self._batch.state[place, row.plant.header_offset + RECORDER] = row.recorder.address

    def _free_finished_rows(self, flying: Mapping[int, _Row]) -> None:
        for place, row in flying.items():
            recorder = row.recorder
            if recorder.full or recorder.terminated or self._batch.warning[place].any():
                self._batch.warning[place] = 0
                self._rows[place] = None
                self._finish_in_pool(row)

    def _finish_in_pool(self, row: _Row) -> None:
        future = self._pool.submit(lambda: self._result(row.finish()))
        self._unfinished.append((row.index, future))

    def _take_next(self) -> _Row:
        index, assembly = self._waiting.popleft()
        key = model_cache_key(assembly.scenario)
        model = self._models.get(key)
        if model is None:
            if len(self._models) > 2 * len(self._rows):
                self._models.clear()
            model = self._models[key] = flight_model(assembly, self._knots)
        return _Row(index, assembly, MujocoPlant(assembly, model, "native"))

    def _step(self, flying: Mapping[int, _Row], steps: int) -> int:
        """Step every row; returns how many steps to take next."""
        batch, any_row = self._batch, next(iter(flying.values()))
        places = np.array(list(flying), dtype=np.int32)
        batch.set_models([(row or any_row).plant.model for row in self._rows])
        steps = max(steps, *(row.interval for row in flying.values()), 1)
        for place, row in flying.items():
            row.save(batch.state[place])
        before = batch.bind("time")[places].copy()
        start = perf_counter()
        with control_callback(any_row.plant.callback):
            batch.rollout(steps, record=(), ids=places)
        seconds = perf_counter() - start
        flown = batch.bind("time")[places] - before
        share = seconds * min(self._threads, len(flying)) / max(float(flown.sum()), 1e-9)
        for row, time in zip(flying.values(), flown.tolist(), strict=True):
            row.wall_time += share * time
        return max(64, min(int(steps * CALL_TIME / max(seconds, 1e-9)), 2 * steps))
