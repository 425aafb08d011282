"""How fast the closed loop runs, as a share of bare MuJoCo on the same model in the same run."""

from __future__ import annotations

from statistics import median
from time import perf_counter
from typing import Any, Final

import mujoco

from tiltsim.engine import EngineName, control_callback, make_engine
from tiltsim.loading import parse_scenario
from tiltsim.loops.tiltrotor import TILTROTOR
from tiltsim.plants import MujocoPlant

INTEGRATORS: Final = ("RK4", "implicitfast", "Euler")
ROUNDS: Final = 15
ENGINES: Final[tuple[EngineName, ...]] = ("python", "native")
STEPS: Final = {"bare": 4000, "native": 4000, "python": 800}
"""Steps of one timing, long enough for the clock and short enough to take turns."""


def flying_plant(integrator: str) -> MujocoPlant:
    """A tiltrotor in steady flight with tilted rotors: every part of the loop has work to do."""
    plant = MujocoPlant(
        parse_scenario(
            {
                "simulation": {"integrator": integrator, "engine": "native"},
                "gait": {"type": "fixed", "angles": [-0.65, -0.65, 0.65, 0.65]},
            }
        )
    )
    plant.advance(10_000)
    return plant


def bench_single(integrator: str, rounds: int = ROUNDS) -> list[dict[str, Any]]:
    """Time one vehicle: bare ``mj_step`` with frozen controls, then each engine, in turns.

    Each turn starts from the same flying state. Rows as in ``tiltsim bench --json``; ``ratio`` is
    the median over the turns of bare time over engine time.
    """
    plant = flying_plant(integrator)
    model, data, state = plant.model, plant.data, plant.state
    callbacks = {"bare": None} | {
        name: make_engine(name, TILTROTOR, model, data).callback() for name in ENGINES
    }
    seconds: dict[str, list[float]] = {name: [] for name in callbacks}
    for turn in range(rounds + 1):
        for name, callback in callbacks.items():
            plant.state = state
            per_step = _time(plant, callback, STEPS[name])
            if turn > 0:  # the first turn warms caches
                seconds[name].append(per_step)
    timestep = float(model.opt.timestep)
    return [
        {
            "case": "single",
            "engine": name,
            "integrator": integrator,
            "vehicles": 1,
            "threads": 1,
            "steps_per_second": 1.0 / median(values),
            "ratio": median(
                bare / value for bare, value in zip(seconds["bare"], values, strict=True)
            ),
            "realtime_factor": timestep / median(values),
        }
        for name, values in seconds.items()
    ]


def _time(plant: MujocoPlant, callback: Any, steps: int) -> float:
    """Seconds a step."""
    with control_callback(callback):
        start = perf_counter()
        mujoco.mj_step(plant.model, plant.data, nstep=steps)
        return (perf_counter() - start) / steps


def run_benchmark() -> list[dict[str, Any]]:
    """All rows of the benchmark."""
    return [row for integrator in INTEGRATORS for row in bench_single(integrator)]
