"""Flying what the report needs, on both plants, and keeping it: a second report takes seconds.

The folder holds one JSON file a flight, named by a digest of all that its numbers depend on: the
resolved scenario (less its titles and expectations), the sources of the core and of the models,
and the versions of the packages that compute. Flights are kept one by one as they end, so that an
interrupted report goes on where it stopped.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

from tiltsim.engines.cache import core_sources
from tiltsim.errors import InputError
from tiltsim.plants.engine_choice import with_engine
from tiltsim.report.claims import registered_claims
from tiltsim.report.model import AnalysisClaim, Value, plain
from tiltsim.resources import shipped_folder
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.metric_names import WALL_CLOCK_METRICS
from tiltsim.simulation.shared_engine import shared_engine
from tiltsim.system.files import replacing
from tiltsim.system.processes import in_processes

if TYPE_CHECKING:
    from tiltsim.engines.base import EngineName
    from tiltsim.flight.flight import Flight
    from tiltsim.scenario.scenario import Scenario

Plant = Literal["thesis", "mujoco"]
PLANTS: Final[tuple[Plant, ...]] = ("thesis", "mujoco")

_OF_THE_WHOLE: Final = ("final_", "sup_", "altitude_settling_time")
"""First letters of metrics that only a flight to its end has."""


@dataclass(frozen=True)
class Record:
    """What the report keeps of one flight."""

    address: str
    plant: Plant
    metrics: dict[str, float | bool]
    end: str  # completed | diverged | singular
    end_time: float  # s
    cause: str

    @property
    def lost(self) -> bool:
        """Whether it ended early."""
        return self.end != "completed"


@dataclass(frozen=True)
class Refusal:
    """Why a scenario does not fly on a plant, in one line."""

    reason: str


Flights = Mapping[tuple[str, Plant], Record | Refusal]


@dataclass(frozen=True)
class Plan:
    """A scenario of the report, and how it goes on each plant."""

    address: str
    scenario: Scenario
    plants: dict[Plant, Scenario | Refusal]


@dataclass(frozen=True)
class _Task:
    address: str
    plant: Plant
    key: str


def plan_flights(addresses: list[str]) -> list[Plan]:
    """Scenarios by address, on both plants. Raises `InputError` where one is invalid."""
    plans = []
    for address in addresses:
        scenario = load_scenario(address)
        plants: dict[Plant, Scenario | Refusal] = {}
        for plant in PLANTS:
            if plant == scenario.simulation.plant:
                plants[plant] = scenario
                continue
            try:
                plants[plant] = variant_for(address, plant)
            except InputError as error:
                plants[plant] = Refusal(str(error).removeprefix(f"{address}: "))
        plans.append(Plan(address, scenario, plants))
    return plans


def variant_for(address: str, plant: Plant) -> Scenario:
    """A scenario on a plant. Raises `InputError` where it is invalid or does not fly there."""
    return load_scenario(address, {"simulation.plant": plant})


def fly(
    plans: list[Plan],
    folder: Path,
    jobs: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[tuple[str, Plant], Record | Refusal]:
    """Records of scenarios on both plants, from the folder where they are kept there.

    Parameters
    ----------
    plans
        What to fly, from `plan_flights`.
    folder
        Where records are kept; made where it is missing.
    jobs
        Processes.
    progress
        Called with the flights that are done, of how many.

    Raises
    ------
    InputError
        If a process dies or fails.
    """
    folder.mkdir(parents=True, exist_ok=True)
    flights: dict[tuple[str, Plant], Record | Refusal] = {}
    missing: dict[_Task, Scenario] = {}
    for plan in plans:
        for plant, scenario in plan.plants.items():
            if isinstance(scenario, Refusal):
                flights[plan.address, plant] = scenario
                continue
            key = flight_key(scenario)
            record = read_record(folder, key)
            if record is None:
                missing[_Task(plan.address, plant, key)] = scenario
            else:
                flights[plan.address, plant] = record
    total = len(plans) * len(PLANTS)
    progress(len(flights), total)
    # The longest first, so that no process ends up alone with one of them.
    tasks = sorted(missing, key=lambda task: -missing[task].simulation.steps)
    engine = shared_engine(list(missing.values())) if missing else None
    for task, record in _fly_all(tasks, partial(_fly_one, folder=folder, engine=engine), jobs):
        flights[task.address, task.plant] = record
        progress(len(flights), total)
    return flights


def analyze(folder: Path, jobs: int) -> dict[str, Value]:
    """The measured values of all claims that are computed, by `AnalysisClaim.key`.

    Kept in the folder like flights, for as long as neither the core nor the claims change.

    Raises
    ------
    InputError
        If a claim cannot be computed or a process dies.
    """
    digest = sources_digest([*Path(__file__).parent.rglob("*.py")], code_digest().hex()).hex()
    path = folder / f"analysis-{digest[:24]}.json"
    try:
        kept = json.loads(path.read_bytes())
    except (OSError, ValueError):
        kept = {}
    values: dict[str, Value] = {
        key: tuple(value) if isinstance(value, list) else value for key, value in kept.items()
    }
    missing = [key for key in _analysis_claims() if key not in values]
    if not missing:
        return values
    if jobs == 1:
        values |= {key: _analyze_one(key) for key in missing}
    else:
        for key, future in in_processes(_analyze_one, missing, jobs):
            error = future.exception()
            if error is not None:
                raise InputError(f"{key}: {type(error).__name__}: {error}") from error
            values[key] = future.result()
    folder.mkdir(parents=True, exist_ok=True)
    keep(path, json.dumps(values, indent=1).encode())
    return values


def _analysis_claims() -> dict[str, AnalysisClaim]:
    return {claim.key: claim for claim in registered_claims() if isinstance(claim, AnalysisClaim)}


def _analyze_one(key: str) -> Value:
    return plain(_analysis_claims()[key].measure())


def _fly_all(
    tasks: list[_Task], work: Callable[[_Task], Record], jobs: int
) -> Iterator[tuple[_Task, Record]]:
    if jobs == 1 or len(tasks) < 2:
        yield from ((task, work(task)) for task in tasks)
        return
    for task, future in in_processes(work, tasks, jobs):
        error = future.exception()
        if error is not None:
            raise InputError(
                f"{task.address} on the {task.plant} plant: {type(error).__name__}: {error}"
            ) from error
        yield task, future.result()


def _fly_one(task: _Task, folder: Path, engine: EngineName | None) -> Record:
    from tiltsim.simulation.simulate import simulate

    scenario = variant_for(task.address, task.plant)
    if engine is not None and scenario.simulation.engine == "auto":
        scenario = with_engine(scenario, engine)
    flight = simulate(scenario)
    if flight.end.kind == "interrupted":
        raise KeyboardInterrupt
    record = make_record(task.address, task.plant, flight)
    keep(folder / f"{task.key}.json", json.dumps(asdict(record), indent=1).encode())
    return record


def make_record(address: str, plant: Plant, flight: Flight) -> Record:
    """What the report keeps of a flight.

    A lost flight has no final values and no suprema: those of the moment of the loss would pass
    for what a steady flight reached.
    """
    lost = flight.end.kind != "completed"
    metrics = {
        name: value
        for name, value in flight.metrics().items()
        if name not in WALL_CLOCK_METRICS and not (lost and name.startswith(_OF_THE_WHOLE))
    }
    return Record(address, plant, metrics, flight.end.kind, flight.end.time, flight.end.cause)


def read_record(folder: Path, key: str) -> Record | None:
    """A kept record, None where there is none that can be read."""
    try:
        return Record(**json.loads((folder / f"{key}.json").read_bytes()))
    except (OSError, ValueError, TypeError):
        return None


def keep(path: Path, content: bytes) -> None:
    """Write a file at once or not at all."""
    with replacing(path) as draft:
        draft.write_bytes(content)


def flight_key(scenario: Scenario) -> str:
    """Digest of all that a flight's numbers depend on."""
    content = scenario.model_dump(mode="json", exclude={"title", "source", "without", "expect"})
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    digest.update(code_digest())
    return digest.hexdigest()[:24]


@cache
def code_digest() -> bytes:
    """Digest of the sources of core and models, and of the versions of what computes."""
    versions = [version(name) for name in ("tiltsim", "mujoco", "numpy", "numba")]
    sources = [*core_sources(), *shipped_folder("mjcf").rglob("*.xml")]
    return sources_digest(sources, *versions)


def sources_digest(sources: list[Path], *more: str) -> bytes:
    """Digest of files, wherever they lie and whatever their order, and of strings."""
    files = (hashlib.sha256(f.name.encode() + f.read_bytes()).digest() for f in sources)
    return hashlib.sha256(repr(more).encode() + b"".join(sorted(files))).digest()
