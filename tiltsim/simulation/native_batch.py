"""Flights as machine code, many at once on all cores: in MuJoCo, and on equations of motion.

A flight has a row of MuJoCo's batch, or a lane of machine code, with its own parameters. It records
its own samples and stops when it has all of them or ends early; then the next flight takes its
place. So memory holds one flight per row, or a part of the flights in lanes, for any number of
flights.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import groupby
from time import perf_counter
from typing import Any, Final, Generic, TypeVar

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import RECORDER, steps_taken
from tiltsim.engines.control import control_callback
from tiltsim.engines.machine_code import widest
from tiltsim.engines.programs import SAMPLES, TERMINATED, recorder_head
from tiltsim.engines.steppers import LaneStepper
from tiltsim.flight.flight import METRICS_ROWS, Flight, completed_flights
from tiltsim.flight.metrics import End
from tiltsim.plants.mujoco_plant import MujocoPlant, flight_model, model_cache_key
from tiltsim.plants.plant import EquationsPlant, initial_state, integrated, layout_of, take_sample
from tiltsim.simulation.simulate import TerminationMonitor, fly_intervals, intervals_of
from tiltsim_controllers.mathematics.scalar import Floats

ROWS_PER_THREAD: Final = 24
"""Rows of a batch: enough that no thread waits long for the last one of a call."""

MEMORY: Final = 256 * 2**20  # bytes of the samples of all flights that are not finished

CALL_TIME: Final = 0.25
"""Wall time (s) of machine code between checks of the flights and the keyboard."""

FEWEST_STEPS: Final = 1024  # steps of the first call of lanes, and at least of others

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


# --- on equations of motion ---------------------------------------------------------------------


def lanes_for(flights: int) -> int:
    """The number of lanes for some flights with one layout."""
    return min(widest(), 1 << (flights - 1).bit_length())


@dataclass
class _Flown:
    """A flight while it is in a lane, and after."""

    index: int  # its place in the batch
    assembly: Assembly
    samples: Floats  # memory for them, the first at time zero
    taken: int = 0  # number of samples
    terminated: bool = False  # whether the last sample ends the flight
    numbers: Floats = field(default_factory=lambda: np.empty(0))  # parameters of its loop
    saved: Floats = field(default_factory=lambda: np.empty(0))
    """Index, state and inputs in force at the last sample before the end."""
    seconds: float = 0.0  # that it took

    @property
    def alike(self) -> tuple[object, ...]:
        """Equal for flights whose metrics can be computed together."""
        return self.terminated, self.samples[:, 0].tobytes(), self.assembly.setup.knots


class LaneBatch(Generic[Result]):
    """Flights with one `tiltsim.engines.steppers.Layout`.

    Args:
        assemblies: The flights.
        lanes: Number of lanes.
        threads: Number of threads; each flies its own lanes.
        pool: Runs the threads.
        finish: Turns a flight into a result; samples are freed unless it keeps them.
    """

    def __init__(
        self,
        assemblies: Sequence[Assembly],
        lanes: int,
        threads: int,
        pool: ThreadPoolExecutor,
        finish: Callable[[Flight], Result],
    ) -> None:
        self._assemblies, self._lanes, self._pool = assemblies, lanes, pool
        self._finish, self._fields = finish, len(assemblies[0].loop.sample_fields)
        self._layout = layout_of(assemblies[0], len(initial_state(assemblies[0])))
        self._workers = max(1, min(threads, -(-len(assemblies) // lanes)))
        self._stopped = False

    def results(self) -> Iterator[tuple[int, Result]]:
        """Index and result of each flight."""
        waiting = deque(enumerate(self._assemblies))
        try:
            while waiting:
                yield from self._fly_part(self._next_part(waiting))
        finally:
            self._stopped = True

    def _next_part(self, waiting: deque[tuple[int, Assembly]]) -> deque[_Flown]:
        """The flights whose samples fit into memory."""
        part: deque[_Flown] = deque()
        numbers = 0
        while waiting:
            index, assembly = waiting[0]
            shape = 1 + len(intervals_of(assembly)), self._fields
            numbers += shape[0] * shape[1]
            if part and 8 * numbers > MEMORY:
                break
            waiting.popleft()
            part.append(_Flown(index, assembly, np.empty(shape)))
        return part

    def _fly_part(self, part: deque[_Flown]) -> Iterator[tuple[int, Result]]:
        workers = [self._pool.submit(self._work, part) for _ in range(self._workers)]
        flown = [flight for worker in workers for flight in worker.result()]
        flown.sort(key=lambda one: one.index)
        together = [
            group[start : start + METRICS_ROWS]
            for _, found in groupby(flown, key=lambda one: one.alike)
            for group in [list(found)]
            for start in range(0, len(group), METRICS_ROWS)
        ]
        unfinished: deque[Future[list[tuple[int, Result]]]] = deque(
            self._pool.submit(self._finished, group) for group in together
        )
        while unfinished:
            yield from unfinished.popleft().result()

    def _work(self, waiting: deque[_Flown]) -> list[_Flown]:
        """Fly flights until none is waiting."""
        finished: list[_Flown] = []
        flying: dict[int, _Flown] = {}
        lanes, steps = LaneStepper(self._layout, self._lanes), FEWEST_STEPS
        while not self._stopped:
            for lane in range(self._lanes):
                if lane not in flying and (flight := _taken_from(waiting)) is not None:
                    self._place(lanes, lane, flight)
                    flying[lane] = flight
            if not flying:
                break
            before = lanes.index[0].copy()
            start = perf_counter()
            lanes.advance(steps, until_one_is_over=len(flying) == self._lanes)
            seconds = perf_counter() - start
            flown = lanes.index[0] - before
            share = seconds / max(float(flown.sum()), 1.0)
            for lane in [*flying]:
                flight = flying[lane]
                flight.seconds += share * float(flown[lane])
                taken, terminated = lanes.heads[[SAMPLES, TERMINATED], lane].tolist()
                if terminated or taken == len(flight.samples):
                    flight.taken, flight.terminated = int(taken), bool(terminated)
                    flight.saved = lanes.saved[:, lane].copy()
                    finished.append(flying.pop(lane))
            pace = float(flown.max()) / max(seconds, 1e-9)
            steps = int(min(max(CALL_TIME * pace, FEWEST_STEPS), 2.0 * steps))
        return finished

    def _place(self, lanes: LaneStepper, lane: int, flight: _Flown) -> None:
        """Put a flight into a lane."""
        assembly, intervals = flight.assembly, intervals_of(flight.assembly)
        now = [*initial_state(assembly), *[0.0] * (self._layout.size - self._layout.states)]
        flown = integrated(assembly, self._layout)
        flight.numbers = flown.user[: assembly.loop.record_size]
        head = recorder_head(assembly, 0, len(flight.samples), intervals[0], intervals[-1])
        lanes.place(lane, flown, now, head, flight.samples)

    def _finished(self, flown: list[_Flown]) -> list[tuple[int, Result]]:
        """Results of flights that are `_Flown.alike`."""
        if flown[0].terminated:
            return [(one.index, self._finish(_ended(one))) for one in flown]
        assemblies = [one.assembly for one in flown]
        numbers = np.array([one.numbers for one in flown])
        samples = np.stack([one.samples for one in flown])
        seconds = [one.seconds for one in flown]
        flights = completed_flights(assemblies, numbers, samples, "native", seconds)
        return [(one.index, self._finish(f)) for one, f in zip(flown, flights, strict=True)]


def _taken_from(waiting: deque[Any]) -> Any:
    """The first of a queue that other threads may empty; None if it is empty."""
    try:
        return waiting.popleft()
    except IndexError:
        return None


def _ended(flown: _Flown) -> Flight:
    """A flight that ended early: its end is located step by step, as for a single flight."""
    assembly = flown.assembly
    plant, monitor = EquationsPlant(assembly, "native"), TerminationMonitor(assembly)
    samples = [*flown.samples[: max(1, flown.taken - 1)]]
    end = monitor.check(plant, samples[0])
    if end is None:
        if flown.taken > 1:
            plant.state = flown.saved
        found, end = fly_intervals(plant, monitor, intervals_of(assembly)[len(samples) - 1 :])
        samples += found
    end = end or End("completed", plant.time)
    return Flight(assembly, np.array(samples), end, "native", flown.seconds)
