"""Controllers side by side: errors, effort, cost and robustness in the same flights."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isclose, nan
from typing import Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.laws.assembling import assemble
from tiltsim.plants.plant import MIN_STEPS_TO_COMPILE
from tiltsim.scenario.controller import CONTROLLERS
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.messages import choose
from tiltsim.scenario.own_parts import require_trust
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.simulate import simulate_to_end
from tiltsim.studies.benchmark import compiled_time_per_call, time_per_call
from tiltsim.sweeps.chunks import boundary
from tiltsim.system.processes import in_order, in_processes
from tiltsim.vehicles.metrics import in_last_second
from tiltsim_controllers.mathematics.scalar import Floats

GIVEN: Final = "given"  # in place of a law: the scenario's own controller
CONTROL_PERIOD: Final = 0.005  # s, of continuous controllers when latencies are sought
WITHIN: Final = 1.0
"""m: largest position error in the last second of a flight that counts as survived."""


@dataclass(frozen=True)
class Search:
    """A value at which a controller is tried, in ever larger steps away from the true one."""

    key: str  # key of the scenario; the values of the latency are control periods
    start: float  # see `tiltsim.sweeps.chunks.boundary`
    stop: float  # see `tiltsim.sweeps.chunks.boundary`
    step: float  # see `tiltsim.sweeps.chunks.boundary`
    tolerance: float  # see `tiltsim.sweeps.chunks.boundary`


SEARCHES: Final = {
    "max_latency": Search("simulation.control_latency", 0.0, 20.0, 4.0, 1.0),
    "max_mass_factor": Search("model_error.mass", 1.0, 3.0, 0.25, 0.05),
    "min_thrust_factor": Search("model_error.thrust_coefficient", 1.0, 0.3, 0.1, 0.02),
    "max_inertia_factor": Search("model_error.inertia", 1.0, 6.0, 0.5, 0.1),
}
"""Measures of robustness: each the last value found that is survived."""

CONTACTS: Final = ("rms_force_error", "peak_force", "time_in_contact", "final_swing")
"""Metrics of flights that push, touch or carry a load; null in the others."""

MEASURES: Final = (
    "rms_position_error",
    "max_position_error",
    "final_position_error",
    "rms_yaw_error",
    "rms_rotor_acceleration",
    "tilt_travel",
    "min_singularity_margin",
    "min_rotor_speed",
    "saturated_fraction",
    *CONTACTS,
    *SEARCHES,
    "control_period",
    "time_per_call",
    "compiled_time_per_call",
)
"""Numbers of a row; null where a flight has none, or a search did not survive its start."""

SCALES: Final = ("idle_position_error", "idle_yaw_error", "peak_rotor_speed")
"""Further ones: errors of a vehicle that stays where it began, and the greatest rotor speed."""


@dataclass(frozen=True)
class Compared:
    """One controller on one scenario."""

    row: dict[str, Any]  # the row that ``tiltsim compare --json`` prints
    time: Floats  # times of the samples, s, shape (N,)
    error: Floats  # distances from the reference, m, shape (N,)


@dataclass(frozen=True, eq=False)
class Entry:
    """One controller on one scenario, to be flown."""

    address: str  # address of the scenario
    name: str  # name of the controller in the results
    table: Mapping[str, Any]
    """Its keys in place of the scenario's ``[controller]``; empty for the scenario's own."""
    overrides: Mapping[str, Any]  # further values by dotted key
    trusted: bool = False  # whether to execute Python code that the flight names

    def scenario(self) -> Scenario:
        """The scenario under this controller. Raises InputError if it refuses the controller."""
        changes = {**self._controller(), **self.overrides}
        return load_scenario(self.address, changes, trusted=self.trusted)

    def _controller(self) -> Mapping[str, Any]:
        """A whole table, even of the scenario's own law, which has its own gains."""
        if not self.table:
            return {}
        if any(key.startswith("controller") for key in self.overrides):
            return {f"controller.{key}": value for key, value in self.table.items()}
        return {"controller": dict(self.table)}


def controller_tables(names: Sequence[str]) -> dict[str, Mapping[str, Any]]:
    """The tables of laws with their default gains, or `GIVEN`, the scenario's own.

    Raises `InputError` if one does not exist.
    """
    known = [law for law in (GIVEN, *CONTROLLERS) if law not in ("python", "numpy")]
    for name in names:
        if name not in known:
            raise InputError(f"--controllers {name}: {choose(name, known)}")
    return {name: {} if name == GIVEN else {"law": name} for name in names}


