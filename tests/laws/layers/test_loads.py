"""Forces and torques at a time and a point, in flight."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.laws.layers.test_on_equations import MOTION, QUADROTOR, TILTROTOR, TROT
from tests.laws.restarting import assert_restarts
from tests.laws.test_multirotor import document
from tests.refusals import refusal
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import merge
from tiltsim.simulation.simulate import make_plant

PUSH = {"type": "force", "value": [0.6, -0.3, 0.2], "point": [0.1, 0.05, 0.02]}
TWIST = {"type": "torque", "value": [0.004, -0.003, 0.002], "frame": "body", "start": 0.1}
LOADS = [{**PUSH, "start": 0.06, "end": 0.2}, TWIST, {**PUSH, "frame": "body", "start": 0.2}]
VEHICLES = {
    "tiltrotor": merge(TILTROTOR, TROT),
    "quadrotor": QUADROTOR,
    "hexarotor": document("hexarotor", vehicle={"rotor_time_constant": 0.02}),
}


def scenario(name, loads=LOADS, **simulation):
    simulation = {"duration": 0.28, "timestep": 0.002, "engine": "python", **simulation}
    tables = {"simulation": simulation, "disturbance": loads}
    return tiltsim.parse_scenario(merge(VEHICLES[name], tables))


def fly(*arguments, **simulation):
    return tiltsim.simulate(scenario(*arguments, **simulation))


@pytest.mark.parametrize("name", VEHICLES)
def test_plants_agree_about_loads(name):
    mujoco, rigid = (fly(name, plant=plant) for plant in ("mujoco", "rigid_body"))
    undisturbed = fly(name, [], plant="rigid_body")
    for column in MOTION:
        assert np.abs(mujoco[column] - rigid[column]).max() < 1e-9
        assert np.abs(undisturbed[column] - rigid[column]).max() > 1e-6


@pytest.mark.parametrize(("plant", "engine"), [("mujoco", "native"), ("rigid_body", "native")])
def test_engines_agree_about_loads(plant, engine):
    python, other = (fly("hexarotor", plant=plant, engine=e) for e in ("python", engine))
    np.testing.assert_array_equal(python.samples, other.samples)


def test_a_loaded_state_restarts():
    assert_restarts(scenario("tiltrotor"), 51, 40)


def start_of_motion(loads, attitude):
    """Changes of velocity and body rates by loads in the first step, over its length."""
    plants = [make_plant(assemble(scenario("hexarotor", each))) for each in (loads, [])]
    for plant in plants:
        plant.data.qpos[3:7] = attitude
        plant.advance(1)
    return (plants[0].data.qvel[:6] - plants[1].data.qvel[:6]) / 0.002, plants[0].model


def test_a_force_at_a_point_accelerates_and_turns():
    """``m a = F`` and ``I w' = p x R^T F`` of the compiled model, upside down about x."""
    found, model = start_of_motion([PUSH], [0.0, 1.0, 0.0, 0.0])
    force, point = np.array(PUSH["value"]), np.array(PUSH["point"])
    mass, moments = model.body_subtreemass[1], model.body_inertia[1]
    np.testing.assert_allclose(found[:3], force / mass, rtol=1e-3)
    torque = np.cross(point, [1.0, -1.0, -1.0] * force)
    np.testing.assert_allclose(found[3:], torque / moments, rtol=1e-4, atol=1e-6)


def test_loads_are_recorded_as_they_act():
    flight = fly("hexarotor", record_timestep=0.02)
    force = np.array([0.6, -0.3, 0.2])
    time, first = flight["time"], np.stack([flight[f"load_force_{a}"] for a in "xyz"], axis=1)
    assert not first[time < 0.059].any()
    early = (time > 0.059) & (time < 0.199)
    np.testing.assert_allclose(np.linalg.norm(first[early], axis=1), np.linalg.norm(force))
    np.testing.assert_allclose(first[time > 0.199], np.tile(force, (sum(time > 0.199), 1)))
    np.testing.assert_array_equal(flight["load_torque_x"][time < 0.059], 0.0)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ([{**PUSH, "start": 0.2, "end": 0.2}], "disturbance.end = 0.2: must be after start"),
        ([{**TWIST, "point": [0, 0, 1]}], "disturbance[0].point"),
        ([{**PUSH, "type": "shove"}], "choose acceleration, force, torque"),
    ],
)
def test_wrong_loads_are_refused(tables, message):
    assert message in refusal(tiltsim.parse_scenario, {"disturbance": tables})


def test_a_car_takes_no_loads():
    car = {"vehicle": {"model": "tilt_car"}, "controller": {"law": "tilt_car_third_derivative"}}
    assert "not supported for the tilt_car; choose acceleration" in refusal(
        tiltsim.parse_scenario, {**car, "disturbance": [PUSH]}
    )
