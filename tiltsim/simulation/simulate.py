"""Simulate a scenario: advance the plant, record samples, find the end."""

from collections.abc import Callable, Iterable, Mapping
from math import copysign, isfinite
from os import PathLike
from time import perf_counter
from typing import Any, Final

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.limits import (
    ALTITUDE_ERROR,
    BODY_RATE,
    HORIZONTAL_ERROR,
    ROTOR_SPEED,
    SINGULAR,
    VEHICLE,
    WITHIN_LIMITS,
    altitude_error,
    horizontal_error,
)
from tiltsim.engines.base import EngineName
from tiltsim.engines.sample_evaluation import termination_checks
from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import assemble
from tiltsim.plants.command import Controller, ControllerError
from tiltsim.plants.commanded_plant import UserControlledPlant
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.plants.plant import EquationsPlant, Plant, take_sample
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.arguments import Report, reported, warn_user
from tiltsim.system.text import short_repr
from tiltsim_controllers.mathematics.scalar import Floats, Values


class TerminationMonitor:
    """Decides from the samples of one flight whether it ends early, and why."""

    def __init__(self, assembly: Assembly) -> None:
        self._assembly, self._loop, self._setup = assembly, assembly.loop, assembly.setup
        self._reference, self._knots = assembly.reference, assembly.knots
        self._checks = termination_checks(assembly)
        self._sides: dict[int, float] = {}

    def check(self, plant: Plant | None, sample: Floats) -> End | None:
        """The termination that a sample, shape (fields,), implies.

        It is of the plant's present state; None for a flight on arrays, which reports no fault.
        """
        time, *values = sample.tolist()
        state = dict(zip(self._loop.sample_fields, (time, *values), strict=True))
        finite = all(map(isfinite, state.values()))
        checks = self._checks(time, values) if finite else ()
        fault = "" if plant is None else plant.fault()
        if fault:
            return self._check_signs(time, state, checks) or End("diverged", time, fault)
        if not finite:
            name = next(name for name, value in state.items() if not isfinite(value))
            return End("diverged", time, f"{name} is no longer finite")
        return self._check_limits(time, state, int(checks[0])) or self._check_signs(
            time, state, checks
        )

    def _check_limits(self, time: float, state: dict[str, float], code: int) -> End | None:
        if code == WITHIN_LIMITS:
            return None
        number, code = divmod(code, VEHICLE)
        name = self._assembly.scenario.companion[number - 1].name if number else ""
        of = f"{name}_" if number else ""
        values = [value for field, value in state.items() if field != "time"]
        values = values if not number else [state[f"{of}{axis}"] for axis in "xyz"]
        if code == HORIZONTAL_ERROR:
            error = horizontal_error(time, values, self._reference, self._knots)
            cause = f"{error:.3g} m away from the reference"
        elif code == ALTITUDE_ERROR:
            error = altitude_error(time, values, self._reference, self._knots)
            cause = f"{error:.3g} m away from the reference altitude"
        elif code < ROTOR_SPEED:
            rate = "pqr"[code - BODY_RATE]
            cause = f"body rate {rate} = {state[f'{of}{rate}']:.3g} rad/s"
        else:
            rotor = code - ROTOR_SPEED + 1
            cause = f"rotor {rotor} at {state[f'{of}rotor_speed_{rotor}']:.3g} rad/s"
        return End("diverged", time, f"{name}: {cause}" if number else cause)

    def _check_signs(self, time: float, state: dict[str, float], checks: Values) -> End | None:
        for index, value in enumerate(checks[1:]):
            # A number that changes its sign between two samples was zero in between.
            side = 0.0 if abs(value) < SINGULAR else copysign(1.0, value)
            if side == 0.0 or side != self._sides.setdefault(index, side):
                return End("singular", time, self._loop.causes(state, self._setup)[index])
        return None


CHUNK_TIME: Final = 0.1
"""Wall time (s) of native code between checks of the samples and the keyboard."""

FIRST_STEPS: Final = 500  # of the first chunk of native code
LARGEST_CHUNK: Final = 100_000

Observer = Callable[[Floats], None]