def compare(
    addresses: Sequence[str],
    controllers: Mapping[str, Mapping[str, Any]],
    overrides: Mapping[str, Any],
    *,
    searches: bool = True,
    jobs: int = 1,
    trusted: bool = False,
) -> Iterator[Compared]:
    """Fly every scenario under every controller; yields them in this order.

    Args:
        addresses: Addresses of scenarios.
        controllers: Their tables by name, see `controller_tables`.
        overrides: Values by dotted key, for all flights.
        searches: Whether robustness is sought, which takes some forty flights each.
        jobs: Processes.
        trusted: Whether to execute Python code that scenario files name; code that the tables
            name is executed in any case.

    Raises:
        InputError: If no controller is given, a scenario does not exist, or code is not trusted.
    """
    if not controllers:
        raise InputError("--controllers: name one at least")
    entries = [
        Entry(address, name, table, overrides, trusted or "function" in table)
        for address in addresses
        for name, table in controllers.items()
    ]
    for address in addresses:
        load_scenario(address, overrides)
    yield from fly_entries(entries, searches=searches, jobs=jobs)


def fly_entries(
    entries: Sequence[Entry], *, searches: bool, timed: bool = True, jobs: int
) -> Iterator[Compared]:
    """Fly controllers on scenarios, in this order.

    Args:
        entries: Controllers and scenarios to fly.
        searches: Whether robustness is sought.
        timed: Whether control steps are timed.
        jobs: Processes.

    Raises:
        InputError: If one names Python code and is not trusted.
    """
    for entry in entries:
        try:
            scenario = entry.scenario()
        except InputError:  # a refusal is part of the result
            continue
        require_trust(scenario)
    work = partial(compare_one, searches=searches, timed=timed)
    if jobs == 1:
        yield from map(work, entries)
        return
    places = {entry: place for place, entry in enumerate(entries)}
    flown = in_processes(work, entries, jobs)
    yield from in_order((places[entry], future.result()) for entry, future in flown)


def refusal(row: Mapping[str, Any]) -> str | None:
    """Why a scenario refuses the controller, without its address; None if it does not."""
    reason: str | None = row["refused"]
    return None if reason is None else reason.removeprefix(f"{row['scenario']}: ")


def compare_one(entry: Entry, *, searches: bool, timed: bool = True) -> Compared:
    """One controller on one scenario; a scenario that refuses it is part of the result.

    ``searches`` seeks robustness, ``timed`` times control steps.
    """
    row: dict[str, Any] = {"controller": entry.name, "scenario": entry.address}
    try:
        scenario = entry.scenario()
        assembly = assemble(scenario)
        flight = simulate_to_end(_engine(scenario, searches))
    except InputError as error:
        refused = {"end": "refused", "refused": str(error), **dict.fromkeys((*MEASURES, *SCALES))}
        return Compared(row | refused | {"latency_refused": None}, np.zeros(0), np.zeros(0))
    row |= {"end": flight.end.kind, "refused": None, **_tracking(flight)}
    row["tilt_travel"] = _tilt_travel(flight)
    row["peak_rotor_speed"] = float(np.abs(flight["rotor_speeds"]).max())
    metrics = flight.metrics()
    for measure in MEASURES:
        row[measure] = row.get(measure, metrics.get(measure))
    for measure, search in SEARCHES.items():
        row[measure] = _survived(scenario, search) if searches else None
    row["control_period"] = _control_period(scenario)
    row["time_per_call"] = time_per_call(assembly) if timed else None
    row["compiled_time_per_call"] = compiled_time_per_call(scenario) if searches else None
    row["latency_refused"] = _latency_refusal(scenario) if searches else None
    row = {key: _number(value) for key, value in row.items()}
    return Compared(row, flight["time"], _distance(flight))


def _engine(scenario: Scenario, searches: bool) -> Scenario:
    """With compiled code if all flights of a search together repay it."""
    simulation = scenario.simulation
    together = 25 * simulation.steps
    if not searches or simulation.engine != "auto" or together < MIN_STEPS_TO_COMPILE:
        return scenario
    return scenario.replace({"simulation.engine": "native"})


