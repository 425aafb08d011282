"""Flights side by side in lanes: each has the bits of the flight that is flown alone."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import tiltsim
from tests.simulation.test_batch import EXACT, LATE_LOSS, STOPPING_ROTOR, UPSIDE_DOWN, scenario
from tests.simulation.test_batch import without_speed as comparable
from tiltsim.engines.machine_code import widest
from tiltsim.errors import InputError
from tiltsim.plants.plant import EquationsPlant
from tiltsim.scenario.library import library_entries
from tiltsim.simulation import native_batch
from tiltsim.simulation.batch import fly

THESIS = {"plant": "thesis", "timestep": 0.002}


def shifted(index, tables=None, **simulation):
    """One of many: its place differs, and its mass."""
    tables = {"controller": EXACT, **(tables or {})}
    place = {**tables.get("initial", {}), "position": [0.01 * index, 0.0, 0.0]}
    mass = {"model_error": {"mass": 1.001 + 0.001 * index}}
    return scenario({**tables, **mass, "initial": place}, **{**THESIS, **simulation})


def assert_flown_as_alone(results, scenarios):
    assert [result.scenario for result in results] == scenarios
    for flown, result in zip(scenarios, results, strict=True):
        alone = tiltsim.simulate(flown)
        assert result.flight.samples.tobytes() == alone.samples.tobytes()
        assert result.end == alone.end
        assert comparable(result.metrics) == comparable(alone.metrics())


@pytest.mark.parametrize("threads", [1, 2])
def test_more_flights_than_lanes_of_different_lengths_and_steps(threads):
    scenarios = [
        shifted(
            i,
            timestep=(0.002, 0.001)[i % 2],
            duration=0.02 + 0.004 * (i % 7),
            record_timestep=(0.01, 0.004, 0.006)[i % 3],
        )
        for i in range(5 * widest())
    ]
    results = list(fly(scenarios, threads=threads, keep_samples=True))
    assert_flown_as_alone(results, scenarios)


def test_held_controllers_are_sampled_at_independent_times():
    """Lanes at different phases take both programs at once."""
    scenarios = [
        shifted(i, duration=0.05 + 0.008 * i, control_timestep=(0.004, 0.006, 0.014)[i % 3])
        for i in range(2 * widest() + 3)
    ]
    assert_flown_as_alone(list(fly(scenarios, threads=1, keep_samples=True)), scenarios)


def test_ends_in_some_lanes_leave_the_others_alone():
    tables = [{}, UPSIDE_DOWN, STOPPING_ROTOR, LATE_LOSS]
    scenarios = [
        shifted(i, tables[i % 4], duration=2.2, record_timestep=0.05) for i in range(2 * widest())
    ]
    results = list(fly(scenarios, threads=2, keep_samples=True))
    kinds = [result.end.kind for result in results]
    assert {*kinds} == {"completed", "singular"}
    assert_flown_as_alone(results, scenarios)


def test_a_lane_is_free_once_its_flight_ends():
    """An hour each, if they did not diverge in the first second."""
    many = [shifted(i, UPSIDE_DOWN, duration=3600.0, record_timestep=1.0) for i in range(40)]
    results = list(fly(many, threads=1))
    assert len(results) == 40
    assert max(result.end.time for result in results) < 1.0


def test_an_early_end_is_located_from_the_last_sample_on(monkeypatch):
    taken = []
    advance = EquationsPlant.advance

    def counted(plant, steps):
        taken.append(steps)
        advance(plant, steps)

    monkeypatch.setattr(EquationsPlant, "advance", counted)
    flights = [shifted(i, LATE_LOSS, duration=10.0, record_timestep=0.05) for i in range(2)]
    results = list(fly(flights, threads=1))
    assert all(2.0 < result.end.time < 2.2 for result in results)
    assert 0 < sum(taken) <= 2 * 2 * 25  # an interval, and again step by step


def test_a_flight_that_must_not_begin_ends_at_time_zero():
    fast = {"initial": {"angular_velocity": [0.0, 0.0, 5000.0]}}
    scenarios = [shifted(i, (fast, {})[i % 2], duration=0.05) for i in range(4)]
    results = list(fly(scenarios, threads=1, keep_samples=True))
    assert [result.end.time for result in results] == [0.0, 0.05, 0.0, 0.05]
    assert_flown_as_alone(results, scenarios)


def test_samples_of_a_part_fit_into_memory(monkeypatch):
    scenarios = [shifted(i, duration=0.05) for i in range(11)]
    expected = [result.metrics["duration"] for result in fly(scenarios)]
    parts = []
    fly_part = native_batch.LaneBatch._fly_part

    def noted(batch, part):
        parts.append(len(part))
        return fly_part(batch, part)

    monkeypatch.setattr(native_batch.LaneBatch, "_fly_part", noted)
    size = 8 * 6 * len(tiltsim.simulate(scenarios[0]).assembly.loop.sample_fields)
    monkeypatch.setattr(native_batch, "MEMORY", 4 * size)
    assert [result.metrics["duration"] for result in fly(scenarios)] == expected
    assert parts == [4, 4, 3]


def test_an_interrupted_batch_stops_after_the_present_calls(monkeypatch):
    monkeypatch.setattr(native_batch, "CALL_TIME", 0.01)
    monkeypatch.setattr(native_batch.LaneBatch, "_next_part", stopping(native_batch.LaneBatch))
    many = [shifted(i, duration=100_000.0, record_timestep=1000.0) for i in range(8)]
    with pytest.raises(KeyboardInterrupt):
        list(fly(many, threads=1))


def stopping(kind):
    """A part whose caller is interrupted once it has begun."""
    make = kind._next_part

    def next_part(batch, waiting):
        part = make(batch, waiting)
        submit = batch._pool.submit

        class Pool:
            def submit(self, *work):
                submit(*work)
                raise KeyboardInterrupt

        batch._pool = Pool()
        return part

    return next_part


def test_one_lane_per_flight_up_to_the_width_of_a_register():
    assert [native_batch.lanes_for(n) for n in (1, 2, 3)] == [1, 2, min(4, widest())]
    assert native_batch.lanes_for(100) == widest()


def test_quick_functions_change_the_last_digits_of_batches_alone():
    exact = [shifted(i, duration=0.2) for i in range(widest())]
    quick = [one.replace({"simulation.batch_functions": "quick"}) for one in exact]
    rows = [result.flight.samples for result in fly(quick, keep_samples=True)]
    for flown, samples in zip(exact, rows, strict=True):
        alone = tiltsim.simulate(flown).samples
        np.testing.assert_allclose(samples, alone, rtol=1e-9, atol=1e-11)
    assert any((a != tiltsim.simulate(b).samples).any() for a, b in zip(rows, exact))
    alone = tiltsim.simulate(quick[0]).samples
    assert alone.tobytes() == tiltsim.simulate(exact[0]).samples.tobytes()


def test_quick_functions_are_for_equations():
    message = 'simulation.batch_functions = "quick": needs simulation.plant = "thesis" or'
    with pytest.raises(InputError, match=message):
        scenario({}, batch_functions="quick")


@pytest.mark.slow(longest=True)
def test_library_flights_have_the_same_bits_for_their_first_moments():
    """Two of each file that fly on the equations of a rigid body, or else on the thesis's."""
    scenarios, flown_of = [], Counter()
    for address, *_ in library_entries():
        file = address.partition("#")[0]
        if flown_of[file] == 2:
            continue
        flown = tiltsim.load_scenario(address)
        if flown.controller.is_external:
            continue
        for plant in ("rigid_body", "thesis"):
            tables = {"simulation.plant": plant, "simulation.engine": "native", "expect": []}
            try:
                changed = tiltsim.load_scenario(address, {**tables, "simulation.duration": 0.24})
                tiltsim.laws.assembling.assemble(changed)
            except InputError:
                continue
            flown_of[file] += 1
            scenarios += [changed.replace({"simulation.duration": t}) for t in (0.24, 0.12)]
            break
    assert len(scenarios) > 150
    for first in range(0, len(scenarios), 90):
        part = scenarios[first : first + 90]
        for flown, result in zip(part, fly(part, keep_samples=True), strict=True):
            alone, samples = tiltsim.simulate(flown), result.flight.samples
            # A zero at time zero may have another sign: a flight alone computes it untraced.
            np.testing.assert_array_equal(samples[0], alone.samples[0], err_msg=flown.address)
            assert samples[1:].tobytes() == alone.samples[1:].tobytes(), flown.address
            assert alone.end == result.end
