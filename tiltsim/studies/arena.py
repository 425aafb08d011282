"""The arena: fixed tasks for every vehicle, flown by every controller, and their scores."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import mean
from types import MappingProxyType
from typing import Any, Final

from tiltsim.errors import InputError
from tiltsim.resources import shipped_folder
from tiltsim.scenario.controller import CONTROLLERS
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.messages import choose
from tiltsim.studies.checking import collect
from tiltsim.studies.comparison import GIVEN, Entry, fly_entries
from tiltsim.studies.multirotor_analysis import FEW_ROTORS, FLEET, fleet_file

FOLDER: Final = "arena"
"""Folder of the library with one file for each vehicle and one variant for each task."""

BASELINES: Final = ("geometric", "pid", "indi", "lqr")
"""Laws of the literature, with which the other laws are compared."""

HALF: Final = (0.1, 0.1)
"""Root mean square errors of position (m) and yaw (rad), each of which alone halves the score."""

STEP: Final = 0.25
"""Share of a step that is the root mean square of a first-order response in 1 s over 8 s."""

HALF_OF: Final = {
    "step": (STEP, 0.1),
    "yaw_step": (0.1, 1.571 * STEP),
    "latency": (0.3 * STEP, 0.1),
}
"""Tasks with other errors than `HALF`: steps, whose error begins with the step itself."""


MULTIROTOR: Final = "multirotor"
"""The file whose tasks the fleet flies, each vehicle in place of the file's own."""

OWN_KEYS: Final = {"omni_octorotor": {"controller.norm": "thrust"}}
"""Keys that a vehicle of the fleet needs beside its file and tilt angles: its rotors reverse."""


@dataclass(frozen=True)
class Vehicle:
    """A vehicle of the arena.

    Attributes:
        tasks: Addresses of its tasks.
        overrides: Values by dotted key that put this vehicle into the tasks.
    """

    tasks: tuple[str, ...]
    overrides: Mapping[str, Any]


@dataclass(frozen=True)
class Standing:
    """The scores of one controller on the tasks of one vehicle.

    Attributes:
        controller: Its law, or `GIVEN`.
        scores: By task, 0 to 100; None where the controller does not fit the task.
        tuned: Scores with tuned gains; equal to `scores` where there are none.
    """

    controller: str
    scores: Mapping[str, float | None]
    tuned: Mapping[str, float | None]

    @property
    def total(self) -> float:
        """Mean over all tasks; a task that the controller does not fit counts as zero."""
        return mean(score or 0.0 for score in self.scores.values())

    @property
    def tuned_total(self) -> float:
        """Mean over all tasks with tuned gains."""
        return mean(score or 0.0 for score in self.tuned.values())


def vehicles() -> dict[str, Vehicle]:
    """The vehicles by name: vehicles with their own file, then the fleet's others on a gait."""
    found: dict[str, list[str]] = {}
    for address in collect([str(shipped_folder("scenarios") / FOLDER)]):
        found.setdefault(address.partition("#")[0].rpartition("/")[2], []).append(address)
    shared = tuple(found.pop(MULTIROTOR))
    every = {name: Vehicle(tuple(tasks), {}) for name, tasks in found.items()}
    for name, angles in FLEET.items():
        if name not in (*every, *FEW_ROTORS):
            gait = {"gait": {"type": "fixed", "angles": [*angles]}} if angles else {}
            own = {"vehicle.mjcf": str(fleet_file(name)), **gait, **OWN_KEYS.get(name, {})}
            every[name] = Vehicle(shared, own)
    return every


def chosen_vehicles(names: Sequence[str]) -> dict[str, Vehicle]:
    """The named vehicles, or all. Raises InputError if one does not exist."""
    known = vehicles()
    for name in names:
        if name not in known:
            raise InputError(f"--vehicles {name}: {choose(name, sorted(known))}")
    return {name: vehicle for name, vehicle in known.items() if name in names or not names}


def fitting(vehicle: Vehicle) -> list[str]:
    """Controllers for a vehicle: the tasks' own, and all laws that follow positions."""
    scenario = load_scenario(vehicle.tasks[0], vehicle.overrides)
    own, model = scenario.controller, scenario.vehicle.model
    laws = [
        law
        for law, table in CONTROLLERS.items()
        if law not in ("python", "numpy")
        and model in table.vehicle_models
        and "position" in table.reference_kinds
    ]
    default = load_scenario(vehicle.tasks[0], {"controller": {"law": own.law}}).controller
    return laws if own == default else [GIVEN, *laws]


