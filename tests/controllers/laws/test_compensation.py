"""Observers and a prioritized mixer around the baselines."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import tiltsim
from tests.controllers.laws.test_rotor_allocation import observing, per_newton
from tests.controllers.multirotors import ring
from tiltsim.errors import InputError
from tiltsim_controllers.laws.compensation import mixed
from tiltsim_controllers.vehicle.rotors import force_and_torque

WEIGHT = 24.0
LOW, HIGH = np.full(6, 0.2), np.full(6, 8.0)


@pytest.fixture
def observed():
    force, torque = force_and_torque(per_newton(ring(6, hinged=False)), ())
    body = SimpleNamespace(mass=WEIGHT / 9.81, gravity=9.81)
    return observing(force=force, torque=torque, vehicle=body)


def test_thrusts_within_limits_stay_as_they_are(observed):
    thrusts = np.array([4.0, 3.0, 5.0, 4.5, 3.5, 7.9])
    np.testing.assert_array_equal(mixed(observed, thrusts, LOW, HIGH), thrusts)


def test_roll_and_pitch_are_kept_and_yaw_is_given_up(observed):
    pattern = np.linalg.pinv(observed.torque)
    thrusts = WEIGHT / 6.0 + pattern @ [0.3, -0.2, 2.0]
    assert thrusts.min() < LOW[0] or thrusts.max() > HIGH[0]
    found = mixed(observed, thrusts, LOW, HIGH)
    assert (found >= LOW).all()
    assert (found <= HIGH).all()
    np.testing.assert_allclose((observed.torque @ found)[:2], [0.3, -0.2], atol=1e-4)
    assert 0.0 < (observed.torque @ found)[2] < 1.9
    cut = observed.torque @ np.clip(thrusts, LOW, HIGH)
    assert np.abs(cut[:2] - [0.3, -0.2]).max() > 1e-3


def test_roll_and_pitch_come_before_lift(observed):
    thrusts = 7.5 + np.linalg.pinv(observed.torque) @ [0.6, 0.0, 0.0]
    assert thrusts.max() > HIGH[0]
    found = mixed(observed, thrusts, LOW, HIGH)
    assert (found <= HIGH).all()
    np.testing.assert_allclose((observed.torque @ found)[:2], [0.6, 0.0], atol=1e-4)
    assert found.sum() < thrusts.sum()


WRONG = {
    "vehicle": {"model": "multirotor", "mjcf": "mjcf/hexarotor.xml", "max_rotor_speed": 838.0},
    "simulation": {
        "duration": 3.0,
        "timestep": 0.002,
        "control_timestep": 0.004,
        "plant": "rigid_body",
        "engine": "native",
    },
    "model_error": {"mass": 1.1, "thrust_coefficient": 0.9},
    "reference": {"type": "setpoint"},
}


def flown(law, duration=3.0, engine="native", **keys):
    simulation = {**WRONG["simulation"], "duration": duration, "engine": engine}
    controller = {"law": law, "mixer": "prioritized", **keys}
    return tiltsim.simulate({**WRONG, "simulation": simulation, "controller": controller})


@pytest.mark.parametrize("law", ["geometric", "pid", "indi", "lqr"])
def test_an_observer_removes_the_error_of_a_wrong_mass(law):
    error = -flown(law, observer=8.0)["position"][-1, 2]
    assert abs(error) < 0.05
    if law != "pid":
        assert -flown(law)["position"][-1, 2] > 4.0 * abs(error) + 0.1


@pytest.mark.slow
@pytest.mark.parametrize("law", ["geometric", "pid", "indi", "lqr"])
def test_native_flights_are_those_in_python(law):
    python, native = (flown(law, 0.2, engine, observer=8.0) for engine in ("python", "native"))
    np.testing.assert_array_equal(python.samples, native.samples)


def test_a_mixer_without_limits_is_refused():
    vehicle = {key: value for key, value in WRONG["vehicle"].items() if "speed" not in key}
    with pytest.raises(InputError, match=r'mixer = "prioritized": needs vehicle.min_rotor'):
        tiltsim.load_scenario(
            {**WRONG, "vehicle": vehicle, "controller": {"law": "pid", "mixer": "prioritized"}}
        )
