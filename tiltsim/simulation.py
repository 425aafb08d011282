"""Simulate a scenario: advance the plant, record samples, notice when the flight is lost."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, hypot, isfinite
from time import perf_counter
from typing import Final

import numpy as np

from controllers.references import position_reference
from tiltsim.flight import End, Flight
from tiltsim.loop import Floats
from tiltsim.loops import control_setup, loop_of
from tiltsim.plants import Plant, make_plant
from tiltsim.scenario import Scenario

MAX_POSITION_ERROR: Final = 1e4  # m
MAX_BODY_RATE: Final = 1e3  # rad/s, far above what any rotorcraft survives
MAX_ROTOR_SPEED: Final = 1e5  # rad/s

SINGULAR: Final = 1e-9
"""What counts as zero, for a determinant of order one and all else that a loop watches."""

Observer = Callable[[Floats], None]


def simulate(scenario: Scenario, observer: Observer | None = None) -> Flight:
    """Fly a scenario from start to end.

    Parameters
    ----------
    scenario
        What to fly; see `tiltsim.load_scenario`.
    observer
        Called with every sample (floats in the order of `Loop.sample_fields`) as it is recorded.

    Returns
    -------
    Flight
        All samples up to the end. A flight that diverges or meets a singular decoupling matrix
        is a result, not an error: its log is complete up to there, and ``flight.end`` names the
        cause and, to one physics step, the time. So is a flight interrupted from the keyboard.
    """
    simulation = scenario.simulation
    plant = make_plant(scenario)
    watch = Watch(scenario)
    samples = [_sample(plant)]
    if observer is not None:
        observer(samples[0])
    end = watch.judge(plant, samples[0])
    steps_left = simulation.steps
    start = perf_counter()
    try:
        while steps_left > 0 and end is None:
            steps = min(simulation.record_steps, steps_left)
            before = plant.state
            plant.advance(steps)
            sample = _sample(plant)
            end = watch.judge(plant, sample)
            if end is not None:
                plant.state = before
                sample, end = _first_bad_step(plant, watch, steps, sample, end)
            if np.isfinite(sample).all():
                samples.append(sample)
                if observer is not None:
                    observer(sample)
            steps_left -= steps
    except KeyboardInterrupt:
        end = End("interrupted", float(samples[-1][0]), "interrupted from the keyboard")
    wall_time = perf_counter() - start
    if end is None:
        end = End("completed", plant.time)
    return Flight(scenario, np.array(samples), end, plant.engine, wall_time)


def _sample(plant: Plant) -> Floats:
    return np.array([plant.time, *plant.observe()])


def _first_bad_step(
    plant: Plant, watch: Watch, steps: int, sample: Floats, end: End
) -> tuple[Floats, End]:
    """Repeat a recording interval step by step to find the very step on which it went wrong."""
    for _ in range(steps):
        plant.advance(1)
        this = _sample(plant)
        verdict = watch.judge(plant, this)
        if verdict is not None:
            return this, verdict
    return sample, end


class Watch:
    """Decides from the samples of one flight whether it is lost, and why."""

    def __init__(self, scenario: Scenario) -> None:
        self._loop, self._setup = loop_of(scenario), control_setup(scenario)
        self._reference = scenario.reference.parameters
        self._table = scenario.reference.table
        self._follows_position = self._loop.follows_position(scenario)
        self._sides: dict[int, float] = {}

    def judge(self, plant: Plant, sample: Floats) -> End | None:
        """The end that a sample spells, None while the flight goes on."""
        state = dict(zip(self._loop.sample_fields, sample.tolist(), strict=True))
        time = state["time"]
        finite = all(map(isfinite, state.values()))
        fault = plant.fault()
        if fault:
            singular = self._judge_singularity(time, state) if finite else None
            return singular or End("diverged", time, fault)
        if not finite:
            name = next(name for name, value in state.items() if not isfinite(value))
            return End("diverged", time, f"{name} is no longer a finite number")
        return self._judge_limits(time, state) or self._judge_singularity(time, state)

    def _judge_limits(self, time: float, state: dict[str, float]) -> End | None:
        target = position_reference(time, self._reference, self._table)
        if self._follows_position:
            error = hypot(target[0] - state["x"], target[1] - state["y"])
            if error > MAX_POSITION_ERROR:
                return End("diverged", time, f"{error:.3g} m away from the reference")
        error = abs(target[2] - state["z"])
        if error > MAX_POSITION_ERROR:
            return End("diverged", time, f"{error:.3g} m away from the reference altitude")
        for name in ("p", "q", "r"):
            if abs(state[name]) > MAX_BODY_RATE:
                return End("diverged", time, f"body rate {name} = {state[name]:.3g} rad/s")
        for rotor in (1, 2, 3, 4):
            speed = state[f"rotor_speed_{rotor}"]
            if abs(speed) > MAX_ROTOR_SPEED:
                return End("diverged", time, f"rotor {rotor} at {speed:.3g} rad/s")
        return None

    def _judge_singularity(self, time: float, state: dict[str, float]) -> End | None:
        for index, (value, cause) in enumerate(self._loop.watched(state, self._setup)):
            # What changes its sign between two samples was zero in between.
            side = 0.0 if abs(value) < SINGULAR else copysign(1.0, value)
            if side == 0.0 or side != self._sides.setdefault(index, side):
                return End("singular", time, cause)
        return None