def _number(value: Any) -> Any:
    """JSON has no NaN."""
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _distance(flight: Flight) -> Floats:
    """Distance of the vehicle from its reference, m; of the altitude where only that is given."""
    error = flight["reference_position"] - flight["position"]
    if not flight.assembly.follows_position:
        return np.abs(error[:, 2])
    return np.asarray(np.linalg.norm(error, axis=1))


def _tracking(flight: Flight) -> dict[str, float]:
    error = _distance(flight)
    last = in_last_second(flight["time"], flight.scenario.simulation.timestep)
    idle = np.linalg.norm(flight["reference_position"] - flight["position"][0], axis=1)
    return {
        "final_position_error": float(error[last].mean()),
        "rms_yaw_error": _yaw_error(flight, flight["yaw"]),
        "idle_position_error": float(np.sqrt(np.mean(idle**2))),
        "idle_yaw_error": _yaw_error(flight, flight["yaw"][0]),
    }


def _yaw_error(flight: Flight, yaw: Any) -> float:
    """Root mean square of a yaw's error over the flight, rad, each the shorter way around."""
    if "yaw_ref" not in flight.units:
        return nan
    error = flight["yaw_ref"] - yaw
    return float(np.sqrt(np.mean(np.arctan2(np.sin(error), np.cos(error)) ** 2)))


def _tilt_travel(flight: Flight) -> float:
    """The way of all tilts, rad."""
    if len(flight) < 2:
        return nan
    columns = [name for name in flight.units if name.startswith("alpha_") and name[6:].isdecimal()]
    return sum(float(np.abs(np.diff(flight[name])).sum()) for name in columns)


def _control_period(scenario: Scenario) -> float:
    """Time (s) between control samples when latencies are sought."""
    simulation = scenario.simulation
    steps = simulation.control_steps or max(1, round(CONTROL_PERIOD / simulation.timestep))
    return steps * simulation.timestep


def _survived(scenario: Scenario, search: Search) -> float | None:
    """The last value up to which the controller flies; None if it does not at the true one."""
    simulation, latency, period = scenario.simulation, {}, _control_period(scenario)
    if "latency" in search.key:
        latency = _sampled(scenario)
    else:
        scenario = _engine(scenario, searches=True)

    def flies(value: float) -> bool:
        given: Any = value
        if latency:
            given = round(value) * period
        elif search.key.endswith("inertia"):
            given = [value] * 3
        try:
            flight = simulate_to_end(scenario.replace({**latency, search.key: given}))
        except InputError:  # not for this vehicle, or not with such a sample time
            return False
        last = in_last_second(flight["time"], simulation.timestep)
        settled = bool(_distance(flight)[last].max() <= WITHIN)
        return flight.end.kind == "completed" and settled

    found = _last(flies, search)
    return found * period if latency and found is not None else found


def _sampled(scenario: Scenario) -> dict[str, Any]:
    """Changes of a scenario in which latencies are sought."""
    period = _control_period(scenario)
    return {"simulation.control_timestep": period, "simulation.engine": "python"}


def _latency_refusal(scenario: Scenario) -> str | None:
    """Why the scenario cannot be flown with a sampled control law; None if it can."""
    try:
        assemble(scenario.replace(_sampled(scenario)))
    except InputError as error:
        return str(error)
    return None


def _last(holds: Callable[[float], bool], search: Search) -> float | None:
    walk = boundary(search.start, search.stop, search.step, search.tolerance)
    value = next(walk)
    while True:
        try:
            value = walk.send(holds(value))
        except StopIteration as end:
            return None if end.value.holds is None else float(end.value.holds)


def is_last_tried(row: Mapping[str, Any], measure: str) -> bool:
    """Whether a search ended because it tries nothing beyond, not because a flight failed."""
    search = SEARCHES.get(measure)
    if search is None or row[measure] is None:
        return False
    last = search.stop * (row["control_period"] if "latency" in search.key else 1.0)
    return isclose(row[measure], last)


def why_none(row: Mapping[str, Any], measure: str) -> str:
    """In place of a measure that is None: lost, refused, or - where there is nothing to measure."""
    if measure not in SEARCHES or row["end"] == "refused":
        return "-"
    return "refused" if measure == "max_latency" and row["latency_refused"] else "lost"
