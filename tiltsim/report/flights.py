"""The flights of the report, on both plants.

The folder holds one JSON file per flight, stored as it ends, so that an interrupted report resumes.
Files are named by a digest of everything that their content depends on: the resolved scenario
(without titles and expectations), the files that it names, the sources of the core and of the
models, and the versions of the packages that compute.

In a scenario whose ``source`` names no chapter, ``without = "ADDRESS"`` (``"#name"`` within its
file) names the flight without the feature that it shows; the metrics of its expectations are
compared. Without that key only its own values are shown.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Final, Literal, TypeVar

import tiltsim_controllers
from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.folders import FLYING
from tiltsim.report.claim import CHAPTER
from tiltsim.resources import shipped_folder
from tiltsim.scenario.loading import load_scenario, named_files
from tiltsim.scenario.metric_names import WALL_CLOCK_METRICS, unit_of
from tiltsim.scenario.own_parts import require_trust
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.scenario_tables import DESCRIPTIVE
from tiltsim.system.files import replacing
from tiltsim.system.processes import in_processes

Plant = Literal["thesis", "mujoco"]
PLANTS: Final[tuple[Plant, ...]] = ("thesis", "mujoco")

_NEED_COMPLETION: Final = ("final_", "sup_", "altitude_settling_time")
"""Prefixes of metrics that only a completed flight has."""


@dataclass(frozen=True)
class FlightRecord:
    """The part of a flight that the report stores."""

    address: str
    plant: Plant
    metrics: dict[str, float | bool]
    end: str  # completed | diverged | singular
    end_time: float  # s
    cause: str

    @property
    def ended_early(self) -> bool:
        """Whether the flight terminated before its duration."""
        return self.end != "completed"


Flights = Mapping[tuple[str, Plant], FlightRecord | str]
"""Records by address and plant, or why the scenario is not supported there, in one line."""


@dataclass(frozen=True)
class ReportEntry:
    """A scenario of the report and its variant on each plant."""

    address: str
    scenario: Scenario
    plants: dict[Plant, Scenario | str]


def report_entries(addresses: list[str]) -> list[ReportEntry]:
    """Load scenarios for both plants. Raises `InputError` if one is invalid or names code."""
    entries = []
    for address in addresses:
        scenario = load_scenario(address)
        require_trust(scenario)
        plants: dict[Plant, Scenario | str] = {}
        for plant in PLANTS:
            if plant == scenario.simulation.plant:
                plants[plant] = scenario
                continue
            try:
                plants[plant] = variant_for(address, plant)
            except InputError as error:
                plants[plant] = str(error).removeprefix(f"{address}: ")
        entries.append(ReportEntry(address, scenario, plants))
    return entries


def variant_for(address: str, plant: Plant) -> Scenario:
    """A scenario on a plant. Raises `InputError` if it is invalid or not supported there."""
    return load_scenario(address, {"simulation.plant": plant})


def fly(
    entries: list[ReportEntry],
    folder: Path,
    jobs: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[tuple[str, Plant], FlightRecord | str]:
    """Records of scenarios on both plants: stored ones from the folder, the others flown.

    Args:
        entries: The scenarios, from `report_entries`.
        folder: Where records are stored; created if it is missing.
        jobs: Processes.
        progress: Called with the number of finished flights and the total.

    Raises:
        InputError: If a process dies or fails.
    """
    folder.mkdir(parents=True, exist_ok=True)
    flights: dict[tuple[str, Plant], FlightRecord | str] = {}
    missing: list[tuple[int, str, Plant, Path]] = []
    for entry in entries:
        for plant, scenario in entry.plants.items():
            if isinstance(scenario, str):
                flights[entry.address, plant] = scenario
                continue
            file = folder / f"{flight_key(scenario)}.json"
            if (record := read_record(file)) is not None:
                flights[entry.address, plant] = record
            else:
                missing.append((scenario.simulation.steps, entry.address, plant, file))
    total = len(entries) * len(PLANTS)
    progress(len(flights), total)
    # The longest first, so that no process ends up alone with one of them.
    tasks = [(address, plant, file) for _, address, plant, file in sorted(missing, reverse=True)]
    for _, record in results(_fly_one, tasks, jobs, lambda t: f"{t[0]} on the {t[1]} plant"):
        flights[record.address, record.plant] = record
        progress(len(flights), total)
    return flights


def _fly_one(task: tuple[str, Plant, Path]) -> FlightRecord:
    from tiltsim.simulation.simulate import simulate_to_end

    address, plant, file = task
    record = make_record(address, plant, simulate_to_end(variant_for(address, plant)))
    store(file, json.dumps(asdict(record), indent=1).encode())
    return record


def make_record(address: str, plant: Plant, flight: Flight) -> FlightRecord:
    """The record of a flight.

    A flight that terminates early has no final values and no suprema: values at its end would be
    mistaken for the steady state.
    """
    ended_early = flight.end.kind != "completed"
    metrics = {
        name: value
        for name, value in flight.metrics().of_all_vehicles().items()
        if (own := name.rpartition(".")[2]) not in WALL_CLOCK_METRICS
        and not (ended_early and own.startswith(_NEED_COMPLETION))
    }
    return FlightRecord(address, plant, metrics, flight.end.kind, flight.end.time, flight.end.cause)


def read_record(file: Path) -> FlightRecord | None:
    """A stored record, None if there is none that can be read."""
    try:
        return FlightRecord(**json.loads(file.read_bytes()))
    except (OSError, ValueError, TypeError):
        return None


Task = TypeVar("Task")
Result = TypeVar("Result")


def store(path: Path, content: bytes) -> None:
    """Write a file completely or not at all."""
    with replacing(path) as draft:
        draft.write_bytes(content)


def flight_key(scenario: Scenario) -> str:
    """Digest of everything that the numbers of a flight depend on."""
    content = scenario.model_dump(mode="json", exclude=set(DESCRIPTIVE))
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    digest.update(sources_digest(sorted(named_files(content))))
    digest.update(code_digest())
    return digest.hexdigest()[:24]


@cache
def code_digest() -> bytes:
    """Digest of the sources of core and models, and of the versions of the numeric packages."""
    versions = [version(name) for name in ("tiltsim", "mujoco", "numpy", "llvmlite")]
    package = Path(__file__).parents[1]
    own = [file for name in FLYING for file in (package / name).rglob("*.py")]
    controllers = Path(tiltsim_controllers.__file__).parent.rglob("*.py")
    sources = [*own, *controllers, *shipped_folder("mjcf").rglob("*.xml")]
    return sources_digest(sources, *versions)


def sources_digest(sources: list[Path], *more: str) -> bytes:
    """Digest of the names and contents of files, in any order and place, and of more strings."""
    files = (hashlib.sha256(f.name.encode() + f.read_bytes()).digest() for f in sources)
    return hashlib.sha256(repr(more).encode() + b"".join(sorted(files))).digest()


def results(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    jobs: int,
    describe: Callable[[Task], str],
) -> Iterator[tuple[Task, Result]]:
    """Yield every task with its result, as they finish; one failure ends the work.

    Args:
        work: Called once per task; picklable unless ``jobs`` is 1.
        tasks: The work to do.
        jobs: Processes; with 1, or a single task, everything runs in this one.
        describe: Names a task in the message of an error.

    Raises:
        InputError: If a task fails in a process, or the process dies.
    """
    if jobs == 1 or len(tasks) < 2:
        yield from ((task, work(task)) for task in tasks)
        return
    for task, future in in_processes(work, tasks, jobs):
        error = future.exception()
        if error is not None:
            raise InputError(f"{describe(task)}: {type(error).__name__}: {error}") from error
        yield task, future.result()


BEYOND_TITLE: Final = "Beyond the thesis"
BEYOND_TEXT: Final = (
    "Features that the thesis does not have, each flight compared with the same flight without "
    "the feature: the value without it, an arrow, the value with it. Bounds on all of them are in "
    "the scenario files; `docs/beyond.md` explains them."
)


@dataclass(frozen=True)
class Comparison:
    """One metric of a flight and of the flight without the feature."""

    address: str
    title: str
    source: str
    metric: str
    without: str  # address of the other flight, empty if there is none
    plants: dict[Plant, str]  # the values on each supported plant, as text

    @property
    def file(self) -> str:
        """Address of the family."""
        return self.address.partition("#")[0]

    @property
    def quantity(self) -> str:
        """Name and unit of the metric, as text."""
        unit = unit_of(self.metric)
        return self.metric.replace("_", " ") + (f", {unit}" if unit else "")


def compare(entries: list[ReportEntry], flights: Flights) -> list[Comparison]:
    """The comparisons of all entries that have a record, in order.

    If there is no record of the flight to compare with, only one value is shown.
    """
    found = []
    others = {e.address: other_address(e.address, e.scenario.without) for e in entries}
    for entry in entries:
        scenario, without = entry.scenario, others[entry.address]
        shown_beside = not without and entry.address in others.values()
        if CHAPTER.match(scenario.source) is not None or shown_beside:
            continue
        for metric in dict.fromkeys(expectation.metric for expectation in scenario.expect):
            plants: dict[Plant, str] = {}
            for plant in PLANTS:
                record = flights[entry.address, plant]
                if isinstance(record, FlightRecord):
                    texts = [_text(record, metric)]
                    other = flights.get((without, plant))
                    if isinstance(other, FlightRecord):
                        texts.insert(0, _text(other, metric))
                    plants[plant] = " → ".join(texts)
            found.append(
                Comparison(entry.address, scenario.title, scenario.source, metric, without, plants)
            )
    return found


def other_address(address: str, without: str) -> str:
    """The full address of the flight to compare with; empty if that is the flight itself."""
    full = address.partition("#")[0] + without if without.startswith("#") else without
    return "" if full == address else full


def _text(record: FlightRecord, metric: str) -> str:
    if record.ended_early:
        return f"terminated at {record.end_time:.3g} s"
    value = record.metrics.get(metric)
    if isinstance(value, bool):
        words = ("completed", "terminated") if metric == "diverged" else ("no", "yes")
        return words[value]
    return "no value" if value is None else f"{value:.3g}".replace("-", "−")
