"""The flights of the report, on both plants.

The folder holds one JSON file per flight (`tiltsim.report.store`). Flights are stored as they end,
so an interrupted report resumes where it stopped.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Final, Literal

from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.report.store import flight_key, results, store
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.metric_names import WALL_CLOCK_METRICS
from tiltsim.scenario.own_code import require_trust
from tiltsim.scenario.scenario import Scenario

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


@dataclass(frozen=True)
class Unsupported:
    """Why a scenario is not supported on a plant, in one line."""

    reason: str


Flights = Mapping[tuple[str, Plant], FlightRecord | Unsupported]


@dataclass(frozen=True)
class ReportEntry:
    """A scenario of the report and its variant on each plant."""

    address: str
    scenario: Scenario
    plants: dict[Plant, Scenario | Unsupported]


@dataclass(frozen=True)
class _Task:
    address: str
    plant: Plant
    key: str


def report_entries(addresses: list[str]) -> list[ReportEntry]:
    """Load scenarios for both plants. Raises `InputError` if one is invalid or names code."""
    entries = []
    for address in addresses:
        scenario = load_scenario(address)
        require_trust(scenario)
        plants: dict[Plant, Scenario | Unsupported] = {}
        for plant in PLANTS:
            if plant == scenario.simulation.plant:
                plants[plant] = scenario
                continue
            try:
                plants[plant] = variant_for(address, plant)
            except InputError as error:
                plants[plant] = Unsupported(str(error).removeprefix(f"{address}: "))
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
) -> dict[tuple[str, Plant], FlightRecord | Unsupported]:
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
    flights: dict[tuple[str, Plant], FlightRecord | Unsupported] = {}
    missing: dict[_Task, Scenario] = {}
    for entry in entries:
        for plant, scenario in entry.plants.items():
            if isinstance(scenario, Unsupported):
                flights[entry.address, plant] = scenario
                continue
            key = flight_key(scenario)
            record = read_record(folder, key)
            if record is None:
                missing[_Task(entry.address, plant, key)] = scenario
            else:
                flights[entry.address, plant] = record
    total = len(entries) * len(PLANTS)
    progress(len(flights), total)
    # The longest first, so that no process ends up alone with one of them.
    tasks = sorted(missing, key=lambda task: -missing[task].simulation.steps)
    jobs = min(jobs, len(tasks))
    work = partial(_fly_one, folder=folder)
    for task, record in results(work, tasks, jobs, lambda t: f"{t.address} on the {t.plant} plant"):
        flights[task.address, task.plant] = record
        progress(len(flights), total)
    return flights


def _fly_one(task: _Task, folder: Path) -> FlightRecord:
    from tiltsim.simulation.simulate import simulate_to_end

    flight = simulate_to_end(variant_for(task.address, task.plant))
    record = make_record(task.address, task.plant, flight)
    store(folder / f"{task.key}.json", json.dumps(asdict(record), indent=1).encode())
    return record


def make_record(address: str, plant: Plant, flight: Flight) -> FlightRecord:
    """The record of a flight.

    A flight that terminates early has no final values and no suprema: values at its end would be
    mistaken for the steady state.
    """
    ended_early = flight.end.kind != "completed"
    metrics = {
        name: value
        for name, value in flight.metrics().items()
        if name not in WALL_CLOCK_METRICS
        and not (ended_early and name.startswith(_NEED_COMPLETION))
    }
    return FlightRecord(address, plant, metrics, flight.end.kind, flight.end.time, flight.end.cause)


def read_record(folder: Path, key: str) -> FlightRecord | None:
    """A stored record, None if there is none that can be read."""
    try:
        return FlightRecord(**json.loads((folder / f"{key}.json").read_bytes()))
    except (OSError, ValueError, TypeError):
        return None
