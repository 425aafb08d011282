"""Speed of the closed loop relative to bare MuJoCo on the same model in the same run.

All variants are timed in rounds: in each round one after the other, from the same state. The ratio
of a variant is the median over the rounds of bare time over its time, so that a busy machine, or a
change of its clock, affects all variants of a round alike.
"""

import os
import sys
from collections.abc import Callable
from functools import partial
from math import nan
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, Final

import mujoco
import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.userdata import CONTROL_PERIOD as PERIOD_IN_USERDATA
from tiltsim.closed_loop.userdata import Header
from tiltsim.engines.base import EngineName
from tiltsim.engines.control import compile_empty, control_callback, control_step, make_callback
from tiltsim.laws.assembling import assemble
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.scenario.loading import parse_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.batch import fly
from tiltsim.simulation.simulate import simulate_to_end

INTEGRATORS: Final = ("RK4", "implicitfast", "Euler")
ROUNDS: Final = 15
ENGINES: Final[tuple[EngineName, ...]] = ("python", "native")
STEPS: Final = 3000
PYTHON_STEPS: Final = 400
"""Steps per timing: long enough for the clock, short enough for many rounds."""

RECORD_STEPS: Final = 10
BATCH_ROWS: Final = 64
BATCH_STEPS: Final = 200
BATCH_ROUNDS: Final = 9

CALLS: Final = 200  # control steps that are timed together
CALL_ROUNDS: Final = 40  # timings of compiled code, of which the least counts
ACCURACY_STEPS: Final = (0.008, 0.004, 0.002, 0.001, 0.0005)
REFERENCE_STEP: Final = 0.0001
ACCURACY_DURATION: Final = 8.0

TROT: Final = {"type": "fixed", "angles": [-0.65, -0.65, 0.65, 0.65]}

Rows = list[dict[str, Any]]
Variants = dict[tuple[str, str], Callable[[], float]]
"""Seconds per step of one timing, by case and engine."""


def flying_plant(integrator: str) -> tuple[Assembly, MujocoPlant]:
    """A tiltrotor in steady flight with tilted rotors, so that every part of the loop is active."""
    simulation = {"integrator": integrator, "engine": "native"}
    assembly = assemble(parse_scenario({"simulation": simulation, "gait": TROT}))
    plant = MujocoPlant(assembly)
    plant.advance(10_000)
    return assembly, plant


