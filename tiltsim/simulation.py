"""Simulate a scenario: advance the plant, record samples, notice when the flight is lost."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, hypot, isfinite
from time import perf_counter
from typing import Final

import numpy as np

from controllers.decoupling_matrix import sines_and_cosines, torque_entries, torque_free_force
from controllers.references import position_reference
from controllers.rotation import world_up_in_body
from controllers.vehicle import SPIN, drag_ratio
from tiltsim.flight import ROTOR_SPEEDS, SAMPLE_FIELDS, TILTS, End, Flight, Floats
from tiltsim.parameters import control_setup
from tiltsim.plants import Plant, make_plant
from tiltsim.scenario import Scenario

X, Y, Z, ROLL, PITCH = (SAMPLE_FIELDS.index(name) for name in ("x", "y", "z", "roll", "pitch"))
BODY_RATES: Final = slice(SAMPLE_FIELDS.index("p"), SAMPLE_FIELDS.index("r") + 1)

MAX_POSITION_ERROR: Final = 1e4  # m
MAX_BODY_RATE: Final = 1e3  # rad/s, far above what any rotorcraft survives
MAX_ROTOR_SPEED: Final = 1e5  # rad/s

SINGULAR: Final = 1e-9
"""Determinant ``n . r3`` (4 for an untilted level vehicle) that counts as zero."""

Observer = Callable[[Floats], None]


def simulate(scenario: Scenario, observer: Observer | None = None) -> Flight:
    """Fly a scenario from start to end.

    Parameters
    ----------
    scenario
        What to fly; see `tiltsim.load_scenario`.
    observer
        Called with every sample (floats in the order of `SAMPLE_FIELDS`) as it is recorded.

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
        self._law = control_setup(scenario).parameters.law
        self._scenario = scenario
        self._initial_side = 0.0

    def judge(self, plant: Plant, sample: Floats) -> End | None:
        """The end that a sample spells, None while the flight goes on."""
        values = sample.tolist()
        time = values[0]
        finite = all(map(isfinite, values))
        fault = plant.fault()
        if fault:
            singular = self._judge_singularity(time, values) if finite else None
            return singular or End("diverged", time, fault)
        if not finite:
            name = SAMPLE_FIELDS[[isfinite(value) for value in values].index(False)]
            return End("diverged", time, f"{name} is no longer a finite number")
        return self._judge_limits(time, values) or self._judge_singularity(time, values)

    def _judge_limits(self, time: float, sample: list[float]) -> End | None:
        target = position_reference(time, self._law.reference)
        if self._scenario.controller.decoupler != "none":
            error = hypot(target[0] - sample[X], target[1] - sample[Y])
            if error > MAX_POSITION_ERROR:
                return End("diverged", time, f"{error:.3g} m away from the reference")
        error = abs(target[2] - sample[Z])
        if error > MAX_POSITION_ERROR:
            return End("diverged", time, f"{error:.3g} m away from the reference altitude")
        for name, rate in zip("pqr", sample[BODY_RATES]):
            if abs(rate) > MAX_BODY_RATE:
                return End("diverged", time, f"body rate {name} = {rate:.3g} rad/s")
        for rotor, speed in enumerate(sample[ROTOR_SPEEDS], start=1):
            if abs(speed) > MAX_ROTOR_SPEED:
                return End("diverged", time, f"rotor {rotor} at {speed:.3g} rad/s")
        return None

    def _judge_singularity(self, time: float, sample: list[float]) -> End | None:
        roll, pitch, tilts = sample[ROLL], sample[PITCH], sample[TILTS]
        trig = sines_and_cosines(*tilts)
        ratio = drag_ratio(self._law.vehicle)
        n = torque_free_force(trig, torque_entries(trig, ratio), ratio)
        up = world_up_in_body(roll, pitch)
        determinant = n[0] * up[0] + n[1] * up[1] + n[2] * up[2]
        # A determinant that changes its sign between two samples was zero in between.
        side = 0.0 if abs(determinant) < SINGULAR else copysign(1.0, determinant)
        if self._initial_side == 0.0:
            self._initial_side = side
        if side == 0.0 or side != self._initial_side:
            angles = ", ".join(f"{tilt:.3g}" for tilt in tilts)
            cause = (
                f"the decoupling matrix became singular at roll = {roll:.3g} rad, "
                f"pitch = {pitch:.3g} rad, tilt angles ({angles}) rad"
            )
            return End("singular", time, cause)
        if self._scenario.controller.decoupling == "exact":
            for rotor, (sign, speed) in enumerate(zip(SPIN, sample[ROTOR_SPEEDS]), start=1):
                if sign * speed <= 0.0:
                    cause = f"the decoupling matrix became singular: rotor {rotor} came to a stop"
                    return End("singular", time, cause)
        return None
