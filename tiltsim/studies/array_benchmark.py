"""Speed of many flights on the equations: steps per second, by engine and number of vehicles."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.base import EngineName
from tiltsim.engines.programs import recorder_head
from tiltsim.engines.steppers import LaneStepper
from tiltsim.laws.assembling import assemble
from tiltsim.plants.plant import initial_state, integrated, layout_of
from tiltsim.scenario.loading import load_scenario
from tiltsim.simulation.array_batch import numbers_of
from tiltsim.simulation.native_batch import lanes_for
from tiltsim.studies.peers import PEERS, Timing, running, speed, timed
from tiltsim_controllers.mathematics.scalar import Floats

TROTTING: Final = "ch04_tracking/circle#continuous_t2_modified"
"""The scenario flown: the circle with the continuous trot."""

STEADY: Final = "ch04_tracking/circle#fixed_modified"
"""The scenario for errors: the circle with constant tilts, here with the exact law."""

EXACT: Final = {f"controller.{key}": "exact" for key in ("decoupling", "gains", "decoupler")}

VEHICLES: Final = (1, 64, 1024, 16_384, 262_144)
TOTAL_STEPS: Final = 1_000_000  # steps of all vehicles together in one timing, roughly
ROUNDS: Final = 3
PEER_ROUNDS: Final = 5
PEER_STEP: Final = 0.002  # s
PEER_STEPS: Final = 500

ACCURACY_STEPS: Final = (0.008, 0.004, 0.002)
REFERENCE_STEP: Final = 0.0001
ACCURACY_DURATION: Final = 8.0
ACCURACY_VEHICLES: Final = 1024

Rows = list[dict[str, Any]]


class Kind(NamedTuple):
    """Keys of ``simulation`` on which the speed of a batch depends."""

    engine: EngineName
    precision: str = "float64"
    batch_functions: str = "exact"

    @property
    def name(self) -> str:
        """In a table of results."""
        return f"{self.engine}{', quick' if self.batch_functions == 'quick' else ''}"


@dataclass
class TimedBatch:
    """Vehicles, each with its own mass, which fly some steps whenever they are timed.

    ``position`` (m) is the first vehicle's at the end of its flight.

    Args:
        vehicles: Number of vehicles; all cores share them.
        kind: Engine, precision and functions.
        solver: One of `tiltsim.equations.solvers.SOLVERS`.
        timestep: s
        steps: Steps of a flight.
        address: The scenario.
        changes: Changes of the scenario by dotted key.
    """

    vehicles: int
    kind: Kind
    solver: str
    timestep: float
    steps: int
    address: str = TROTTING
    changes: Mapping[str, Any] = field(default_factory=dict)
    timings: list[Timing] = field(default_factory=list)

    def __post_init__(self) -> None:
        named = {f"simulation.{key}": value for key, value in self.kind._asdict().items()}
        named["simulation.plant"] = "thesis"
        assembly = assemble(load_scenario(self.address, {"expect": [], **self.changes, **named}))
        mass = assembly.setup.parameters.law.vehicle.mass
        masses = mass * (1.0 + 0.01 * np.linspace(-1.0, 1.0, self.vehicles))
        self.threads = min(os.cpu_count() or 1, self.vehicles)
        fly = self._on_arrays if self.kind.engine == "jax" else self._in_lanes
        self._parts = [fly(assembly, mass, part) for part in np.array_split(masses, self.threads)]

    def _on_arrays(self, assembly: Assembly, mass: float, masses: Floats) -> Callable[[], Floats]:
        from tiltsim.arrays.flying import Batch, course_of, double_precision

        course = course_of(assembly)._replace(
            solver=self.solver, timestep=self.timestep, steps=self.steps, record_steps=self.steps
        )
        numbers: list[float | None] = [*numbers_of(assembly)]
        numbers[numbers.index(mass)] = None
        batch = Batch(course, tuple(numbers), tuple(assembly.setup.knots))
        column = masses[:, np.newaxis].astype(self.kind.precision)

        def fly() -> Floats:
            with double_precision():
                none = np.zeros((len(masses), 0), self.kind.precision)
                return np.asarray(batch.record(column, none).samples[0, -1])

        return fly

    def _in_lanes(self, assembly: Assembly, mass: float, masses: Floats) -> Callable[[], Floats]:
        state = initial_state(assembly)
        layout = layout_of(assembly, len(state))._replace(solver=self.solver)
        flight = integrated(assembly, layout)._replace(timestep=self.timestep)
        now = [*state, *[0.0] * (layout.size - layout.states)]
        head = recorder_head(assembly, 0, 2, self.steps, self.steps)
        place, lanes = flight.user.tolist().index(mass), lanes_for(len(masses))
        samples = np.empty((len(masses), 2, len(assembly.loop.sample_fields)))
        starts = []
        for first in range(0, len(masses), lanes):
            stepper = LaneStepper(layout, lanes)
            for lane, one in enumerate(masses[first : first + lanes]):
                user = flight.user.copy()
                user[place] = one
                stepper.place(lane, flight._replace(user=user), now, head, samples[first + lane])
            starts.append((stepper, stepper.now.copy(), stepper.heads.copy()))

        def fly() -> Floats:
            for stepper, state, heads in starts:
                stepper.index[:], stepper.now[:], stepper.heads[:] = 0.0, state, heads
                stepper.advance(self.steps)
            return samples[0, -1]

        return fly

    def time(self) -> None:
        """Fly once."""
        with ThreadPoolExecutor(self.threads) as pool:
            self.timings.append(timed(lambda: self._fly_all(pool)))

    def _fly_all(self, pool: ThreadPoolExecutor) -> None:
        first, *_ = pool.map(lambda fly: fly(), self._parts)
        self.position = first[1:4]

    def row(self, case: str) -> dict[str, Any]:
        """A row of ``tiltsim bench --json``, with further columns; see `speed`."""
        return {
            "case": case,
            **self.kind._asdict(),
            "batch": f"{self.kind.name}, {self.kind.precision}",
            "integrator": self.solver,
            "vehicles": self.vehicles,
            "threads": self.threads,
            **speed(self.timings, self.vehicles * self.steps, self.timestep),
        }


def _in_rounds(timings: Sequence[Callable[[], None]], rounds: int) -> None:
    """Time all one after the other in each round; an additional first round compiles."""
    for _ in range(1 + rounds):
        for time in timings:
            time()


def _kinds() -> list[Kind]:
    """The batches that can be timed here."""
    arrays = [Kind("jax"), Kind("jax", "float32")] if find_spec("jax") else []
    return [Kind("native"), Kind("native", batch_functions="quick"), *arrays]


def bench_arrays(vehicles: Iterable[int] = VEHICLES) -> Rows:
    """Time batches on all cores, in lanes and in JAX, and flights at equal error."""
    rows = []
    for kind in _kinds():
        for number in vehicles:
            steps = min(10_000, max(10, TOTAL_STEPS // number))
            batch = TimedBatch(number, kind, "ode3", 0.001, steps)
            _in_rounds([batch.time], ROUNDS)
            rows.append(batch.row("arrays"))
    return rows


def bench_array_accuracy(timesteps: Iterable[float] = ACCURACY_STEPS) -> Rows:
    """Position error of RK4 for several time steps, and the speed of all cores together.

    The error (m) is the largest difference of a coordinate from the flight with the reference step,
    at the end of the flight.
    """

    def circling(timestep: float, vehicles: int, functions: str = "exact") -> TimedBatch:
        steps, kind = round(ACCURACY_DURATION / timestep), Kind("native", "float64", functions)
        return TimedBatch(vehicles, kind, "RK4", timestep, steps, STEADY, EXACT)

    reference = circling(REFERENCE_STEP, 1)
    reference.time()
    rows = []
    for functions in ("exact", "quick"):
        for timestep in timesteps:
            batch = circling(timestep, ACCURACY_VEHICLES, functions)
            _in_rounds([batch.time], ROUNDS)
            error = float(np.abs(batch.position - reference.position).max())
            rows.append(batch.row("array accuracy") | {"position_error": error})
    return rows


def bench_peer(name: str) -> Rows:
    """Time another simulator and ours in turns, with equal numbers of vehicles and time steps.

    Rows as in `bench_arrays`, with ``simulator``; ``ratio`` is to the peer's best speed.
    """
    case = PEERS[name]
    with ExitStack() as stack:
        peers = [stack.enter_context(running(name, devices)) for devices in case.devices]
        ours = [
            TimedBatch(case.vehicles, kind, "Euler", PEER_STEP, PEER_STEPS) for kind in _kinds()
        ]
        timings = [batch.time for batch in ours] + [peer.time for peer in peers]
        _in_rounds(timings, PEER_ROUNDS)
        rows = [batch.row("peer") | {"simulator": f"tiltsim, {batch.kind.name}"} for batch in ours]
        theirs = [peer.row() for peer in peers]
    best = max(row["steps_per_second"] for row in theirs)
    return [*theirs, *(row | {"ratio": row["steps_per_second"] / best} for row in rows)]
