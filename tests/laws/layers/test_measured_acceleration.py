"""Feeding back the angular acceleration of the plant instead of that of the law's model."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.laws.layers.test_on_equations import (
    LATE,
    SENSORS,
    SLOW,
    STORM,
    TILTROTOR,
    TROT,
    WATCHED,
    WEAK,
    WRONG,
    scenario,
)
from tests.simulation.test_batch import three_ways
from tiltsim.engines.callback import control_callback
from tiltsim.errors import InputError
from tiltsim.laws.assembling import LOOPS, assemble, loop_of
from tiltsim.laws.layers.measured_acceleration import plant_angular_acceleration
from tiltsim.laws.layers.on_equations import read_actuators
from tiltsim.plants.factory import make_plant
from tiltsim.resources import shipped_folder

MEASURED = {"controller": {"angular_acceleration": "measured"}}
THESIS = {"simulation": {"plant": "thesis"}}
HEAVY = {"vehicle": {"pod": {"mass": 0.02, "inertia": 2e-5}}}
SPINNING = {"initial": {"angular_velocity": [1.5, -0.8, 2.0]}}
LIMITED = {"vehicle": {"min_rotor_speed": 300.0, "max_rotor_speed": 380.0}}
FEEDFORWARD = {"controller": {"gait_rate_feedforward": True, "gains": "feedforward"}}
FILE = str(shipped_folder("mjcf") / "tiltrotor.xml")
EVERYTHING = (TILTROTOR, TROT, SPINNING, STORM, LATE, SENSORS, SLOW, WEAK, WRONG, LIMITED)


HEAVY_ROTORS = {"vehicle": {"rotor_inertia": 1e-5}}


@pytest.mark.parametrize(
    "changes", [(TILTROTOR, TROT, SPINNING), EVERYTHING, (*EVERYTHING, HEAVY_ROTORS)]
)
def test_it_is_the_acceleration_that_mujoco_integrates(changes):
    plant = make_plant(assemble(scenario(*changes, HEAVY, MEASURED)))
    loop, parameters = plant._loop, plant._setup.parameters
    _, wrench = read_actuators(loop.dynamics)
    data, largest = plant.data, 0.0
    for _ in range(20):
        plant.advance(3)
        with control_callback(plant.callback):
            mujoco.mj_forward(plant.model, data)
        state, ctrl = (data.qpos.tolist(), data.qvel.tolist()), data.ctrl.tolist()
        measured = plant_angular_acceleration(*state, ctrl, wrench(ctrl), parameters.layer)
        np.testing.assert_allclose(measured, data.qacc[3:6], rtol=1e-9, atol=1e-9)
        largest = max(largest, *np.abs(measured))
    assert largest > 5.0


def test_it_is_the_acceleration_that_the_equations_integrate():
    desired = scenario(*EVERYTHING, MEASURED, THESIS)
    assembly = assemble(desired)
    plant, loop = make_plant(assembly), assembly.loop
    plant.advance(60)
    first = 1 + len(plant._held)
    state, setup = plant.state[first:].tolist(), assembly.setup
    equations = loop.equations
    inputs = equations.inputs(plant.time, state, setup.parameters, setup.knots)
    rates = equations.rates(plant.time, state, inputs, setup.parameters, setup.knots, (0.0,) * 3)
    seen = []

    def watch(qpos, qvel, ctrl, wrench, motion):
        seen.append(plant_angular_acceleration(qpos, qvel, ctrl, wrench, motion))
        return seen[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tiltsim.laws.layers.measured_acceleration.plant_angular_acceleration", watch)
        equations.inputs(plant.time, state, setup.parameters, setup.knots)
    np.testing.assert_allclose(seen[-1], rates[15:18], rtol=1e-12)


def test_on_the_ideal_thesis_plant_it_is_the_model_s():
    assert loop_of(scenario(TILTROTOR, MEASURED, THESIS)) is LOOPS["attitude_altitude"]


@pytest.mark.parametrize("changes", [(), (FEEDFORWARD,)], ids=["published", "feedforward"])
def test_a_right_model_without_gyroscopic_torque_is_as_good_as_a_measurement(changes):
    """A layer that does nothing makes the thesis plant measure, too."""
    never = {"fault": [{"type": "rotor_loss", "rotor": 1, "time": 1e6}]}
    desired = (TILTROTOR, TROT, SPINNING, THESIS, *changes, never)
    known, measured = (tiltsim.simulate(scenario(*desired, setting)) for setting in ({}, MEASURED))
    assert loop_of(measured.scenario) is not loop_of(known.scenario)
    np.testing.assert_allclose(known.samples, measured.samples, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["mujoco", "thesis"])
def test_it_flies_the_same_three_ways(plant):
    engine = {"simulation": {"plant": plant, "engine": "native", "duration": 0.2}}
    rows = three_ways(
        [
            scenario(TILTROTOR, TROT, SPINNING, MEASURED, engine),
            scenario(*EVERYTHING, MEASURED, engine),
            scenario(TILTROTOR, TROT, STORM, FEEDFORWARD, MEASURED, engine),
            scenario(TILTROTOR, TROT, WATCHED, MEASURED, engine),
        ]
    )
    assert {row.end.kind for row in rows} == {"completed"}


@pytest.mark.parametrize(
    "changes", [{"ground": {}}, {"vehicle": {"mjcf": FILE}}, {"vehicle": {"rotor_inertia": 1e-5}}]
)
def test_what_it_does_not_include_is_refused(changes):
    (table,) = changes
    with pytest.raises(InputError, match=f'{table}.*not supported with .* = "measured"'):
        scenario(TILTROTOR, MEASURED, changes)
