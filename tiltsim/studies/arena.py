"""The arena: fixed tasks for every vehicle, flown by every controller, and their scores."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from statistics import mean
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from tiltsim.errors import InputError
from tiltsim.resources import shipped_folder
from tiltsim.scenario.controller import CONTROLLERS
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.messages import choose
from tiltsim.studies.checking import collect
from tiltsim.studies.comparison import GIVEN, Entry, controller_tables, fly_entries
from tiltsim.studies.multirotor_analysis import FEW_ROTORS, FLEET, fleet_file
from tiltsim.studies.scores import INTERACTION, score, task_at, task_of

FOLDER: Final = "arena"
"""Folder of the library with one file for each vehicle and one variant for each task."""

BASELINES: Final = ("geometric", "pid", "indi", "lqr")
"""Laws of the literature, with which the other laws are compared."""

OURS: Final = "vectoring"  # the law that flies the limited league with its default setting

MULTIROTOR: Final = "multirotor"
"""The file whose tasks the fleet flies, each vehicle in place of the file's own."""

LEAGUES: Final = ("limited", "unlimited", "interaction")
"""The arena that counts, with limits, lag, latency and noise, the one without, and contacts."""

LIMITED: Final = {
    "quadrotor": 525.0,
    "tiltrotor": 525.0,
    "hexarotor": 838.0,
    "cant_hexarotor": 838.0,
    "tilt_hexarotor": 838.0,
    "tilt_octorotor": 838.0,
    "omni_octorotor": 700.0,
}
"""Vehicles of the limited league, with their highest rotor speeds (rad/s)."""

TOUCHING: Final = ("tilt_hexarotor", "tilt_octorotor")
"""Vehicles of the league of interaction: their rotors leave room for a tool."""

TOUCHES: Final = {"position_bandwidth": 4.0, "attitude_bandwidth": 12.0}
"""Keys of `vectoring` and `geometric` there; with its observer `geometric` chatters along walls."""

REVERSING: Final = ("omni_octorotor",)  # vehicles whose rotors are built to reverse

SERVO: Final = {"natural_frequency": 60.0, "damping_ratio": 0.8, "max_rate": 8.0}
"""Tilt servos of the limited league: 60 degrees in about 0.15 s."""

AS_FLOWN: Final = {"rotor_bandwidth": 400.0, "observer": 8.0, "mixer": "prioritized"}
"""Keys of baselines in the limited league: commands at once, observers and a mixer."""

WORLDS: Final[Mapping[str, Mapping[str, Mapping[str, Any]]]] = {
    "limited": {
        "model error": {},
        "exact model": {"model_error.mass": 1.0, "model_error.thrust_coefficient": 1.0},
    },
    "unlimited": {"": {}},
    "interaction": {"": {}},
}
"""By league, the errors of the law's model: values by dotted key for each table."""

SEEDS: Final = {"model error": (1, 2, 3), "exact model": (1, 2, 3), "": (1,)}
"""Seeds of sensor noise and turbulence, by world."""

OWN_KEYS: Final = {"omni_octorotor": {"controller.norm": "thrust"}}
"""Keys that a vehicle of the fleet needs beside its file and tilt angles: its rotors reverse."""


@dataclass(frozen=True)
class Vehicle:
    """A vehicle of the arena."""

    tasks: tuple[str, ...]  # addresses of its tasks
    overrides: Mapping[str, Any]  # values by dotted key that put this vehicle into the tasks


@dataclass(frozen=True)
class Standing:
    """The scores of one controller on the tasks of one vehicle."""

    controller: str  # its law, or `GIVEN`
    scores: Mapping[str, float | None]
    """By task, 0 to 100; None where the controller does not fit the task."""
    tuned: Mapping[str, float | None]
    """Scores with tuned gains; equal to `scores` where there are none."""

    @property
    def total(self) -> float:
        """Mean over all tasks; a task that the controller does not fit counts as zero."""
        return mean(score or 0.0 for score in self.scores.values())

    @property
    def tuned_total(self) -> float:
        """Mean over all tasks with tuned gains."""
        return mean(score or 0.0 for score in self.tuned.values())


def vehicles(league: str) -> dict[str, Vehicle]:
    """The vehicles of a league by name.

    Unlimited are vehicles with their own file, then the fleet's others on a gait.
    """
    if league == "interaction":
        return {name: Vehicle(tuple(INTERACTION), _in_place(name)) for name in TOUCHING}
    found: dict[str, list[str]] = {}
    for address in collect([str(shipped_folder("scenarios") / FOLDER)]):
        found.setdefault(address.partition("#")[0].rpartition("/")[2], []).append(address)
    limited, shared = tuple(found.pop("limited")), tuple(found.pop(MULTIROTOR))
    if league == "limited":
        return {name: Vehicle(limited, _limited(name)) for name in LIMITED}
    every = {name: Vehicle(tuple(tasks), {}) for name, tasks in found.items()}
    for name in FLEET:
        if name not in (*every, *FEW_ROTORS):
            every[name] = Vehicle(shared, _in_place(name) | OWN_KEYS.get(name, {}))
    return every


def _in_place(name: str) -> dict[str, Any]:
    """The values that put a vehicle of the fleet in place of the tasks' own."""
    angles = (0.0,) * 4 if name == "tiltrotor" else FLEET[name]
    gait = {"gait": {"type": "fixed", "angles": [*angles]}} if angles else {}
    return {"vehicle.mjcf": str(fleet_file(name)), **gait}


def _limited(name: str) -> dict[str, Any]:
    """The values that put a vehicle into the tasks with limits."""
    limits = _in_place(name) | {"vehicle.max_rotor_speed": LIMITED[name]}
    if name in REVERSING:
        limits["vehicle.min_rotor_speed"] = None
    return limits | ({"vehicle.tilt_servo": SERVO} if "gait" in limits else {})


