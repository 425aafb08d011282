"""Flights in threads: each is bit for bit the flight that is flown alone."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import product
from threading import Barrier, Thread

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.simulation.test_batch import (
    ALL_LAWS,
    EVERY_LAYER,
    EXACT,
    HELD,
    LATE,
    WITH_ACTUATORS,
    layered,
    scenario,
)
from tiltsim.engines.control import control_callback
from tiltsim.env.environment import TiltrotorEnv
from tiltsim.plants.command import Command
from tiltsim.simulation.batch import fly
from tiltsim.system.hooks import _IGNORE

THREADS = 16
HOVER = 0.429 * 9.8 / 4.0


def no_hooks():
    hooks = mujoco.get_mjcb_control(), mujoco.get_mjcb_time(), mujoco.get_mju_user_warning()
    return hooks[:2] == (None, None) and hooks[2] is not _IGNORE


def samples(flown):
    return tiltsim.simulate(flown).samples


def own_controller(observation):
    first = HOVER - 0.1 * observation.body_rates[0] + observation.time
    return Command(thrusts=[first, HOVER, HOVER, HOVER])


def flown_by_own_controller():
    vehicle = {"mass": 0.45, "rotor_inertia": 1e-6}  # each new speed turns the body
    flown = scenario({"vehicle": vehicle}, engine="python", duration=0.05)
    return tiltsim.simulate(flown, controller=own_controller).samples


def flown_in_the_environment():
    environment = TiltrotorEnv(seed=1)
    environment.reset()
    for thrust in (0.9, 1.0, 1.1):
        environment.step(np.array([thrust * HOVER] * 4 + [0.1] * 4))
    return environment.flight().samples


def flown_in_a_batch():
    scenarios = [scenario({"vehicle": {"mass": 0.4 + 0.01 * i}}) for i in range(3)]
    results = list(fly(scenarios, threads=2, keep_samples=True))
    return np.vstack([result.flight.samples for result in results])


def assert_the_same_in_threads(flights):
    alone = {flight: flight() for flight in dict.fromkeys(flights)}
    start = Barrier(THREADS)
    with ThreadPoolExecutor(THREADS, initializer=start.wait) as pool:
        together = list(pool.map(lambda flight: flight(), flights))
    for flight, found in zip(flights, together, strict=True):
        np.testing.assert_array_equal(found, alone[flight])
    assert no_hooks()


def test_sixteen_threads_fly_what_each_flies_alone():
    scenarios = [
        scenario(
            {"vehicle": {"mass": 0.4 + 0.01 * index}, "controller": EXACT},
            engine=engine,
            duration=0.04,
            control_timestep=0.004 * (index % 2),
        )
        for index, engine in enumerate(["python"] * 7 + ["native"] * 6)
    ]
    others = [flown_by_own_controller, flown_in_the_environment, flown_in_a_batch]
    flights = [lambda flown=flown: samples(flown) for flown in scenarios]
    assert len(flights + others) == THREADS
    assert_the_same_in_threads(flights + others)


@pytest.mark.slow(longest=True)
def test_two_hundred_flights_of_all_kinds_are_the_same_in_threads():
    engines, plants = ("python", "native"), ("mujoco", "thesis")
    layered_on = ("mujoco", EVERY_LAYER, LATE), ("thesis", WITH_ACTUATORS, HELD)
    scenarios = [
        scenario(table, engine=engine, plant=plant, control_timestep=held, duration=0.05)
        for table, engine, plant, held in product(ALL_LAWS.values(), engines, plants, (0.0, 0.004))
    ]
    scenarios += [
        layered(*layers, seed=seed, engine=engine, plant=plant, **timing)
        for engine, (plant, layers, timing), seed in product(engines, layered_on, (1, 2))
    ]
    flights = [lambda flown=flown: samples(flown) for flown in scenarios]
    flights += [flown_by_own_controller, flown_in_the_environment, flown_in_a_batch]
    assert_the_same_in_threads((flights * 3)[:200])


def test_threads_with_one_callback_step_at_the_same_time_and_others_in_turn():
    """Two blocks with one callback meet; a third, with another, waits until both have ended."""
    met, order = Barrier(2, timeout=300.0), []

    def native(_model, _data):
        """Stands for compiled code."""

    def together():
        with control_callback(native):
            met.wait()
            order.append(mujoco.get_mjcb_control())

    def in_turn():
        met.wait()
        with control_callback(None):
            order.append(mujoco.get_mjcb_control())

    threads = [Thread(target=together) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    met = Barrier(2, timeout=300.0)
    threads = [Thread(target=together), Thread(target=in_turn)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert order[:3] == [native, native, native]
    assert order[3] is None
    assert no_hooks()


def test_a_block_that_an_interrupt_kept_from_leaving_is_left_by_the_next():
    abandoned = control_callback(lambda _model, _data: None)

    def interrupted():
        abandoned.__enter__()

    interrupted()
    with control_callback(None):
        assert mujoco.get_mjcb_control() is None
    assert no_hooks()


def test_a_block_in_another_is_refused_and_changes_nothing():
    def outer(_model, _data):
        """Stands for a control callback."""

    def inner():
        with control_callback(None):
            pytest.fail("the outer block's callback is lost")

    with control_callback(outer):
        with pytest.raises(RuntimeError, match="must not contain another"):
            inner()
        assert mujoco.get_mjcb_control() is outer
    assert no_hooks()
