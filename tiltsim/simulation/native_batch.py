"""Flights as machine code, many at once on all cores: in MuJoCo, and on equations of motion.

A thread flies one flight in MuJoCo after the other. On equations of motion, a flight has a lane of
machine code with its own parameters; it records its samples and stops when it has all of them or
ends early; then the next flight takes its place.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import groupby
from time import perf_counter
from typing import Any, Final, Generic, TypeVar

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.machine_code import widest
from tiltsim.engines.programs import SAMPLES, TERMINATED, recorder_head
from tiltsim.engines.steppers import LaneStepper
from tiltsim.flight.flight import METRICS_ROWS, Flight, completed_flights
from tiltsim.flight.metrics import End
from tiltsim.plants.mujoco_plant import MujocoPlant, flight_model, model_cache_key
from tiltsim.plants.plant import EquationsPlant, initial_state, integrated, layout_of
from tiltsim.simulation.simulate import (
    TerminationMonitor,
    fly_chunks,
    intervals_of,
    simulate_assembly,
)
from tiltsim_controllers.mathematics.scalar import Floats

WAITING: Final = 8  # flights in MuJoCo that each thread has ahead
MODELS: Final = 64  # models of MuJoCo that are kept for flights to come

MEMORY: Final = 256 * 2**20  # bytes of the samples of all flights in lanes that are not finished

CALL_TIME: Final = 0.25
"""Wall time (s) of machine code between checks of the flights and the keyboard."""

FEWEST_STEPS: Final = 1024  # steps of the first call of lanes, and at least of others

Result = TypeVar("Result")


def fly_in_mujoco(
    assemblies: Sequence[Assembly],
    threads: int,
    pool: ThreadPoolExecutor,
    finish: Callable[[Flight], Result],
) -> Iterator[tuple[int, Result]]:
    """Index and result of each flight in MuJoCo, in order; all have one closed loop.

    They share a control callback, so threads step them at the same time.

    Args:
        assemblies: The flights.
        threads: Number of threads.
        pool: Runs the threads.
        finish: Turns a flight into a result; samples are freed unless it keeps them.
    """
    knots = max(len(assembly.setup.knots) for assembly in assemblies)
    models: dict[str, mujoco.MjModel] = {}
    flying: deque[Future[Result]] = deque()
    stopped = False

    def report(_time: float) -> None:
        if stopped:
            raise KeyboardInterrupt

    def fly(assembly: Assembly, model: mujoco.MjModel) -> Result:
        plant = MujocoPlant(assembly, model, "native")
        return finish(simulate_assembly(assembly, plant=plant, report=report))

    try:
        for index, assembly in enumerate(assemblies):
            key = model_cache_key(assembly.scenario)
            if key not in models:
                if len(models) == MODELS:
                    models.clear()
                models[key] = flight_model(assembly, knots)
            flying.append(pool.submit(fly, assembly, models[key]))
            if len(flying) > WAITING * threads:
                yield index + 1 - len(flying), flying.popleft().result()
        for index in range(len(assemblies) - len(flying), len(assemblies)):
            yield index, flying.popleft().result()
    finally:
        stopped = True
        for future in flying:
            future.cancel()


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
        intervals = intervals_of(assembly)[len(samples) - 1 :]
        found, end = fly_chunks(plant, monitor, [(1, steps) for steps in intervals])
        samples += found
    end = end or End("completed", plant.time)
    return Flight(assembly, np.array(samples), end, "native", flown.seconds)