def simulate(
    scenario: Scenario | str | PathLike[str] | Mapping[str, Any],
    observer: Observer | None = None,
    *,
    controller: Controller | type | str | None = None,
    reference: object = None,
    gait: object = None,
    progress: Report | bool | None = None,
) -> Flight:
    """Fly a scenario from start to end.

    Threads may call it at once; each flight is bit for bit the one that is flown alone. In parallel
    run native flights with the same kind of controller, and all native flights on the thesis plant;
    other flights in MuJoCo take turns, after each recorded sample or up to 0.1 s of native code.

    Args:
        scenario: Scenario to fly: anything that `tiltsim.load_scenario` takes. Python code that a
            file or dict names is executed; code that a `Scenario` names, if it was loaded with
            ``trusted=True``.
        observer: Called with every sample (floats in the order of `ClosedLoop.sample_fields`) as it
            is recorded.
        controller: A custom controller in place of the scenario's; see `tiltsim.load_scenario`.
            Threads do not share one that is a class.
        reference: A custom motion, as a function of time or a table; see `tiltsim.load_scenario`.
        gait: A custom gait, likewise.
        progress: True for a bar; or a function, called with the simulated time (s) now and then.

    Returns:
        All samples up to the end. A flight that diverges or reaches a singular decoupling matrix is
        a result, not an error: its log is complete up to there, and ``flight.end`` gives the cause
        and, to one physics step, the time. So is a flight that is interrupted, or whose custom
        controller raises an exception or returns an invalid command: Python also warns of that,
        with a RuntimeWarning, if the controller is not in a file.

    Raises:
        InputError: If the scenario or an argument is invalid, the vehicle cannot be built, or your
            controller cannot be used.
        KeyboardInterrupt: If interrupted before the first sample.
    """
    if observer is not None and not callable(observer):
        hint = "; overrides are for load_scenario" if isinstance(observer, Mapping) else ""
        raise InputError(f"observer = {short_repr(observer)}: must be callable{hint}")
    replaced = any(own is not None for own in (controller, reference, gait))
    if replaced or not isinstance(scenario, Scenario):
        named = not isinstance(scenario, Scenario)
        scenario = load_scenario(
            scenario, controller=controller, reference=reference, gait=gait, trusted=named
        )
    with reported(progress, "flight", scenario.simulation.duration) as report:
        flight = simulate_assembly(assemble(scenario), observer, report=report)
    if flight.end.kind == "failed" and scenario.own_controller is not None:
        warn_user(flight.end.message)
    return flight


def make_plant(
    assembly: Assembly, engine: EngineName | None = None, model: mujoco.MjModel | None = None
) -> Plant:
    """The plant that a scenario requests, at its initial state.

    Args:
        assembly: The flight.
        engine: Engine in place of the scenario's.
        model: Model for MuJoCo; default: the one that `flight_model` compiles.

    Raises:
        InputError: If MuJoCo cannot compile the vehicle, or the user's controller cannot be loaded.
    """
    if assembly.scenario.controller.is_external:
        return UserControlledPlant(assembly, model)
    if assembly.scenario.simulation.plant == "mujoco":
        return MujocoPlant(assembly, model, engine)
    return EquationsPlant(assembly, engine)


def simulate_to_end(scenario: Scenario) -> Flight:
    """`simulate` for one flight of many: raises `KeyboardInterrupt` when interrupted."""
    flight = simulate(scenario)
    if flight.end.kind == "interrupted":
        raise KeyboardInterrupt
    return flight


