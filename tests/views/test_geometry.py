"""The visual geometry of any model as Rerun entities."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from tests.views.recordings import entities
from tiltsim.models.rotorcraft import RotorcraftSpec, compile_model
from tiltsim.models.vehicle_parts import CROSSES
from tiltsim.views.rerun.scene import geom_archetypes, log_geometry
from tiltsim_controllers.vehicle.parameters import PRESETS

SHAPES = """
<mujoco>
  <asset>
    <material name="red" rgba="1 0 0 1"/>
    <mesh name="wedge" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
    <hfield name="hill" nrow="2" ncol="2" size="1 1 1 1" elevation="0 1 0 1"/>
  </asset>
  <worldbody>
    <geom name="ground" type="plane" size="0 0 1"/>
    <geom name="table" type="plane" size="1 2 1"/>
    <geom name="hill" type="hfield" hfield="hill"/>
    <body name="odd/name">
      <freejoint/>
      <geom name="box" type="box" size="1 1 1" material="red"/>
      <geom name="ball" type="sphere" size="1"/>
      <geom name="egg" type="ellipsoid" size="1 2 3"/>
      <geom name="can" type="cylinder" size="1 2"/>
      <geom type="capsule" size="1 2" pos="0 0 5" euler="90 0 0"/>
      <geom name="wedge" type="mesh" mesh="wedge"/>
      <geom name="hidden" type="sphere" size="1" group="3"/>
    </body>
  </worldbody>
</mujoco>
"""


def test_every_shape_of_any_model_is_drawn_or_named(tmp_path):
    import rerun as rr

    model = mujoco.MjModel.from_xml_string(SHAPES)
    path = tmp_path / "shapes.rrd"
    with rr.RecordingStream("test") as recording:
        recording.save(path)
        assert log_geometry(recording, model, "world") == ["hill"]
    names = {entity.rpartition("/")[2] for entity in entities(path)}
    assert {"table", "box", "ball", "egg", "can", "wedge"} <= names
    assert any(name.startswith("geom_") for name in names), "a geom without a name"
    assert not names & {"ground", "hidden", "hill"}


@pytest.mark.parametrize("vehicle", CROSSES)
def test_every_visible_geom_of_a_vehicle_is_drawn(vehicle, tmp_path):
    import rerun as rr

    model = compile_model(RotorcraftSpec(vehicle, PRESETS["ar_drone_2"]))
    path = tmp_path / "vehicle.rrd"
    with rr.RecordingStream("test") as recording:
        recording.save(path)
        assert log_geometry(recording, model, "world") == []
    visible = [geom for geom in range(model.ngeom) if model.geom_group[geom] == 2]
    drawn = {entity.rpartition("/")[2] for entity in entities(path)}
    assert {model.geom(geom).name for geom in visible} <= drawn


def test_a_capsule_begins_where_mujocos_does():
    model = mujoco.MjModel.from_xml_string(SHAPES)
    capsule = int(np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE)[0])
    (archetype,) = geom_archetypes(model, capsule)
    start = archetype.translations.as_arrow_array().to_pylist()[0]
    np.testing.assert_allclose(start, (0.0, 2.0, 5.0), atol=1e-6)


def test_a_geom_without_a_color_has_its_materials():
    model = mujoco.MjModel.from_xml_string(SHAPES)
    (archetype,) = geom_archetypes(model, model.geom("box").id)
    assert archetype.colors.as_arrow_array().to_pylist() == [0xFF0000FF]
