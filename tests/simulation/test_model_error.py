"""The vehicle that flies may differ from the one that the law knows."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tiltsim.laws.assembling import assemble
from tiltsim.plants.mujoco_plant import build_model
from tiltsim_controllers.vehicle.parameters import PRESETS

HOVER = {
    "simulation": {"duration": 0.004, "timestep": 0.001, "engine": "python"},
    "controller": {"decoupler": "none"},
    "reference": {"type": "attitude_altitude"},
}
ERROR = {
    "mass": 1.07,
    "inertia": [1.1, 0.9, 0.95],
    "arm_length": 1.02,
    "thrust_coefficient": 0.93,
    "drag_coefficient": 1.05,
}
NOMINAL = PRESETS["ar_drone_2"]


def parse(error, **tables):
    return tiltsim.parse_scenario({**HOVER, "model_error": error, **tables})


def test_the_plant_has_the_error_and_the_law_has_not():
    scenario = parse(ERROR)
    model = build_model(assemble(scenario))
    assert model.body("vehicle").subtreemass[0] == pytest.approx(1.07 * NOMINAL.mass, rel=1e-9)
    inertia = model.body("vehicle").inertia
    expected = np.array([1.1, 0.9, 0.95]) * NOMINAL[1:4]
    assert inertia == pytest.approx(expected, rel=1e-4)  # the pods are small, and not nothing
    gear = model.actuator("thrust_1").gear
    assert gear[2] == pytest.approx(0.93 * NOMINAL.thrust_coefficient)
    assert gear[5] == pytest.approx(1.05 * NOMINAL.drag_coefficient)
    assert model.site("rotor_1").pos[0] + model.body("pod_1").pos[0] == pytest.approx(
        1.02 * NOMINAL.arm_length
    )
    assert assemble(scenario).setup.parameters.law.vehicle == NOMINAL


def test_the_flight_begins_with_the_true_acceleration():
    flight = tiltsim.simulate(parse(ERROR))
    speed = 300.0
    thrust = 4.0 * 0.93 * NOMINAL.thrust_coefficient * speed**2
    expected = thrust / (1.07 * NOMINAL.mass) - NOMINAL.gravity
    assert flight["vz"][-1] / flight["time"][-1] == pytest.approx(expected, rel=0.02)
    assert flight["thrust_2"][0] == pytest.approx(thrust / 4.0, rel=1e-12)


def test_no_error_is_no_difference():
    plain = tiltsim.simulate(tiltsim.parse_scenario(HOVER))
    ones = tiltsim.simulate(parse(dict.fromkeys(["mass", "thrust_coefficient"], 1.0)))
    np.testing.assert_array_equal(plain.samples, ones.samples)


@pytest.mark.parametrize(
    ("error", "tables", "words"),
    [
        ({"mass": 0.0}, {}, "model_error.mass = 0.0"),
        ({"gravity": 1.0}, {}, "model_error.gravity = 1.0: unknown key"),
        (
            {"inertia": [1.0, 1.0, 3.0]},
            {},
            "model_error.inertia = [1.0, 1.0, 3.0]: not physically realizable",
        ),
        (
            {"mass": 1.1},
            {
                "vehicle": {"model": "tilt_car"},
                "controller": {"law": "tilt_car_third_derivative"},
                "reference": {"type": "setpoint"},
            },
            'vehicle.model = "tilt_car"',
        ),
    ],
)
def test_impossible_errors_are_refused(error, tables, words):
    with pytest.raises(tiltsim.InputError) as caught:
        parse(error, **tables)
    assert words in str(caught.value)
