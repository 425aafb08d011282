"""Controllers side by side: the same flights under each, what they cost, and what they survive."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isclose, nan
from time import perf_counter
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.laws.assembling import assemble
from tiltsim.plants.engine_choice import MIN_STEPS_TO_COMPILE
from tiltsim.plants.trust import require_trust
from tiltsim.scenario.controller import CONTROLLERS
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.messages import choose
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.simulate import simulate
from tiltsim.sweeps.search import boundary
from tiltsim.system.processes import in_processes
from tiltsim.vehicles.spans import in_last_second
from tiltsim_controllers.mathematics.scalar import Floats

GIVEN: Final = "given"
"""In place of a law: the scenario's own controller."""

CONTROL_PERIOD: Final = 0.005
"""s, of continuous controllers when latencies are sought."""

WITHIN: Final = 1.0
"""m: largest position error in the last second of a flight that counts as survived."""

CALLS: Final = 200
"""Control steps that are timed."""


@dataclass(frozen=True)
class Search:
    """A value at which a controller is tried, in ever larger steps away from the true one.

    Attributes:
        key: Of the scenario, except for the latency, which is in control periods.
        start, stop, step, tolerance: See `tiltsim.sweeps.search.boundary`.
    """

    key: str
    start: float
    stop: float
    step: float
    tolerance: float


SEARCHES: Final = {
    "max_latency": Search("simulation.control_latency", 0.0, 20.0, 4.0, 1.0),
    "max_mass_factor": Search("model_error.mass", 1.0, 3.0, 0.25, 0.05),
    "min_thrust_factor": Search("model_error.thrust_coefficient", 1.0, 0.3, 0.1, 0.02),
    "max_inertia_factor": Search("model_error.inertia", 1.0, 6.0, 0.5, 0.1),
}
"""Measures of robustness: each the last value found that is survived."""

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
    *SEARCHES,
    "control_period",
    "time_per_call",
)
"""Numbers of a row; null where a flight has none, or a search did not survive its start."""


@dataclass(frozen=True)
class Compared:
    """One controller on one scenario.

    Attributes:
        row: As ``tiltsim compare --json`` prints it.
        time, error: Of the flight: s, and the distance from the reference, m.
    """

    row: dict[str, Any]
    time: Floats
    error: Floats


Item = tuple[str, str]
"""Address of a scenario and name of a law."""


def compare(
    addresses: Sequence[str],
    controllers: Sequence[str],
    overrides: Mapping[str, Any],
    *,
    searches: bool = True,
    jobs: int = 1,
    trusted: bool = False,
) -> Iterator[Compared]:
    """Fly every scenario under every controller; yields them in this order.

    Args:
        addresses: Of scenarios.
        controllers: Laws, or `GIVEN`.
        overrides: Values by dotted key, for all flights.
        searches: Whether robustness is sought, which takes some forty flights each.
        jobs: Processes.
        trusted: Whether Python code that scenario files name may be executed.

    Raises:
        InputError: If a controller or scenario does not exist, or none is given.
    """
    known = [law for law in (GIVEN, *CONTROLLERS) if law not in ("python", "scalar")]
    for name in controllers or ("",):
        if name not in known:
            raise InputError(f"--controllers {name}: {choose(name, known)}")
    for address in addresses:
        require_trust(load_scenario(address, overrides), trusted)
    items = [(address, name) for address in addresses for name in controllers]
    work = partial(compare_one, overrides=overrides, searches=searches)
    if jobs == 1:
        yield from map(work, items)
        return
    done = {item: future.result() for item, future in in_processes(work, items, jobs)}
    yield from map(done.__getitem__, items)


def compare_one(item: Item, overrides: Mapping[str, Any], *, searches: bool) -> Compared:
    """One controller on one scenario; a scenario that refuses it is part of the result."""
    address, name = item
    row: dict[str, Any] = {"controller": name, "scenario": address}
    try:
        scenario = load_scenario(address, {**_with_law(name, overrides), **overrides})
        assembly = assemble(scenario)
        flight = simulate(_engine(scenario, searches))
    except InputError as error:
        refusal = {"end": "refused", "refused": str(error), **dict.fromkeys(MEASURES)}
        return Compared(row | refusal, np.zeros(0), np.zeros(0))
    row |= {"end": flight.end.kind, "refused": None, **_tracking(flight), **_effort(flight)}
    metrics = flight.metrics()
    for measure in ("min_singularity_margin", "min_rotor_speed", "saturated_fraction"):
        row[measure] = metrics.get(measure)
    for measure, search in SEARCHES.items():
        row[measure] = _survived(scenario, search) if searches else None
    row["control_period"] = _control_period(scenario)
    row["time_per_call"] = _time_per_call(assembly)
    row = {key: _number(value) for key, value in row.items()}
    return Compared(row, flight["time"], _distance(flight))


