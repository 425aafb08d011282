"""Ground to stand on: what rests there, what it costs the flights without it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tiltsim
from tiltsim.errors import InputError
from tiltsim.models.parts import Ground
from tiltsim.models.rotorcraft import RotorcraftSpec, compile_model
from tiltsim_controllers.vehicle.parameters import PRESETS

VEHICLE = PRESETS["ar_drone_2"]
WEIGHT = VEHICLE.mass * VEHICLE.gravity
ON_SKIDS = 0.0785  # m, from the skids to the centre of mass
LANDING = "beyond/take_off_and_landing#landing"


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
    model = compile_model(RotorcraftSpec(vehicle, VEHICLE, ground=Ground(0.5)), visuals=visuals)
    data = mujoco.MjData(model)
    data.qpos[2] = 0.5 + ON_SKIDS + 0.01
    mujoco.mj_step(model, data, 2000)
    assert data.qpos[2] == pytest.approx(0.5 + ON_SKIDS, abs=1e-3)
    assert np.abs(data.qvel).max() < 1e-3
    assert normal_force(model, data) == pytest.approx(WEIGHT, rel=1e-3)
    touching = {model.geom(g).name for c in data.contact for g in (c.geom1, c.geom2)}
    assert touching == {"ground", "skid_left_collision", "skid_right_collision"}


def test_friction_holds_up_to_its_share_of_the_weight():
    def slid(push):
        model = compile_model(
            RotorcraftSpec("quadrotor", VEHICLE, ground=Ground(0.0, 0.5)), visuals=False
        )
        data = mujoco.MjData(model)
        data.qpos[2] = ON_SKIDS
        data.body("vehicle").xfrc_applied[0] = push * WEIGHT
        # Pushed at the height of the skids, lest it tip over.
        data.body("vehicle").xfrc_applied[4] = push * WEIGHT * ON_SKIDS
        mujoco.mj_step(model, data, 500)
        return data.qpos[0]

    assert slid(0.4) < 0.01
    assert slid(0.6) > 0.05


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
        ({"simulation.plant": "thesis"}, "its equations know no contact with ground"),
        ({"initial.position": [0.0, 0.0, -0.1]}, "below ground.height = 0.0"),
        ({"ground.friction": 0.0}, "ground.friction = 0.0"),
    ],
)
def test_mistakes_are_one_line(changes, message):
    with pytest.raises(InputError) as caught:
        tiltsim.load_scenario(LANDING, changes)
    assert message in str(caught.value)