def tables_of(vehicle: Vehicle, league: str) -> dict[str, Mapping[str, Any]]:
    """The tables of the controllers of a vehicle, by name.

    In the limited league they are `vectoring`, and baselines as their authors fly them; in the one
    of interaction with free tilts, and beside the tasks' own `full_pose`.
    """
    if league == "unlimited":
        return controller_tables(fitting(vehicle))
    flown: dict[str, Mapping[str, Any]] = {law: {"law": law, **AS_FLOWN} for law in BASELINES}
    if "gait" not in vehicle.overrides:
        return {"vectoring": {"law": "vectoring"}, **flown}
    free: dict[str, Any] = {"tilts": "free"}
    own = {"law": "vectoring", **free}
    if league == "interaction":
        geometric = {**flown["geometric"], **free, **TOUCHES, "observer": 0.0}
        return {"full_pose": {}, "vectoring": own | TOUCHES, **flown, "geometric": geometric}
    return {"vectoring": own, **flown, "geometric_free": {**flown["geometric"], **free}}


def chosen_vehicles(
    names: Sequence[str], league: str, tasks: Sequence[str] = ()
) -> dict[str, Vehicle]:
    """The named vehicles of a league with the named tasks, or all, without vehicles that have none.

    Raises InputError if a vehicle does not exist, or no chosen one has a task of that name.
    """
    known = vehicles(league)
    _require("vehicles", names, known)
    chosen = {name: known[name] for name in known if name in names or not names}
    _require("tasks", tasks, {task_at(address) for one in chosen.values() for address in one.tasks})
    left = {
        name: tuple(at for at in one.tasks if not tasks or task_at(at) in tasks)
        for name, one in chosen.items()
    }
    return {name: replace(chosen[name], tasks=flown) for name, flown in left.items() if flown}


def _require(option: str, names: Iterable[str], known: Collection[str]) -> None:
    """Refuse a name that is not known."""
    for name in names:
        if name not in known:
            raise InputError(f"--{option} {name}: {choose(name, sorted(known))}")


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


class Match(NamedTuple):
    """A flight of the arena."""

    vehicle: str  # name
    place: Mapping[str, Any]  # columns of its row: kind of gains, world and seed
    entry: Entry  # controller and task


def matches(
    league: str,
    chosen: Mapping[str, Vehicle],
    controllers: Mapping[str, Mapping[str, Mapping[str, Any]]],
    tuned: Mapping[str, Mapping[str, Mapping[str, Any]]],
    *,
    trusted: bool = False,
) -> list[Match]:
    """The flights of a league; in the limited one tuned gains take the place of default ones.

    Args:
        league: One of `LEAGUES`.
        chosen: The vehicles.
        controllers: Their tables by vehicle and name.
        tuned: Tables with tuned gains of some of them.
        trusted: Whether to execute Python code that only tuned tables name.
    """
    found = []
    for name, vehicle in chosen.items():
        for address, (controller, table) in product(vehicle.tasks, controllers[name].items()):
            gains = tuned.get(name, {}).get(controller)
            for kind, keys in (("default", table), ("tuned", gains)):
                if keys is None or (league == "limited" and gains and kind == "default"):
                    continue
                named = "function" in table and keys.get("function") == table["function"]
                flown = ((world, seed) for world in WORLDS[league] for seed in SEEDS[world])
                for world, seed in flown:
                    changes = {**WORLDS[league][world], "simulation.seed": seed}
                    entry = entry_of(vehicle, address, controller, keys, changes)
                    place = {"gains": kind, "world": world, "seed": seed}
                    found.append(Match(name, place, replace(entry, trusted=trusted or named)))
    return found


def fly_matches(flights: Sequence[Match], jobs: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Fly them; yields each vehicle's name and a row with its score.

    Args:
        flights: See `matches`.
        jobs: Processes.

    Raises:
        InputError: If they name Python code that is not trusted.
    """
    entries = [one.entry for one in flights]
    flown = fly_entries(entries, searches=False, timed=False, jobs=jobs)
    for one, compared in zip(flights, flown, strict=True):
        yield one.vehicle, {**compared.row, **one.place, "score": score(compared.row)}


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


def standings(rows: Sequence[Mapping[str, Any]]) -> list[Standing]:
    """Standings from the rows of one vehicle, the best first, by tuned gains if there are any.

    Scores are means over seeds.
    """
    found: dict[str, dict[str, dict[str, list[float | None]]]] = {}
    for row in rows:
        by_gains = found.setdefault(row["controller"], {"default": {}, "tuned": {}})
        by_gains[row["gains"]].setdefault(task_of(row), []).append(row["score"])
    every = []
    for name, by in found.items():
        default, tuned = ({t: _mean(s) for t, s in by[kind].items()} for kind in by)
        every.append(Standing(name, default or tuned, tuned or default))
    return sorted(every, key=lambda standing: -standing.tuned_total)


def _mean(scores: Sequence[float | None]) -> float | None:
    """The mean of scores of several seeds; None if one is refused."""
    known = [score for score in scores if score is not None]
    return mean(known) if len(known) == len(scores) else None


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


def beaten(every: Sequence[Standing], gains: str) -> int:
    """In how many tasks a baseline beats all other controllers of a vehicle.

    Args:
        every: The controllers.
        gains: default or tuned.
    """
    if not are_rivals(every):
        return 0
    known = [one for one in every if one.controller in BASELINES]
    others = [one for one in every if one.controller not in BASELINES]
    tasks = every[0].scores
    return sum(best(known, task, gains)[1] > best(others, task, gains)[1] for task in tasks)
