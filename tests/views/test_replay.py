"""Replaying flights: any compiled model, poses as MuJoCo itself has them."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.flights import flight
from tiltsim.views.replay import (
    cables,
    joint_positions,
    poses_in_parents,
    rotate,
    seen_radius,
    thrust_scale,
    thrust_sites,
    vehicle_radius,
    visible_model,
    world_poses,
)

FOREIGN = """
<mujoco>
  <worldbody>
    <body name="cart"><joint name="x" type="slide" axis="1 0 0"/><geom size="0.1"/>
      <body name="pole" pos="0 0 0.2" quat="0.8 0.6 0 0"><joint name="swing"/><geom size="0.1"/>
        <body name="tip" pos="0 0 0.5"><geom size="0.05"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_a_flight_puts_the_vehicle_where_it_was():
    this = flight("trot")
    model = visible_model(this.assembly)
    qpos = joint_positions(model, this.columns)
    poses = world_poses(model, qpos)
    vehicle = model.body("vehicle").id
    np.testing.assert_array_equal(
        poses.position[:, vehicle], np.stack([this[axis] for axis in "xyz"], axis=1)
    )
    for rotor in (1, 2, 3, 4):
        address = model.joint(f"tilt_{rotor}").qposadr[0]
        np.testing.assert_array_equal(qpos[:, address], this[f"alpha_{rotor}"])


def test_up_of_the_last_pose_agrees_with_the_attitude():
    this = flight("trot")
    model = visible_model(this.assembly)
    poses = world_poses(model, joint_positions(model, this.columns))
    up = rotate(poses.quaternion[-1, model.body("vehicle").id], np.array([0.0, 0.0, 1.0]))
    expected = np.cos(this["roll"][-1]) * np.cos(this["pitch"][-1])
    assert up[2] == pytest.approx(expected)


def test_any_model_moves_by_the_columns_named_like_its_joints():
    model = mujoco.MjModel.from_xml_string(FOREIGN)
    columns = {"time": np.arange(3.0), "x": np.array([0.0, 1.0, 2.0])}
    poses = world_poses(model, joint_positions(model, columns))
    np.testing.assert_allclose(poses.position[:, model.body("cart").id, 0], columns["x"])
    assert vehicle_radius(model) > 0.5
    assert thrust_scale(model) > 0.0
    assert thrust_sites(model) == {}


def test_poses_in_parents_lead_back_to_the_world():
    model = mujoco.MjModel.from_xml_string(FOREIGN)
    qpos = np.array([[0.3, 0.7], [-1.0, 2.0]])
    world = world_poses(model, qpos)
    local = poses_in_parents(model, world)
    cart, pole, tip = (model.body(name).id for name in ("cart", "pole", "tip"))
    np.testing.assert_allclose(local.position[:, tip], [[0.0, 0.0, 0.5]] * 2, atol=1e-12)
    back = world.position[:, pole] + rotate(world.quaternion[:, pole], local.position[:, tip])
    np.testing.assert_allclose(back, world.position[:, tip], atol=1e-12)
    np.testing.assert_allclose(local.quaternion[:, cart], world.quaternion[:, cart], atol=1e-12)


def test_arrows_are_about_as_long_as_the_arms_at_hover():
    this = flight("fixed")
    model = visible_model(this.assembly)
    assert set(thrust_sites(model).values()) == {f"thrust_{i}" for i in (1, 2, 3, 4)}
    assert vehicle_radius(model) == pytest.approx(0.1785)
    assert thrust_scale(model) == pytest.approx(0.2)


def test_a_cable_ends_at_its_vehicle_and_at_its_load():
    changes = {"simulation.duration": 0.2, "payload.swing": 0.3, "expect": []}
    carried = tiltsim.simulate(tiltsim.load_scenario("interaction/carry#cable", changes))
    model = visible_model(carried.assembly)
    world = world_poses(model, joint_positions(model, carried.columns))
    ends = cables(carried.scenario, model, world, carried["time"])["cable"]
    np.testing.assert_allclose(np.linalg.norm(np.diff(ends, axis=1), axis=-1), 1.0, atol=2e-3)
    load = np.stack([carried[f"payload_{axis}"] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(ends[:, 1], load, atol=1e-9)
    assert seen_radius(carried.scenario, model) == vehicle_radius(model) + 0.25


def test_companions_are_drawn_where_they_flew_and_cables_while_they_hold():
    changes = {"simulation.duration": 0.1, "simulation.engine": "python", "expect": []}
    changes |= {"cable[0].end": 0.05, "controller": {"law": "full_pose"}}
    flight = tiltsim.simulate(tiltsim.load_scenario("interaction/handover", changes))
    model = visible_model(flight.assembly)
    world = world_poses(model, joint_positions(model, flight.columns))
    for name, prefix in (("vehicle", ""), ("taker_vehicle", "taker_")):
        drawn = world.position[:, model.body(name).id]
        np.testing.assert_allclose(drawn, flight[f"{prefix}position"], atol=1e-12)
    hinge = model.joint("taker_tilt_5").qposadr[0]
    tilts = joint_positions(model, flight.columns)[:, hinge]
    np.testing.assert_array_equal(tilts, flight["taker_alpha_5"])
    assert thrust_sites(model)[model.site("taker_rotor_6").id] == "taker_thrust_6"
    assert vehicle_radius(model) < 0.5 < seen_radius(flight.scenario, model)
    ends = cables(flight.scenario, model, world, flight["time"])["first_cable"]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    np.testing.assert_allclose(length, np.where(flight["time"] < 0.0499, 1.3, 0.0), atol=5e-3)
