"""Speed of flights on arrays: vehicle steps per second, by number of vehicles and precision."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from tiltsim.arrays.flying import Batch, course_of, double_precision
from tiltsim.arrays.jax_arrays import require_jax
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import load_scenario
from tiltsim.simulation.array_batch import numbers_of
from tiltsim.studies.peers import PEERS, Timing, running, speed, timed
from tiltsim_controllers.mathematics.scalar import Floats

TROTTING: Final = "ch04_tracking/circle#continuous_t2_modified"
"""What is flown: the circle with the continuous trot."""

STEADY: Final = "ch04_tracking/circle#fixed_modified"
"""What is flown to measure errors: the circle with constant tilts, here with the exact law."""

EXACT: Final = {f"controller.{key}": "exact" for key in ("decoupling", "gains", "decoupler")}

VEHICLES: Final = (1, 64, 1024, 16_384, 262_144)
PRECISIONS: Final = ("float64", "float32")
TOTAL_STEPS: Final = 1_000_000
"""Steps of all vehicles together in one timing, roughly."""

ROUNDS: Final = 3
PEER_ROUNDS: Final = 5
PEER_STEP: Final = 0.002  # s
PEER_STEPS: Final = 500

ACCURACY_STEPS: Final = (0.008, 0.004, 0.002)
REFERENCE_STEP: Final = 0.0001
ACCURACY_DURATION: Final = 8.0
ACCURACY_VEHICLES: Final = 1024

Rows = list[dict[str, Any]]


@dataclass
class TimedBatch:
    """Vehicles with a mass of their own each, which fly so many steps when they are timed.

    ``position`` (m) is that of the first at the end of its flight.

    Args:
        vehicles: How many; all cores share them.
        precision: "float64" or "float32".
        solver: One of `tiltsim.equations.solvers.SOLVERS`.
        timestep: s
        steps: Of a flight.
        address: The scenario.
        changes: To the scenario.
    """

    vehicles: int
    precision: str
    solver: str
    timestep: float
    steps: int
    address: str = TROTTING
    changes: Mapping[str, Any] = field(default_factory=dict)
    timings: list[Timing] = field(default_factory=list)

    def __post_init__(self) -> None:
        simulation = {"plant": "thesis", "engine": "jax", "precision": self.precision}
        named = {f"simulation.{key}": value for key, value in simulation.items()}
        assembly = assemble(load_scenario(self.address, {"expect": [], **self.changes, **named}))
        self.course = course_of(assembly)._replace(
            solver=self.solver, timestep=self.timestep, steps=self.steps, record_steps=self.steps
        )
        numbers: list[float | None] = [*numbers_of(assembly)]
        mass = assembly.setup.parameters.law.vehicle.mass
        numbers[numbers.index(mass)] = None
        self.threads = min(os.cpu_count() or 1, self.vehicles)
        self._batch = Batch(self.course, tuple(numbers), tuple(assembly.setup.knots))
        masses = mass * (1.0 + 0.01 * np.linspace(-1.0, 1.0, self.vehicles))
        column = masses[:, np.newaxis].astype(self.precision)
        self._parts = np.array_split(column, self.threads)

    def time(self) -> None:
        """Fly once."""
        with ThreadPoolExecutor(self.threads) as pool:
            self.timings.append(timed(lambda: self._fly_all(pool)))

    def _fly_all(self, pool: ThreadPoolExecutor) -> None:
        first, *_ = pool.map(self._fly, self._parts)
        self.position = first[0, -1, 1:4]

    def _fly(self, masses: Floats) -> Floats:
        with double_precision():
            none = np.zeros((len(masses), 0), self.precision)
            return np.asarray(self._batch.record(masses, none).samples)

    def row(self, case: str) -> dict[str, Any]:
        """As of ``tiltsim bench --json``, with further columns; see `speed`."""
        return {
            "case": case,
            "engine": "jax",
            "integrator": self.solver,
            "vehicles": self.vehicles,
            "threads": self.threads,
            "precision": self.precision,
            **speed(self.timings, self.vehicles * self.steps, self.timestep),
        }


def _in_rounds(timings: Sequence[Callable[[], None]], rounds: int) -> None:
    """Time all one after the other, so many times; the first round compiles."""
    for _ in range(1 + rounds):
        for time in timings:
            time()


def bench_arrays(vehicles: Iterable[int] = VEHICLES) -> Rows:
    """Time batches in JAX on all cores, and flights at equal error."""
    require_jax("tiltsim bench --arrays")
    rows = []
    for precision in PRECISIONS:
        for number in vehicles:
            steps = min(10_000, max(10, TOTAL_STEPS // number))
            batch = TimedBatch(number, precision, "ode3", 0.001, steps)
            _in_rounds([batch.time], ROUNDS)
            rows.append(batch.row("arrays"))
    return rows


def bench_array_accuracy(timesteps: Iterable[float] = ACCURACY_STEPS) -> Rows:
    """Position error of RK4 for several time steps, and the speed of all cores together.

    The error (m) is the largest difference of a coordinate from the flight with the reference step,
    at the end of the flight.
    """

    def circling(timestep: float, vehicles: int) -> TimedBatch:
        steps = round(ACCURACY_DURATION / timestep)
        return TimedBatch(vehicles, "float64", "RK4", timestep, steps, STEADY, EXACT)

    reference = circling(REFERENCE_STEP, 1)
    reference.time()
    rows = []
    for timestep in timesteps:
        batch = circling(timestep, ACCURACY_VEHICLES)
        _in_rounds([batch.time], ROUNDS)
        error = float(np.abs(batch.position - reference.position).max())
        rows.append(batch.row("array accuracy") | {"position_error": error})
    return rows


def bench_peer(name: str) -> Rows:
    """Time another simulator and ours in turns, with equal numbers of vehicles and time steps.

    Rows as those of `bench_arrays`, with ``simulator``; ``ratio`` is to the peer's best speed.
    """
    require_jax(f"tiltsim bench --peer {name}")
    case = PEERS[name]
    with ExitStack() as stack:
        peers = [stack.enter_context(running(name, devices)) for devices in case.devices]
        ours = [
            TimedBatch(case.vehicles, precision, "Euler", PEER_STEP, PEER_STEPS)
            for precision in reversed(PRECISIONS)
        ]
        timings = [batch.time for batch in ours] + [peer.time for peer in peers]
        _in_rounds(timings, PEER_ROUNDS)
        rows = [batch.row("peer") | {"simulator": "tiltsim"} for batch in ours]
        theirs = [peer.row() for peer in peers]
    best = max(row["steps_per_second"] for row in theirs)
    return [*theirs, *(row | {"ratio": row["steps_per_second"] / best} for row in rows)]
