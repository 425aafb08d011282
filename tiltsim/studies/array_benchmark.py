"""Speed of flights on arrays: vehicle steps per second, by number of vehicles and precision."""

from __future__ import annotations

import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter
from typing import Any, Final

import numpy as np

from tiltsim.arrays.flying import Batch, course_of, double_precision
from tiltsim.arrays.jax_arrays import require_jax
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import load_scenario
from tiltsim.simulation.array_batch import numbers_of

ADDRESS: Final = "ch04_tracking/circle#continuous_t2_modified"
"""What is flown: the circle with the continuous trot."""

VEHICLES: Final = (1, 64, 1024, 16384)
TOTAL_STEPS: Final = 1_000_000
"""Steps of all vehicles together in one timing, roughly."""

ROUNDS: Final = 3


def bench_arrays(vehicles: Iterable[int] = VEHICLES) -> list[dict[str, Any]]:
    """Time batches in JAX on all cores; every vehicle has a mass of its own.

    The rows are those of ``tiltsim bench --json``, with ``precision`` and ``compile_seconds``.
    """
    require_jax("tiltsim bench --arrays")
    vehicles = tuple(vehicles)
    return [_row(n, precision) for precision in ("float64", "float32") for n in vehicles]


def _row(vehicles: int, precision: str) -> dict[str, Any]:
    """Time one batch; the shortest of the rounds counts."""
    changes = {"plant": "thesis", "engine": "jax", "precision": precision}
    scenario = load_scenario(
        ADDRESS, {"expect": [], **{f"simulation.{key}": value for key, value in changes.items()}}
    )
    assembly = assemble(scenario)
    steps = min(10_000, max(50, TOTAL_STEPS // vehicles))
    course = course_of(assembly)._replace(steps=steps, record_steps=steps)
    numbers: list[float | None] = [*numbers_of(assembly)]
    mass = assembly.setup.parameters.law.vehicle.mass
    numbers[numbers.index(mass)] = None
    batch = Batch(course, tuple(numbers), tuple(assembly.setup.knots))
    threads = min(os.cpu_count() or 1, vehicles)
    masses = (mass * np.linspace(0.99, 1.01, vehicles))[:, np.newaxis].astype(precision)
    parts = np.array_split(masses, threads)

    def fly(part: Any) -> None:
        with double_precision():
            batch.record(part, np.zeros((len(part), 0), precision)).samples.block_until_ready()

    with ThreadPoolExecutor(threads) as pool:
        seconds = []
        for _ in range(1 + ROUNDS):
            start = perf_counter()
            list(pool.map(fly, parts))
            seconds.append(perf_counter() - start)
    best = min(seconds[1:])
    return {
        "case": "arrays",
        "engine": "jax",
        "integrator": "ode3",
        "vehicles": vehicles,
        "threads": threads,
        "steps_per_second": vehicles * steps / best,
        "ratio": None,
        "realtime_factor": vehicles * steps * course.timestep / best,
        "timestep": course.timestep,
        "precision": precision,
        "compile_seconds": seconds[0] - best,
    }