def simulate_assembly(
    assembly: Assembly,
    observer: Observer | None = None,
    *,
    plant: Plant | None = None,
    report: Report = lambda time: None,
) -> Flight:
    """`simulate` for a flight that is assembled already.

    Args:
        assembly: The flight.
        observer: See `simulate`.
        plant: Its plant at time zero; default: the one that the scenario requests.
        report: Called with the simulated time (s) after every chunk of samples.
    """
    simulation = assembly.scenario.simulation
    plant = plant or make_plant(assembly)
    monitor = TerminationMonitor(assembly)
    samples: list[Floats] = []

    def record(sample: Floats) -> None:
        samples.append(sample)
        if observer is not None:
            observer(sample)

    start = perf_counter()
    try:
        record(take_sample(plant))
        end = monitor.check(plant, samples[0])
        steps_left, chunk = simulation.steps, 1
        if plant.engine == "native":
            chunk = FIRST_STEPS // simulation.record_steps
        while steps_left > 0 and end is None:
            steps = min(simulation.record_steps, steps_left)
            count = max(1, min(chunk, steps_left // steps))
            began = perf_counter()
            flown, end = fly_chunk(plant, monitor, count, steps)
            for sample in flown:
                record(sample)
            report(float(samples[-1][0]))
            steps_left -= count * steps
            if plant.engine == "native":
                pace = CHUNK_TIME / max(perf_counter() - began, 1e-9)
                chunk = max(1, min(int(count * pace), 2 * count, LARGEST_CHUNK))
    except KeyboardInterrupt:
        if not samples:
            raise
        end = End("interrupted", float(samples[-1][0]), "interrupted from outside")
    except ControllerError as error:
        last, end = failure(plant, monitor, samples[-1][0], error)
        for sample in last:
            record(sample)
    wall_time = perf_counter() - start
    if end is None:
        end = End("completed", plant.time)
    return Flight(assembly, np.array(samples), end, plant.engine, wall_time)


def failure(
    plant: Plant, monitor: TerminationMonitor, recorded: float, error: ControllerError
) -> tuple[list[Floats], End]:
    """The last sample and the end of a flight whose own controller has failed.

    Args:
        plant, monitor: The plant, where it failed, and the monitor of its flight.
        recorded: Time (s) of the last sample that is recorded already.
        error: Error of the controller.

    Returns:
        A sample if there is a later one and it is finite, and the end.
    """
    sample = take_sample(plant)
    end = monitor.check(plant, sample) or End("failed", plant.time, str(error))
    is_new = sample[0] > recorded and np.isfinite(sample).all()
    return [sample] if is_new else [], end


def fly_chunk(
    plant: Plant, monitor: TerminationMonitor, samples: int, steps: int
) -> tuple[Iterable[Floats], End | None]:
    """Fly one or more recording intervals.

    If the flight ends within them, the last one is repeated step by step, to find the exact step.

    Args:
        plant, monitor: The plant, which is advanced, and the monitor of its flight.
        samples: Number of intervals.
        steps: Physics steps of each.

    Returns:
        The finite samples, and the end if the flight ended.
    """
    before = plant.state
    if samples > 1:
        flown = plant.record(samples, steps)
        if len(flown) == samples and monitor.check(plant, flown[-1]) is None:
            return flown, None
        plant.state, flown = before, flown[: samples - 1]
        plant.advance(len(flown) * steps)
        if plant.fault():
            plant.state, flown = before, flown[:0]
        rest, end = fly_chunks(plant, monitor, [(1, steps)] * (samples - len(flown)))
        return [*flown, *rest], end
    plant.advance(steps)
    sample = take_sample(plant)
    end = monitor.check(plant, sample)
    if end is not None:
        plant.state = before
        sample, end = _first_bad_step(plant, monitor, steps, sample, end)
    return [sample] if np.isfinite(sample).all() else [], end


def intervals_of(assembly: Assembly) -> list[int]:
    """Numbers of steps between the samples of a flight."""
    simulation = assembly.scenario.simulation
    full, rest = divmod(simulation.steps, simulation.record_steps)
    return [simulation.record_steps] * full + [rest] * (rest > 0)


def fly_chunks(
    plant: Plant, monitor: TerminationMonitor, chunks: Iterable[tuple[int, int]]
) -> tuple[list[Floats], End | None]:
    """`fly_chunk` one after the other, until the flight ends."""
    samples: list[Floats] = []
    for chunk in chunks:
        found, end = fly_chunk(plant, monitor, *chunk)
        samples.extend(found)
        if end is not None:
            return samples, end
    return samples, None


def _first_bad_step(
    plant: Plant, monitor: TerminationMonitor, steps: int, sample: Floats, end: End
) -> tuple[Floats, End]:
    """Repeat a recording interval step by step to find the step on which the flight ended."""
    for _ in range(steps):
        plant.advance(1)
        this = take_sample(plant)
        exact = monitor.check(plant, this)
        if exact is not None:
            return this, exact
    return sample, end
