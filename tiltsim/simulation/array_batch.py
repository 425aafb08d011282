"""Flights on equations of motion in JAX, many at once as rows of arrays.

Rows of a batch have one closed loop, one time step and one duration; they may differ in any number
of the scenario. All fly to the end of the duration; a row that ends early is cut there, and its
last interval is repeated step by step to find the step.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter
from typing import Final, Generic, TypeVar

import numpy as np

from tiltsim.arrays.flying import Batch, Recording, compile_batch, course_of, double_precision
from tiltsim.arrays.jax_programs import require_jax
from tiltsim.closed_loop.assembly import Assembly, program_key
from tiltsim.flight.flight import METRICS_ROWS, Flight, completed_flights
from tiltsim.plants.plant import initial_state
from tiltsim.simulation.simulate import TerminationMonitor, simulate_assembly
from tiltsim_controllers.mathematics.records import flatten, record_size
from tiltsim_controllers.mathematics.scalar import Floats

MEMORY: Final = 256 * 2**20  # bytes of the samples of all rows that fly together

ROUND_ROWS: Final = 1024
"""Large numbers of rows are multiples of it; it also fits the caches of a core."""

Result = TypeVar("Result")


def numbers_of(assembly: Assembly) -> tuple[float, ...]:
    """Inputs of `tiltsim.arrays.flying.Batch` from a flight, without knots."""
    return (
        *flatten((assembly.setup.parameters, assembly.reference)),
        *assembly.scenario.disturbance_acceleration,
        *initial_state(assembly),
    )


def batch_key(assembly: Assembly) -> object:
    """Equal for flights that may share a batch."""
    return course_of(assembly), program_key(assembly)


def _padded(rows: int) -> int:
    """A number of rows, at least the given one, from a small set: each is compiled."""
    return min(1 << (rows - 1).bit_length(), -(-rows // ROUND_ROWS) * ROUND_ROWS)


class ArrayBatch(Generic[Result]):
    """Flights with one `batch_key`.

    Args:
        assemblies: The flights.
        threads: Number of parts that fly at once.
        pool: Runs the threads.
        finish: Turns a flight into a result; samples are freed unless it keeps them.
    """

    def __init__(
        self,
        assemblies: Sequence[Assembly],
        threads: int,
        pool: ThreadPoolExecutor,
        finish: Callable[[Flight], Result],
    ) -> None:
        require_jax('simulation.engine = "jax"')
        self._assemblies, self._threads, self._pool = assemblies, threads, pool
        self._finish = finish
        self._course = course = course_of(assemblies[0])
        self._numbers = np.array([numbers_of(assembly) for assembly in assemblies])
        self._knots = np.array([assembly.setup.knots for assembly in assemblies])
        bits = self._numbers.view(np.int64)  # zeros of either sign are equal
        self._varies = (bits != bits[0]).any(axis=0)
        first = zip(self._varies, self._numbers[0], strict=True)
        common = tuple(None if varies else float(number) for varies, number in first)
        plans = self._knots.view(np.int64)
        self._one_plan = bool((plans == plans[0]).all())
        self._batch: Batch = compile_batch(
            course, common, tuple(assemblies[0].setup.knots) if self._one_plan else None
        )
        samples = 2 + course.steps // course.record_steps
        row = samples * len(course.loop.sample_fields) * 8
        self._most = max(1, MEMORY // row // threads)

    def results(self) -> Iterator[tuple[int, Result]]:
        """Index and result of each flight, in order."""
        count = len(self._assemblies)
        size = min(self._most, _padded(-(-count // self._threads)))
        parts = [range(start, min(start + size, count)) for start in range(0, count, size)]
        for start in range(0, len(parts), self._threads):
            began = perf_counter()
            together = parts[start : start + self._threads]
            flown = list(self._pool.map(lambda part: self._fly(part, size), together))
            share = (perf_counter() - began) / sum(map(len, together))
            for part, (recording, closer) in zip(together, flown, strict=True):
                for start in range(0, len(part), METRICS_ROWS):
                    rows = range(start, min(start + METRICS_ROWS, len(part)))
                    yield from self._finished(part, rows, recording, closer, share)

    def _fly(self, part: range, size: int) -> tuple[Recording, Floats]:
        """Samples of some flights, and steps of the intervals in which some of them ended."""
        import jax

        rows = [*part, *[part[-1]] * (size - len(part))]  # one shape is compiled once
        with double_precision():
            numbers = self._numbers[rows][:, self._varies].astype(self._course.dtype)
            knots = self._knots[rows].astype(self._course.dtype)
            recording = self._batch.record(numbers, knots)
            alive = np.asarray(recording.alive)[: len(part), -1]
            closer = np.empty(0)
            if not alive.all():
                closer = np.asarray(self._batch.approach(numbers, knots, recording.last), float)
            return jax.device_get(recording), closer

    def _finished(
        self, part: range, rows: range, recording: Recording, closer: Floats, seconds: float
    ) -> Iterator[tuple[int, Result]]:
        """Index and result of flights that are some rows of a part."""
        course = self._course
        samples = np.array(recording.samples[rows.start : rows.stop], float)
        steps = np.minimum(np.arange(samples.shape[1]) * course.record_steps, course.steps)
        samples[:, :, 0] = steps * course.timestep  # not rounded
        indices = part[rows.start : rows.stop]
        whole = [i for i, row in enumerate(rows) if recording.alive[row].all()]
        completed = completed_flights(
            [self._assemblies[indices[i]] for i in whole],
            self._numbers[indices][whole, : record_size(course.loop.parameters)],
            samples[whole],
            "jax",
            [seconds] * len(whole),
        )
        flights = dict(zip(whole, completed, strict=True))
        for i, (row, index) in enumerate(zip(rows, indices, strict=True)):
            flight = flights.get(i)
            if flight is None:
                flight = self._ended(index, row, samples[i], recording, closer, seconds)
            yield index, self._finish(flight)

    def _ended(
        self,
        index: int,
        row: int,
        samples: Floats,
        recording: Recording,
        closer: Floats,
        seconds: float,
    ) -> Flight:
        """The flight of a row that ended early; ``closer`` are its samples by step at the end."""
        assembly, course = self._assemblies[index], self._course
        monitor = TerminationMonitor(assembly)
        end = monitor.check(None, samples[0])
        count = 1 if end else max(1, int(np.count_nonzero(recording.alive[row])))
        kept = list(samples[:count])
        if end is None:
            closer = closer[row].copy()
            steps = recording.last.index[row] + 1 + np.arange(len(closer))
            closer[:, 0] = steps * course.timestep
            ends = ((monitor.check(None, sample), sample) for sample in closer)
            end, last = next((found for found in ends if found[0] is not None), (None, closer[0]))
            if end is None:  # rounding: the limit is reached later
                return simulate_assembly(assembly)
            kept += [last] if np.isfinite(last).all() else []
        return Flight(assembly, np.array(kept), end, "jax", seconds)
