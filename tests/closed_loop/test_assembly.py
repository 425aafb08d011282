"""Gait, closed loop and setup are prepared once per flight."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import tiltsim
from tiltsim.flight.reading import load_flight
from tiltsim.laws import assembling
from tiltsim.scenario.gait import GaitTable
from tiltsim.simulation.batch import fly

TABLES = {
    "rotorcraft": {"gait": {"type": "trot_continuous", "amplitude": 0.3, "period": 1.0}},
    "layers": {
        "gait": {"type": "walk", "amplitude": 0.3, "period": 1.0},
        "vehicle": {"rotor_time_constant": 0.004},
        "controller": {"decoupling": "exact", "gains": "exact"},
        "air": {"wind": [1.0, 0.0, 0.0], "drag": {"linear": [0.1, 0.1, 0.1]}},
        "fault": [{"type": "stuck_servo", "rotor": 1, "time": 0.1}],
    },
    "full pose": {"controller": {"law": "full_pose"}},
    "tilt-car": {
        "vehicle": {"model": "tilt_car"},
        "controller": {"law": "tilt_car_fourth_derivative"},
    },
}
ONCE = {"plan": 1, "loop_of": 1, "setup": 1}


def scenario(tables, **simulation):
    simulation = {"duration": 0.05, "engine": "python", **simulation}
    return tiltsim.parse_scenario({**tables, "simulation": simulation})


@pytest.fixture
def calls(monkeypatch):
    """How often a gait is planned, a loop chosen and a loop set up."""
    counts = dict.fromkeys(ONCE, 0)

    def counted(name, function):
        def count(*arguments, **options):
            counts[name] += 1
            return function(*arguments, **options)

        return count

    def loop_of(*arguments, **options):
        loop = choose(*arguments, **options)
        return replace(loop, setup=counted("setup", loop.setup))

    choose = counted("loop_of", assembling.loop_of)
    monkeypatch.setattr(assembling, "loop_of", loop_of)
    monkeypatch.setattr(GaitTable, "plan", counted("plan", GaitTable.plan))
    return counts


@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
@pytest.mark.parametrize("name", TABLES)
def test_a_flight_with_its_metrics_and_files_is_assembled_once(name, plant, calls, tmp_path):
    flown = scenario(TABLES[name], plant=plant)
    calls.update(dict.fromkeys(calls, 0))  # checks of the scenario plan its gait
    flight = tiltsim.simulate(flown)
    flight.metrics()
    flight.save(tmp_path)
    assert calls == ONCE


def test_a_flight_under_a_users_own_controller_is_assembled_once(calls):
    flown = scenario(TABLES["rotorcraft"])

    def law(observation):
        return tiltsim.Command(thrusts=[1.0, 1.0, 1.0, 1.0])

    calls.update(dict.fromkeys(calls, 0))
    tiltsim.simulate(flown, controller=law).metrics()
    assert calls == {**ONCE, "plan": 2}, "once more to check the scenario under commands"


def test_a_row_of_a_batch_is_assembled_once(calls):
    flown = [scenario(TABLES["rotorcraft"]) for _ in range(3)]
    calls.update(dict.fromkeys(calls, 0))
    assert len(list(fly(flown))) == 3
    assert calls == dict.fromkeys(ONCE, 3)


def test_a_flight_from_a_file_is_assembled_once(calls, tmp_path):
    flight = tiltsim.simulate(scenario(TABLES["rotorcraft"]))
    flight.save(tmp_path)
    calls.update(dict.fromkeys(calls, 0))
    loaded = load_flight(tmp_path)
    assert loaded.metrics() == flight.metrics()
    assert calls == {**ONCE, "plan": 2}, "once more to check the scenario"


def test_a_flight_pickles_without_its_assembly():
    flight = tiltsim.simulate(scenario(TABLES["layers"]))
    again = pickle.loads(pickle.dumps(flight))
    assert again.scenario == flight.scenario
    assert again.end == flight.end
    np.testing.assert_array_equal(again.samples, flight.samples)
    assert again.metrics() == flight.metrics()
