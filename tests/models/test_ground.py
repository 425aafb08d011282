"""Ground to stand on: vehicles at rest there, and its cost to flights without it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.laws.assembling import assemble
from tiltsim.models.parts import Ground
from tiltsim.models.rotorcraft import RotorcraftSpec, compile_model
from tiltsim.plants.mujoco_plant import flight_model
from tiltsim_controllers.vehicle.parameters import PRESETS

VEHICLE = PRESETS["ar_drone_2"]
WEIGHT = VEHICLE.mass * VEHICLE.gravity
ON_SKIDS = 0.0785  # m, from the skids to the center of mass
LANDING = "beyond/take_off_and_landing#landing"
DIRECTIONS = np.array([[1.0, 0.0], [0.6, 0.8], [0.5**0.5, 0.5**0.5]])


def standing(model):
    """A vehicle that has come to rest on its skids."""
    data = mujoco.MjData(model)
    data.qpos[2] = ON_SKIDS
    mujoco.mj_step(model, data, 300)
    return data


def normal_force(model, data):
    """The sum of all contacts' normal forces, N."""
    total, wrench = 0.0, np.zeros(6)
    for contact in range(data.ncon):
        mujoco.mj_contactForce(model, data, contact, wrench)
        total += wrench[0]
    return total


@pytest.mark.parametrize("visuals", [True, False])
@pytest.mark.parametrize("vehicle", ["tiltrotor", "quadrotor"])
def test_a_vehicle_set_down_stands_on_its_skids_and_carries_its_weight(vehicle, visuals):
    model = compile_model(
        RotorcraftSpec(vehicle, VEHICLE, ground=Ground(height=0.5)), visuals=visuals
    )
    data = mujoco.MjData(model)
    data.qpos[2] = 0.5 + ON_SKIDS + 0.01
    mujoco.mj_step(model, data, 2000)
    assert data.qpos[2] == pytest.approx(0.5 + ON_SKIDS, abs=1e-3)
    assert np.abs(data.qvel).max() < 1e-3
    assert normal_force(model, data) == pytest.approx(WEIGHT, rel=1e-3)
    touching = {model.geom(g).name for c in data.contact for g in (c.geom1, c.geom2)}
    assert touching == {"ground", "skid_left_collision", "skid_right_collision"}


@pytest.mark.parametrize(
    "friction", [0.2, 0.5, 1.0, 1.5, None], ids=lambda value: value or "default"
)
def test_friction_holds_up_to_its_share_of_the_weight(friction):
    ground = {"height": 0.0} if friction is None else {"height": 0.0, "friction": friction}
    tables = {"vehicle": {"model": "quadrotor"}, "controller": {"law": "yaw_position"}}
    scenario = tiltsim.parse_scenario(
        {**tables, "ground": ground, "initial": {"position": [0, 0, 1]}}
    )
    model = flight_model(assemble(scenario))
    share = 0.8 if friction is None else friction

    def acceleration(push, along):
        """In g, of a vehicle that stands and is then pushed at the height of its skids."""
        data = standing(model)
        x, y = push * WEIGHT * along
        data.body("vehicle").xfrc_applied[:] = x, y, 0.0, y * ON_SKIDS, -x * ON_SKIDS, 0.0
        mujoco.mj_step(model, data, 50)
        before = data.qvel[:2] @ along
        mujoco.mj_step(model, data, 100)
        return (data.qvel[:2] @ along - before) / (100 * model.opt.timestep * VEHICLE.gravity)

    # Above that the skids, closer together than they are long, tip sideways first.
    for along in DIRECTIONS if share <= 1.0 else DIRECTIONS[:1]:
        assert abs(acceleration(0.95 * share, along)) < 0.005
        assert acceleration(1.2 * share, along) == pytest.approx(0.2 * share, rel=0.3)


@pytest.mark.parametrize("along", DIRECTIONS)
def test_a_slide_ends_where_coulomb_says_in_all_directions(along):
    """``v^2 / (2 mu g)``; while the skids redistribute the load, a few percent more."""
    friction = 0.5
    model = compile_model(RotorcraftSpec("quadrotor", VEHICLE, ground=Ground(friction=friction)))
    data = standing(model)
    start, data.qvel[:2] = data.qpos[:2].copy(), along
    mujoco.mj_step(model, data, 300)
    assert np.hypot(*data.qvel[:2]) < 1e-3
    way = np.hypot(*(data.qpos[:2] - start))
    assert way == pytest.approx(1.0 / (2.0 * friction * VEHICLE.gravity), rel=0.03)


def test_at_half_of_its_friction_the_vehicle_creeps_by_less_than_a_tenth_of_a_millimeter_a_second():
    model = compile_model(RotorcraftSpec("quadrotor", VEHICLE, ground=Ground(friction=0.5)))
    data = standing(model)
    data.body("vehicle").xfrc_applied[0] = 0.25 * WEIGHT
    data.body("vehicle").xfrc_applied[4] = -0.25 * WEIGHT * ON_SKIDS
    mujoco.mj_step(model, data, 500)
    assert 0.0 < data.qvel[0] < 1e-4


def test_without_ground_nothing_touches():
    model = compile_model(RotorcraftSpec("tiltrotor", VEHICLE), visuals=False)
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    assert model.ngeom == 0


def test_engines_take_off_alike():
    short = {"simulation.duration": 0.6}
    python, native = (
        tiltsim.simulate(tiltsim.load_scenario(LANDING, {**short, "simulation.engine": engine}))
        for engine in ("python", "native")
    )
    np.testing.assert_array_equal(python.samples, native.samples)
    assert python["z"][-1] > python["z"][0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"simulation.plant": "thesis"}, "its equations have no ground contact"),
        ({"initial.position": [0.0, 0.0, -0.1]}, "below ground.height = 0.0"),
        ({"ground.friction": 0.0}, "ground.friction = 0.0"),
    ],
)
def test_mistakes_are_one_line(changes, message):
    assert message in refusal(tiltsim.load_scenario, LANDING, changes)