def _with_law(name: str, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """A law in place of the scenario's own table, even of the same law, which has its own gains."""
    if name == GIVEN:
        return {}
    gains_given = any(key.startswith("controller") for key in overrides)
    return {"controller.law": name} if gains_given else {"controller": {"law": name}}


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
    """How far the vehicle is from its reference, m; in altitude where it follows no more."""
    error = flight["reference_position"] - flight["position"]
    if flight.scenario.reference.kind == "attitude_altitude":
        return np.abs(error[:, 2])
    return np.asarray(np.linalg.norm(error, axis=1))


def _tracking(flight: Flight) -> dict[str, float]:
    error = _distance(flight)
    last = in_last_second(flight["time"], flight.scenario.simulation.timestep)
    return {
        "rms_position_error": float(np.sqrt(np.mean(error**2))),
        "max_position_error": float(error.max()),
        "final_position_error": float(error[last].mean()),
        "rms_yaw_error": _yaw_error(flight),
    }


def _yaw_error(flight: Flight) -> float:
    """Root mean square over the flight, rad, each the shorter way around."""
    if "yaw_ref" not in flight.units:
        return nan
    error = flight["yaw_ref"] - flight["yaw"]
    return float(np.sqrt(np.mean(np.arctan2(np.sin(error), np.cos(error)) ** 2)))


def _effort(flight: Flight) -> dict[str, float]:
    """Root mean square of the rotors' accelerations, rad/s^2, and the way of all tilts, rad."""
    if len(flight) < 2:
        return {"rms_rotor_acceleration": nan, "tilt_travel": nan}
    change = np.diff(flight["rotor_speeds"], axis=0) / np.diff(flight["time"])[:, np.newaxis]
    columns = [name for name in flight.units if name.startswith("alpha_") and name[6:].isdecimal()]
    travel = sum(float(np.abs(np.diff(flight[name])).sum()) for name in columns)
    return {"rms_rotor_acceleration": float(np.sqrt(np.mean(change**2))), "tilt_travel": travel}


def _control_period(scenario: Scenario) -> float:
    """Time (s) between control samples when latencies are sought."""
    simulation = scenario.simulation
    steps = simulation.control_steps or max(1, round(CONTROL_PERIOD / simulation.timestep))
    return steps * simulation.timestep


def _survived(scenario: Scenario, search: Search) -> float | None:
    """The last value up to which the controller flies; None if it does not at the true one."""
    simulation, latency, period = scenario.simulation, {}, _control_period(scenario)
    if "latency" in search.key:
        latency = {"simulation.control_timestep": period, "simulation.engine": "python"}
    else:
        scenario = _engine(scenario, searches=True)

    def flies(value: float) -> bool:
        given: Any = value
        if latency:
            given = round(value) * period
        elif search.key.endswith("inertia"):
            given = [value] * 3
        try:
            flight = simulate(scenario.replace({**latency, search.key: given}))
        except InputError:  # not for this vehicle, or not with such a sample time
            return False
        last = in_last_second(flight["time"], simulation.timestep)
        settled = bool(_distance(flight)[last].max() <= WITHIN)
        return flight.end.kind == "completed" and settled

    found = _last(flies, search)
    return found * period if latency and found is not None else found


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


def _time_per_call(assembly: Assembly) -> float:
    """Seconds that one control step takes in Python, the least of a few rounds."""
    loop, setup = assembly.loop, assembly.setup
    if assembly.scenario.controller.is_external:
        return nan
    qpos, qvel = loop.kind.initial_motion(assembly)
    act = tuple(map(float, loop.dynamics.initial_activations(assembly, setup)))
    vectors = tuple(map(float, qpos)), tuple(map(float, qvel)), act
    rounds = []
    for _ in range(3):
        start = perf_counter()
        for _ in range(CALLS):
            loop.sampling.controls(0.0, *vectors, setup.parameters, setup.knots)
        rounds.append((perf_counter() - start) / CALLS)
    return min(rounds)