def bench_single(integrator: str, rounds: int = ROUNDS) -> Rows:
    """Time one vehicle: bare ``mj_step`` with constant controls, and each engine.

    ``empty`` is a native callback that does nothing: bare MuJoCo without its timers, which native
    callbacks disable. The cost of a controller is the difference from ``empty`` to ``native``.
    ``recorded`` takes a sample every tenth step. Rows as in ``tiltsim bench --json``.
    """
    assembly, plant = flying_plant(integrator)
    model, data, state = plant.model, plant.data, plant.state
    callbacks = {"bare": None, "empty": compile_empty()} | {
        name: make_callback(name, assembly, model, data) for name in ENGINES
    }

    def stepping(callback: Any, steps: int) -> Callable[[], float]:
        def run() -> float:
            plant.state = state
            with control_callback(callback):
                return _seconds(lambda: mujoco.mj_step(model, data, nstep=steps)) / steps

        return run

    def recording() -> float:
        plant.state = state
        seconds = _seconds(lambda: plant.record(STEPS // RECORD_STEPS, RECORD_STEPS))
        return seconds / STEPS

    variants: Variants = {
        ("single", name): stepping(callback, PYTHON_STEPS if name == "python" else STEPS)
        for name, callback in callbacks.items()
    }
    variants["recorded", "native"] = recording
    shared = {"integrator": integrator, "vehicles": 1, "threads": 1}
    return _compare(variants, rounds, float(model.opt.timestep), shared)


def bench_batch(integrator: str, threads: int, rounds: int = BATCH_ROUNDS) -> Rows:
    """Time a batch of vehicles: open loop with constant controls, and the native engine."""
    from mujoco.batch import Batch

    _, plant = flying_plant(integrator)
    batch = Batch(plant.model, BATCH_ROWS, threads)
    state, steps = plant.state, BATCH_ROWS * BATCH_STEPS

    def stepping(callback: Any) -> Callable[[], float]:
        def run() -> float:
            batch.state[:] = state
            with control_callback(callback):
                return _seconds(lambda: batch.step(nstep=BATCH_STEPS)) / steps

        return run

    variants = {("batch", "bare"): stepping(None), ("batch", "native"): stepping(plant.callback)}
    shared = {"integrator": integrator, "vehicles": BATCH_ROWS, "threads": threads}
    return _compare(variants, rounds, float(plant.model.opt.timestep), shared)


def bench_flights(vehicles: int, duration: float, integrator: str, timestep: float) -> Rows:
    """Time whole flights with samples, termination checks and metrics.

    Args:
        vehicles: Number of flights.
        duration: Duration of each flight, s.
        integrator: MuJoCo's.
        timestep: Time step of the physics, s.

    Returns:
        One row without a ratio; ``memory`` is the peak of the process, bytes, or None
        where the system does not tell.
    """
    simulation = {"integrator": integrator, "duration": duration, "timestep": timestep}
    scenarios = [_trotting(index, simulation) for index in range(vehicles)]
    for _ in fly(scenarios[:1]):
        pass  # native code is compiled or loaded before the clock starts
    row, seconds, completed = _time_flights("flights", scenarios)
    return [row | {"seconds": seconds, "memory": _peak_memory(), "completed": completed}]


def _peak_memory() -> int | None:
    """Peak memory of this process, bytes; None where the system does not tell, as on Windows."""
    try:
        # Linux: getrusage may give the peak of the program that started this one.
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return int(status.split("VmHWM:")[1].split()[0]) * 1024
    except (OSError, IndexError):
        if sys.platform == "win32":
            return None
        import resource

        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak if sys.platform == "darwin" else peak * 1024


def bench_accuracy() -> Rows:
    """Position error of RK4 for several time steps, and the speed of all cores together.

    The error (m) is the maximum difference of any coordinate from the flight with the reference
    step, over the samples of the flight.
    """
    reference = _positions(REFERENCE_STEP)
    rows = []
    for timestep in ACCURACY_STEPS:
        error = float(np.abs(_positions(timestep) - reference).max())
        row, *_ = _time_flights("accuracy", [_circling(timestep)] * BATCH_ROWS)
        rows.append(row | {"position_error": error})
    return rows


def _time_flights(case: str, scenarios: list[Scenario]) -> tuple[dict[str, Any], float, int]:
    """Row, seconds and number of completed flights, for equally long flights on all cores."""
    start = perf_counter()
    kinds = [result.end.kind for result in fly(scenarios)]
    seconds = perf_counter() - start
    simulation, vehicles = scenarios[0].simulation, len(scenarios)
    row = {
        "case": case,
        "engine": "native",
        "integrator": simulation.integrator,
        "vehicles": vehicles,
        "threads": os.cpu_count() or 1,
        "steps_per_second": vehicles * simulation.steps / seconds,
        "ratio": None,
        "realtime_factor": vehicles * simulation.duration / seconds,
        "timestep": simulation.timestep,
    }
    return row, seconds, kinds.count("completed")


def _trotting(index: int, simulation: dict[str, Any]) -> Scenario:
    """One vehicle of many, each with a different mass and start."""
    return parse_scenario(
        {
            "simulation": {"engine": "native", **simulation},
            "vehicle": {"mass": 0.429 * (1.0 + 1e-5 * index)},
            "gait": TROT,
            "initial": {"position": [1e-3 * index, 0.0, 0.0]},
        }
    )


def _circling(timestep: float) -> Scenario:
    """Ch. 4's circle with the exact control law; the servo is slow enough for steps of 8 ms."""
    return parse_scenario(
        {
            "simulation": {
                "engine": "native",
                "duration": ACCURACY_DURATION,
                "timestep": timestep,
                "record_timestep": 0.2,
            },
            "vehicle": {"tilt_servo": {"natural_frequency": 150.0}},
            "controller": {"decoupling": "exact", "gains": "exact", "decoupler": "exact"},
            "gait": {"type": "fixed", "angles": [-0.3, -0.3, 0.3, 0.3]},
            "reference": {"type": "circle", "radius": 5.0, "angular_frequency": 0.1},
            "initial": {"position": [5.0, 0.0, 0.0]},
        }
    )


def _positions(timestep: float) -> np.ndarray[Any, Any]:
    flight = simulate_to_end(_circling(timestep))
    return np.stack([flight[axis] for axis in ("x", "y", "z")])


def _seconds(action: Callable[[], object]) -> float:
    start = perf_counter()
    action()
    return perf_counter() - start


def _compare(variants: Variants, rounds: int, timestep: float, shared: dict[str, Any]) -> Rows:
    """Rows of variants timed in rounds, the first one bare; ``shared`` has their common columns."""
    seconds: dict[tuple[str, str], list[float]] = {name: [] for name in variants}
    for round_ in range(rounds + 1):
        for name, run in variants.items():
            per_step = run()
            if round_ > 0:  # the first round warms the caches
                seconds[name].append(per_step)
    bare = next(iter(seconds.values()))
    return [
        {
            "case": case,
            "engine": engine,
            **shared,
            "steps_per_second": 1.0 / median(values),
            "ratio": median(b / v for b, v in zip(bare, values, strict=True)),
            "realtime_factor": timestep / median(values),
        }
        for (case, engine), values in seconds.items()
    ]


def time_per_call(assembly: Assembly) -> float:
    """Seconds that one control step takes on the Python engine, the least of a few rounds."""
    loop, setup = assembly.loop, assembly.setup
    if assembly.scenario.controller.is_external:
        return nan
    qpos, qvel = loop.kind.initial_motion(assembly)
    act = tuple(map(float, loop.initial_activations(assembly, setup)))
    header = [*Header(assembly.scenario.simulation.timestep)]
    others = [0.0] * loop.sizes.others, [0.0] * loop.sizes.history
    none: list[float] = []
    vectors = [*map(float, qpos)], [*map(float, qvel)], [*act], *others, none
    step = control_step(assembly, setup.userdata.tolist(), "controls")

    def calls() -> None:
        for _ in range(CALLS):
            step(header, *vectors)

    return min(_seconds(calls) for _ in range(3)) / CALLS


def compiled_time_per_call(scenario: Scenario) -> float:
    """Seconds that one control step takes in compiled code; NaN where it does not fly in MuJoCo.

    The difference, the least of a few rounds each, of MuJoCo's forward dynamics with the control
    step and with a callback that does nothing.
    """
    if scenario.controller.is_external or scenario.simulation.plant != "mujoco":
        return nan
    plant = MujocoPlant(assemble(scenario), engine="native")
    plant.data.userdata[PERIOD_IN_USERDATA] = 0.0  # the control step at every evaluation
    callbacks = plant.callback, compile_empty()

    def calls() -> None:
        for _ in range(CALLS):
            mujoco.mj_forward(plant.model, plant.data)

    rounds = []
    for _ in range(CALL_ROUNDS):  # by turns, as the speed of a machine changes
        for callback in callbacks:
            with control_callback(callback):
                rounds.append(_seconds(calls) / CALLS)
    return max(0.0, min(rounds[::2]) - min(rounds[1::2]))


def run_benchmark(progress: Callable[[int, int], None] = lambda done, total: None) -> Rows:
    """All rows of ``tiltsim bench``; ``progress`` is called with finished and all comparisons."""
    threads = sorted({1, os.cpu_count() or 1})
    comparisons = [partial(bench_single, integrator) for integrator in INTEGRATORS]
    comparisons += [partial(bench_batch, one, number) for one in INTEGRATORS for number in threads]
    rows: Rows = []
    for done, compare in enumerate(comparisons):
        progress(done, len(comparisons))
        rows += compare()
    return rows