def fly_tasks(
    chosen: Mapping[str, Vehicle],
    controllers: Mapping[str, Mapping[str, Mapping[str, Any]]],
    tuned: Mapping[str, Mapping[str, Mapping[str, Any]]],
    jobs: int,
    *,
    trusted: bool = False,
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Fly the tasks of every vehicle; yields the vehicle's name and a row with its score.

    Args:
        chosen: The vehicles.
        controllers: Their tables by vehicle and name.
        tuned: Tables with tuned gains of some of them, which are also flown.
        jobs: Processes.
        trusted: Whether to execute Python code that only tuned tables name.

    Raises:
        InputError: If they name some and are not trusted.
    """
    places, entries = [], []
    for name, vehicle in chosen.items():
        for address in vehicle.tasks:
            for controller, table in controllers[name].items():
                gains = tuned.get(name, {}).get(controller)
                for kind, keys in (("default", table), ("tuned", gains)):
                    if keys is not None:
                        named = "function" in table and keys.get("function") == table["function"]
                        entry = entry_of(vehicle, address, controller, keys)
                        places.append((name, kind))
                        entries.append(replace(entry, trusted=trusted or named))
    flown = fly_entries(entries, searches=False, timed=False, jobs=jobs)
    for (name, kind), one in zip(places, flown, strict=True):
        yield name, one.row | {"gains": kind, "score": score(one.row)}


def entry_of(
    vehicle: Vehicle,
    address: str,
    name: str,
    table: Mapping[str, Any],
    changes: Mapping[str, Any] = MappingProxyType({}),
) -> Entry:
    """A controller on a task of a vehicle; `OWN_KEYS` are for the tasks' own controller only.

    Args:
        vehicle: The vehicle.
        address: Address of the task.
        name: Name of the controller.
        table: Its keys, empty for the tasks' own.
        changes: Further values by dotted key.
    """
    own = {
        key: value
        for key, value in vehicle.overrides.items()
        if not table or not key.startswith("controller")
    }
    return Entry(address, name, table, {**own, **changes})


def score(row: Mapping[str, Any]) -> float | None:
    """The score of a row of `compare`: ``100 / (1 + e_position / half + e_yaw / half)``.

    None if the task refuses the controller, 0 if the flight ends early.
    """
    if row["end"] == "refused":
        return None
    if row["end"] != "completed":
        return 0.0
    position, yaw = HALF_OF.get(task_of(row), HALF)
    return float(100.0 / (1.0 + row["rms_position_error"] / position + row["rms_yaw_error"] / yaw))


def task_of(row: Mapping[str, Any]) -> str:
    """Name of the task of a row."""
    return str(row["scenario"]).partition("#")[2]


def standings(rows: Sequence[Mapping[str, Any]]) -> list[Standing]:
    """Standings from the rows of one vehicle, the best first, by tuned gains if there are any."""
    scores: dict[str, dict[str, dict[str, float | None]]] = {}
    for row in rows:
        by_gains = scores.setdefault(row["controller"], {"default": {}, "tuned": {}})
        by_gains[row["gains"]][task_of(row)] = row["score"]
    every = [
        Standing(name, by["default"], by["tuned"] or by["default"]) for name, by in scores.items()
    ]
    return sorted(every, key=lambda standing: -standing.tuned_total)


def best(every: Sequence[Standing], task: str, gains: str) -> tuple[str, float]:
    """The controller that is best in a task, and its score.

    Args:
        every: The controllers of a vehicle.
        task: Name.
        gains: default or tuned.
    """
    reached = {one.controller: _scores(one, gains)[task] or 0.0 for one in every}
    winner = max(reached, key=lambda name: reached[name])
    return winner, reached[winner]


def _scores(standing: Standing, gains: str) -> Mapping[str, float | None]:
    return standing.tuned if gains == "tuned" else standing.scores


def are_rivals(every: Sequence[Standing]) -> bool:
    """Whether both baselines and others are among the controllers of a vehicle."""
    return len({one.controller in BASELINES for one in every}) > 1


def beaten(every: Sequence[Standing], gains: str) -> list[str]:
    """The winner of each task in which a baseline beats all other controllers.

    Args:
        every: The controllers of a vehicle.
        gains: default or tuned.
    """
    if not are_rivals(every):
        return []
    known = [one for one in every if one.controller in BASELINES]
    others = [one for one in every if one.controller not in BASELINES]
    lines = []
    for task in every[0].scores:
        (winner, high), (loser, low) = best(known, task, gains), best(others, task, gains)
        if high > low:
            lines.append(f"`{task}` (`{winner}` {high:.0f}, `{loser}` {low:.0f})")
    return lines


def changed(every: Sequence[Standing]) -> list[str]:
    """Both winners of each task in which tuned gains change the winner."""
    lines = []
    for task in every[0].scores if every else ():
        (before, low), (after, high) = (best(every, task, kind) for kind in ("default", "tuned"))
        if before != after:
            lines.append(f"`{task}` (`{before}` {low:.0f}, then `{after}` {high:.0f})")
    return lines
