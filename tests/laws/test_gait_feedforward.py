"""Gait-rate feed-forward through scenarios: keys, limits, mistakes, benefit."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.scenario.controller_table import FeedforwardTerm
from tiltsim_controllers.laws.multirotor_keys import FeedforwardTerms

SCENARIO = "beyond/gait_feedforward#t2"


def test_the_law_includes_exactly_the_terms_that_can_be_left_out():
    assert set(FeedforwardTerm.__args__) == set(FeedforwardTerms._fields)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"controller.decoupler": "modified"}, "gait_rate_feedforward = true needs exact or none"),
        ({"controller.decoupling": "published"}, "gait_rate_feedforward = true needs exact"),
        ({"controller.leave_out": ["everything"]}, "controller.leave_out"),
        ({"reference.acceleration_feedforward": True}, "always includes all derivatives"),
        ({"controller.gains.attitude.bandwidth": 0.0}, "bandwidth = 0.0"),
        ({"controller.gains.attitude.bandwidth": 5000.0}, "too long for the roll loop"),
        ({"controller.gait_rate_feedforward": False}, "needs controller.gait_rate_feedforward"),
    ],
)
def test_mistakes_are_one_line(changes, message):
    assert message in refusal(tiltsim.load_scenario, SCENARIO, changes)


def test_poles_are_also_gains_of_the_plain_law():
    poles = {"attitude": {"bandwidth": 12.0}, "altitude": {"bandwidth": 6.0}}
    scenario = tiltsim.load_scenario(
        SCENARIO, {"controller": {"decoupling": "exact", "decoupler": "exact", "gains": poles}}
    )
    loops = {
        loop.name: loop for loop in scenario.controller.error_loops(scenario.vehicle.resolve())
    }
    np.testing.assert_allclose(np.roots(loops["roll"].polynomial), -12.0, rtol=1e-4)
    np.testing.assert_allclose(np.roots(loops["altitude"].polynomial), -6.0, rtol=1e-4)
    assert (
        tiltsim.parse_scenario(scenario.model_dump(mode="json")).controller == scenario.controller
    )


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_on_a_smooth_gait_the_error_dies_out(plant):
    changes = {
        "simulation.plant": plant,
        "simulation.engine": "native",
        "simulation.duration": 24.0,
        "initial.position": [2.0, 0.0, 0.0],
        "initial.velocity": [0.0, 0.6, 0.0],
        "reference.radius": 2.0,
        "reference.angular_frequency": 0.3,
        "gait": {
            **{"type": "two_color", "color": "red", "period": 2.0},
            **{"centre": [-0.2, 0.3], "radius": 0.2},
        },
    }
    metrics = tiltsim.simulate(tiltsim.load_scenario(SCENARIO, changes)).metrics()
    assert metrics["sup_position_error_after_20s"] < 2e-4
    assert metrics["min_rotor_speed"] > 200.0


@pytest.mark.slow
def test_the_rotors_never_come_near_a_stop_from_a_rough_start():
    changes = {
        "simulation.duration": 1.5,
        "simulation.engine": "native",
        "initial.attitude": [0.2, -0.2, 0.3],
        "initial.position": [2.0, 3.0, 0.0],
        "gait.amplitude": 0.4,
    }
    flight = tiltsim.simulate(tiltsim.load_scenario(SCENARIO, changes))
    assert flight.end.kind == "completed"
    assert flight.metrics()["min_rotor_speed"] > 100.0
