"""Cables that hold for a time: a load from one vehicle to another."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.laws.assembling import assemble
from tiltsim.models.cables import switch
from tiltsim.plants.mujoco_plant import flight_model
from tiltsim.vehicles.rotorcraft.others import motion_at_start

HANDOVER = "interaction/handover"
TAKER = {"name": "taker", "changes": {"initial": {"position": [0.3, 0.0, 0.1]}}}
FIRST = {"name": "one", "object": "parcel", "length": 0.6, "end": 0.08}
SECOND = {"name": "two", "object": "parcel", "vehicle": "taker", "length": 1.07, "start": 0.05}


def handed(*cables, **changes):
    """A load below a vehicle, which a taker beside it takes after 0.05 s."""
    parcel = tiltsim.load_scenario(HANDOVER).object[0].model_dump(exclude_unset=True)
    tables = {
        "simulation.duration": 0.3,
        "simulation.engine": "python",
        "simulation.record_timestep": 0.001,
        "object": [parcel | {"position": [-0.5, 0.0, -0.6]}],
        "companion": [TAKER],
        "cable": [*cables],
        "controller": {"law": "full_pose"},
        "expect": [],
    }
    return tiltsim.load_scenario(HANDOVER, tables | changes)


def test_one_cable_takes_the_load_before_the_other_releases_it():
    flight = tiltsim.simulate(handed(FIRST, SECOND))
    time, one, two = (flight[name] for name in ("time", "one_tension", "two_tension"))
    assert (one[2:80] > 0.5).all()
    assert not one[82:].any(), "released"
    assert not two[:50].any(), "not yet taken"
    assert two[-1] > 0.1
    hook = flight["taker_position"][-1]
    assert np.linalg.norm(flight["parcel_position"][-1] - hook) == pytest.approx(1.07, abs=2e-3)
    assert time[-1] == pytest.approx(0.3)


@pytest.mark.slow
def test_the_tension_is_the_force_on_the_load_by_newtons_law():
    simulation = tiltsim.Simulation(handed(FIRST, SECOND))
    mass, speeds, pulls = 0.1, [simulation.data.qvel[-6:-3].copy()], []
    for _ in range(300):
        place = simulation.data.qpos.copy()
        ends = {"one": place[:3], "two": place[13:16]}
        simulation.step()
        speeds.append(simulation.data.qvel[-6:-3].copy())
        now = simulation.flight()
        parcel = place[-7:-4]
        pull = np.zeros(3)
        for name, hook in ends.items():
            along = (hook - parcel) / np.linalg.norm(hook - parcel)
            pull += now[f"{name}_tension"][-1] * along
        pulls.append(pull)
    rates = mass * (np.diff(speeds, axis=0) / 0.001 + [0.0, 0.0, 9.81])
    np.testing.assert_allclose(pulls, rates, atol=2e-3)


def test_native_stepped_and_restored_flights_have_the_same_bits():
    scenario = handed(FIRST, SECOND)
    flight = tiltsim.simulate(scenario)
    native = tiltsim.simulate(scenario.replace({"simulation.engine": "native"}))
    for name in flight:
        np.testing.assert_array_equal(flight[name], native[name], err_msg=name)
    stepped = tiltsim.Simulation(scenario)
    for steps in (30, 37, 33, 200):
        stepped.step(steps)
        stepped._plant.state = stepped._plant.state
    np.testing.assert_array_equal(stepped.data.qpos[-7:-4], flight["parcel_position"][-1])


def test_rows_of_a_batch_switch_their_cables_as_alone():
    scenarios = [
        handed(FIRST | {"end": end}, SECOND, **{"simulation.engine": "native"})
        for end in (0.08, 0.2)
    ]
    together = tiltsim.fly(scenarios, keep_samples=True)
    for scenario, result in zip(scenarios, together, strict=True):
        alone = tiltsim.simulate(scenario)
        np.testing.assert_array_equal(alone["one_tension"], result.flight["one_tension"])


@pytest.mark.parametrize(
    ("cables", "line"),
    [
        ([FIRST, FIRST], 'cable.name = "one": is taken'),
        ([FIRST | {"name": "taker"}], 'cable.name = "taker": is taken'),
        ([FIRST | {"object": "parcle"}], "did you mean parcel?"),
        ([SECOND | {"vehicle": "giver"}], 'cable.vehicle = "giver": choose taker'),
        ([FIRST | {"start": 0.1}], "cable.end = 0.08: must be after start = 0.1"),
        ([FIRST | {"length": -1.0}], "cable[0].length = -1.0"),
    ],
)
def test_a_bad_cable_is_refused_in_one_line(cables, line):
    assert line in refusal(handed, *cables)


def test_a_cable_that_is_too_short_at_the_start_is_refused():
    short = handed(FIRST | {"length": 0.5})
    assert "cable one: its ends are 0.6 m apart at the start" in refusal(tiltsim.simulate, short)


def test_vehicles_and_load_keep_their_momentum_while_the_load_changes_hands():
    """Without gravity and thrust."""
    assembly = assemble(handed(FIRST, SECOND))
    model = flight_model(assembly)
    model.opt.gravity[:] = 0.0
    data, sizes = mujoco.MjData(model), assembly.loop.sizes
    data.qpos[: sizes.qpos], _ = assembly.loop.kind.initial_motion(assembly)
    data.qpos[sizes.qpos :], _ = motion_at_start(assembly)
    data.qvel[-6:-3] = -2.0, 0.5, -1.0
    momenta, taut = [], []
    for step in range(600):
        switch(model, assembly.scenario.cable, 0.001 * step)
        mujoco.mj_step(model, data)
        taut.append(data.history[data.history.size - 8 :][3::4] > 0.0)
        mujoco.mj_subtreeVel(model, data)
        momenta.append(data.subtree_linvel[0] * model.body_subtreemass[0])
    assert np.any(taut, axis=0).all(), "both cables pull"
    assert np.ptp(momenta, axis=0).max() < 1e-6 * np.abs(momenta).max()
