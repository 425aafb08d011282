"""Fair tuning: the same seeded search of the same number of flights for every controller.

The tasks are not the arena's: its scenarios with other points, curves, winds and delays. A search
varies factors on the default gains, one for every knob, between `FACTORS`: the default gains first,
then a Latin hypercube of their logarithms, half of the flights together, then Nelder and Mead's
simplex from the best; where the other half is too small for a simplex, all of them are the
hypercube. A flight that is refused or ends early scores 0.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from math import log
from pathlib import Path as FilePath
from statistics import mean
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from tiltsim.errors import InputError
from tiltsim.scenario.controller_table import ControllerTable
from tiltsim.scenario.law_controller import LawTable
from tiltsim.studies.arena import Vehicle, entry_of
from tiltsim.studies.comparison import Entry, compare_one
from tiltsim.studies.scores import score
from tiltsim.system.processes import in_processes
from tiltsim.system.text import error_text
from tiltsim_controllers.mathematics.scalar import Floats

FACTORS: Final = (0.25, 4.0)  # bounds of the factors on default gains
AMPLITUDE: Final = (1.5, 1.0, 0.4)  # m
FREQUENCY: Final = (0.8, 1.2, 0.6)  # rad/s

TASKS: Final[Mapping[str, Mapping[str, Any]]] = {
    "set_point": {
        "initial.position": [-0.2, 0.3, -0.15],
        "initial.attitude": [-0.15, 0.2, -0.35],
        "initial.angular_velocity": [-0.4, 0.6, 0.2],
    },
    "step": {"reference.position": [-0.6, 0.7, 0.4], "reference.yaw": 0.7},
    "circle": {
        "reference": {"type": "lissajous", "amplitude": AMPLITUDE, "angular_frequency": FREQUENCY},
        "initial.position": [0.0, 0.0, 0.0],
        "initial.velocity": [a * w for a, w in zip(AMPLITUDE, FREQUENCY, strict=True)],
    },
    "gust": {"air.gust.velocity": [-2.0, 3.0, 1.0], "air.gust.duration": 2.0},
    "turbulence": {"simulation.seed": 11, "air.wind": [-1.5, 2.0, 0.0]},
    "weak_rotor": {"fault[0].rotor": 3, "fault[0].factor": 0.85},
    "latency": {"simulation.control_latency": 0.012, "reference.position": [0.0, -0.25, 0.15]},
}
"""Tasks of the arena by name, and the keys that differ in tuning; a vehicle may lack some."""

DURATION: Final = 5.0  # s, of every flight

NOT_TUNED: Final = ("rotor_bandwidth", "tilt_bandwidth", "max_speed", "max_acceleration")
"""Numbers of the baselines and of laws of packages that describe actuators or limits."""

LOOPS: Final = ("gains", "side_gains")
"""Keys of the other laws: coefficients of the characteristic polynomials of linear loops."""

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Tuned:
    """The result of a search for a controller of a vehicle."""

    of: dict[str, Any]  # the controller's table before, empty for the tasks' own controller
    table: dict[str, Any]  # the keys of ``[controller]`` with the best gains
    factors: dict[str, float]  # factors on the default gains, by knob
    default_score: float  # means over the tuning tasks
    tuned_score: float  # means over the tuning tasks
    flights: int  # number of flights, at most the budget


class Search(NamedTuple):
    """A search to be done, by the names of the vehicle and the controller."""

    vehicle: str
    controller: str


def knobs(controller: ControllerTable) -> dict[str, dict[Path, int]]:
    """The numbers that a search varies: places in the table, with the power of the factor there.

    For baselines and laws of packages every positive number but `NOT_TUNED`; for the others one
    factor for every linear loop, by which its poles are faster: the i-th coefficient has the i-th
    power. Roll and pitch share one.
    """
    found: dict[str, dict[Path, int]] = {}
    whole = isinstance(controller, LawTable)
    for path, value in _leaves(controller.in_full().model_dump(mode="json")):
        if whole and value > 0.0 and path[0] not in NOT_TUNED:
            found.setdefault(_name(path), {})[path] = 1
        elif not whole and path[0] in LOOPS:
            found.setdefault(_loop_name(path), {})[path] = _order(path)
    return found


def _leaves(value: Any, path: Path = ()) -> Iterator[tuple[Path, float]]:
    if isinstance(value, Mapping | list):
        items = value.items() if isinstance(value, Mapping) else enumerate(value)
        for key, inner in items:
            yield from _leaves(inner, (*path, key))
    elif isinstance(value, float):
        yield path, value


def _name(path: Path) -> str:
    """The dotted key of a place, as in ``--set``."""
    return "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in path).removeprefix(".")


def _loop_name(path: Path) -> str:
    """``gains.attitude`` is a table of coefficients by axes; yaw is a separate loop."""
    name = ".".join(part for part in path if isinstance(part, str))
    return f"{name}, yaw" if path[-2:] in [(row, 2) for row in range(3)] else name


def _order(path: Path) -> int:
    """Number of a coefficient in its loop, from 1; poles count as 1."""
    first = next((part for part in path if isinstance(part, int)), 0)
    return first + 1


def scaled(controller: ControllerTable, factors: Mapping[str, float]) -> dict[str, Any]:
    """The table of a controller with factors on its knobs, to six digits."""
    given = controller.model_dump(mode="json", exclude_defaults=True)
    full: Any = controller.in_full().model_dump(mode="json")
    changed = set()
    for knob, places in knobs(controller).items():
        for path, power in places.items():
            table = full
            for part in path[:-1]:
                table = table[part]
            table[path[-1]] = float(f"{table[path[-1]] * factors[knob] ** power:.6g}")
            changed.add(path[0])
    return given | {"law": controller.law} | {str(key): full[key] for key in changed}


def tuning_entries(vehicle: Vehicle, name: str, table: Mapping[str, Any]) -> list[Entry]:
    """The flights of one evaluation, of those tasks that the vehicle has."""
    shorter = {"simulation.duration": DURATION, "simulation.engine": "native", "expect": []}
    return [
        replace(
            entry_of(vehicle, address, name, table, {**TASKS[task], **shorter}),
            trusted="function" in table,
        )
        for address in vehicle.tasks
        if (task := address.partition("#")[2]) in TASKS
    ]


def tune(
    search: Search,
    vehicles: Mapping[str, Vehicle],
    controllers: Mapping[str, Mapping[str, Mapping[str, Any]]],
    flights: int,
    seed: int,
) -> Tuned | None:
    """Search the gains of one controller; None if it has none, or fits no task.

    Raises InputError if the budget is less than one flight on each task.

    Args:
        search: The vehicle and the controller.
        vehicles: By name.
        controllers: Their tables, by vehicle and name.
        flights: The budget.
        seed: Seed of the Latin hypercube.
    """
    vehicle = vehicles[search.vehicle]
    table = controllers[search.vehicle][search.controller]
    tasks = tuning_entries(vehicle, search.controller, table)
    if flights < len(tasks):
        raise InputError(
            f"--tune {flights}: must be at least {len(tasks)}, one flight on each tuning task of "
            f"{search.vehicle}"
        )
    controller = _controller(tasks)
    names = [*knobs(controller)] if controller else []
    if controller is None or not names:
        return None

    def value(logarithms: Floats) -> float:
        factors = dict(zip(names, np.exp(logarithms).tolist(), strict=True))
        flown = tuning_entries(vehicle, search.controller, scaled(controller, factors))
        rows = (compare_one(entry, searches=False, timed=False).row for entry in flown)
        return mean(score(row) or 0.0 for row in rows)

    tried = maximize(value, len(names), flights // len(tasks), seed)
    best = max(tried, key=lambda one: one[1])
    if best[1] == 0.0:
        return None
    factors = {name: float(f"{np.exp(x):.4g}") for name, x in zip(names, best[0], strict=True)}
    flown = len(tried) * len(tasks)
    return Tuned(dict(table), scaled(controller, factors), factors, tried[0][1], best[1], flown)


def _controller(tasks: Sequence[Entry]) -> ControllerTable | None:
    """The controller in the first task that does not refuse it."""
    for entry in tasks:
        with suppress(InputError):
            return entry.scenario().controller
    return None


def maximize(
    value: Callable[[Floats], float], size: int, evaluations: int, seed: int
) -> list[tuple[Floats, float]]:
    """Points and values that a search tried; see the head of the module.

    Args:
        value: To be made large, of `size` logarithms of factors.
        size: Number of factors.
        evaluations: Largest number of points.
        seed: Seed of the Latin hypercube.
    """
    tried: list[tuple[Floats, float]] = []

    def cost(point: Floats) -> float:
        tried.append((np.array(point), value(point)))
        return -tried[-1][1]

    low, high = map(log, FACTORS)
    cost(np.zeros(size))
    left = evaluations - max(1, evaluations // 2)
    if left <= size:
        left = 0
    spread = qmc.LatinHypercube(size, seed=seed).random(evaluations - left - 1)
    for point in low + (high - low) * spread:
        cost(point)
    if left:
        start = max(tried, key=lambda one: one[1])[0]
        steps = np.where(start + 0.3 < high, 0.3, -0.3)
        simplex = np.vstack([start, start + np.diag(steps)])
        options = {"maxfev": left, "initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-3}
        minimize(cost, start, method="Nelder-Mead", bounds=[(low, high)] * size, options=options)
    return tried[:evaluations]


def tune_all(
    vehicles: Mapping[str, Vehicle],
    controllers: Mapping[str, Mapping[str, Mapping[str, Any]]],
    *,
    flights: int,
    seed: int,
    jobs: int,
) -> Iterator[tuple[Search, Tuned | None]]:
    """Search the gains of every controller of every vehicle.

    Args:
        vehicles: By name.
        controllers: Their tables, by vehicle and name.
        flights: The budget of each.
        seed: Seed of the search.
        jobs: Processes.
    """
    work = partial(tune, vehicles=vehicles, controllers=controllers, flights=flights, seed=seed)
    searches = [Search(name, one) for name, tables in controllers.items() for one in tables]
    for search, future in in_processes(work, searches, jobs):
        yield search, future.result()


def tuning_document(
    found: Mapping[Search, Tuned | None], flights: int, seed: int, made: Mapping[str, Any]
) -> dict[str, Any]:
    """The results of searches as a JSON document.

    Args:
        found: Result of each search.
        flights: The budget of each.
        seed: Seed of the searches.
        made: Date, commit and versions.
    """
    gains: dict[str, dict[str, Any]] = {}
    for search in sorted(found, key=lambda one: (one.vehicle, one.controller)):
        if (tuned := found[search]) is not None:
            gains.setdefault(search.vehicle, {})[search.controller] = asdict(tuned)
    return {
        "made": dict(made),
        "seed": seed,
        "flights": flights,
        "factors": FACTORS,
        "duration": DURATION,
        "tasks": TASKS,
        "gains": gains,
    }


def read_tuning(file: FilePath) -> dict[str, Any]:
    """A document of `tuning_document`. Raises InputError if the file is none."""
    try:
        text = json.loads(file.read_text(encoding="utf-8"))
        searches = [one for by in text["gains"].values() for one in by.values()]
        needed: list[Any] = [(dict(one["table"])["law"], dict(one["of"])) for one in searches]
        needed += [int(text["seed"]), int(text["flights"])]
        needed += [text["made"]["date"], text["made"]["commit"]]
    except FileNotFoundError:
        raise InputError(f"{file}: no such file") from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{file}: not a file of tuned gains ({error_text(error)}); tiltsim arena --tune "
            "writes one"
        ) from None
    return dict(text)
