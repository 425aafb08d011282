"""Visuals added to a user's file, and properties left alone."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from tiltsim.resources import shipped_folder
from tiltsim.views.replay import COUNTERCLOCKWISE, dress

DOCS = Path(__file__).parents[2] / "docs"
SKY = mujoco.mjtTexture.mjTEXTURE_SKYBOX


def file_of(page, folder):
    """The MJCF file of a page of the documentation."""
    text = (DOCS / page).read_text(encoding="utf-8").partition("```xml\n")[2]
    path = folder / "vehicle.xml"
    path.write_text(text.partition("```")[0], encoding="utf-8")
    return path


def added(path):
    """The model of a file, the dressed one, and the types of the geoms added to its vehicle."""
    plain = mujoco.MjModel.from_xml_path(str(path))
    spec = mujoco.MjSpec.from_file(str(path))
    dress(spec)
    model = spec.compile()
    of_vehicle = [model.geom_type[g] for g in range(model.ngeom) if model.geom_bodyid[g]]
    own = [plain.geom_type[g] for g in range(plain.ngeom) if plain.geom_bodyid[g]]
    for kind in own:
        of_vehicle.remove(kind)
    return plain, model, [mujoco.mjtGeom(kind) for kind in of_vehicle]


def test_a_bare_file_gets_sky_floor_light_arms_and_discs(tmp_path):
    plain, model, parts = added(file_of("multirotor.md", tmp_path))
    assert SKY in [int(model.tex(i).type[0]) for i in range(model.ntex)]
    assert (plain.nlight, model.nlight) == (0, 1)
    assert mujoco.mjtGeom.mjGEOM_PLANE in model.geom_type
    assert parts.count(mujoco.mjtGeom.mjGEOM_CYLINDER) == 6
    assert parts.count(mujoco.mjtGeom.mjGEOM_CAPSULE) == 6
    discs = [g for g in range(model.ngeom) if model.geom_rgba[g, 3] == pytest.approx(0.45)]
    radii = model.geom_size[discs, 0]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    apart = np.linalg.norm(data.geom_xpos[discs][1:] - data.geom_xpos[discs][:-1], axis=1)
    assert (apart > radii[1:] + radii[:-1]).all(), "no discs that touch"
    turning = [np.allclose(model.geom_rgba[g], COUNTERCLOCKWISE) for g in discs]
    gears = [model.actuator(f"thrust_{i}").gear[5] for i in range(1, 7)]
    assert turning == [gear < 0.0 for gear in gears]


def test_the_dressed_model_moves_like_the_file(tmp_path):
    plain, model, _ = added(file_of("multirotor.md", tmp_path))
    for name in ("nbody", "nq", "njnt", "nsite"):
        assert getattr(model, name) == getattr(plain, name)
    np.testing.assert_array_equal(model.body_mass, plain.body_mass)
    np.testing.assert_array_equal(model.body_inertia, plain.body_inertia)


def test_arms_that_the_file_draws_are_not_drawn_twice(tmp_path):
    _, model, parts = added(file_of("own_vehicle.md", tmp_path))
    assert parts == [mujoco.mjtGeom.mjGEOM_CYLINDER] * 4
    assert model.nlight == 1, "its own"
    (ground,) = [g for g in range(model.ngeom) if not model.geom_bodyid[g]]
    np.testing.assert_allclose(model.geom_pos[ground], (0.0, 0.0, -3.0))


@pytest.mark.parametrize("name", ["hexarotor", "tilt_octorotor", "omni_octorotor"])
def test_shipped_vehicles_need_nothing(name):
    plain, model, parts = added(shipped_folder("mjcf") / f"{name}.xml")
    assert parts == []
    assert (model.ngeom, model.nlight, model.ntex) == (plain.ngeom, plain.nlight, plain.ntex)
