"""The rotors that are read from a compiled file, against what MuJoCo makes of unit thrusts."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pytest

import tiltsim
from tiltsim.laws.assembling import assemble
from tiltsim.models.user_vehicle import read_user_vehicle
from tiltsim.plants.mujoco_plant import build_model
from tiltsim.resources import shipped_folder
from tiltsim_controllers.vehicle.rotors import force_and_torque

# A hinge that two rotors share, off both; a rotor that pushes down; center of mass off the origin.
ODD = """
<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="vehicle">
  <freejoint name="vehicle"/><inertial pos="0.01 -0.02 0.03" mass="2" diaginertia="0.02 0.03 0.04"/>
  <site name="rotor_1" pos="0.3 0.1 0" zaxis="0.2 0 1"/>
  <body name="strut" pos="-0.2 0 0.05" euler="0 0 0.4"><body name="pod">
    <joint name="tilt_1" axis="0 1 0.5" pos="0.02 0 -0.03" ref="0.1"/>
    <inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
    <site name="rotor_2" pos="0 0.1 0"/><site name="rotor_3" pos="0 -0.1 0.02" zaxis="0 1 -1"/>
  </body></body>
  <site name="rotor_4" pos="0 -0.3 0"/><site name="rotor_5" pos="0 0.3 0" zaxis="0 0 -1"/>
</body></worldbody><actuator>
  <position name="tilt_1" joint="tilt_1" kp="1" kv="0.1"/>
  {thrusts}{speeds}
</actuator></mujoco>
"""
GEARS = (("8e-6", "1e-7"), ("9e-6", "-2e-7"), ("7e-6", "1e-7"), ("8e-6", "-1e-7"), ("8e-6", "0"))


def odd_vehicle(text=ODD):
    thrusts = "".join(
        f'<general name="thrust_{i}" site="rotor_{i}" gear="0 0 {force} 0 0 {drag}"/>'
        for i, (force, drag) in enumerate(GEARS, start=1)
    )
    speeds = "".join(
        f'<general name="rotor_speed_{i}" joint="vehicle" dyntype="integrator" gainprm="0"/>'
        for i in range(1, len(GEARS) + 1)
    )
    return text.replace("{thrusts}", thrusts).replace("{speeds}", speeds)


def by_unit_thrusts(path, tilts, spins, center):
    """Force and torque (body axes, about the center of mass untilted) of one (rad/s)^2 each."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, columns = mujoco.MjData(model), []
    data.qpos[7:] = tilts
    for i, spin in enumerate(spins, start=1):
        data.ctrl[:] = 0.0
        data.ctrl[model.actuator(f"thrust_{i}").id] = spin
        mujoco.mj_forward(model, data)
        pushed = data.qfrc_actuator[:6].copy()
        data.ctrl[:] = 0.0
        mujoco.mj_forward(model, data)
        pushed -= data.qfrc_actuator[:6]
        force, torque = pushed[:3], pushed[3:]
        columns.append(np.concatenate([force, torque - np.cross(center, force)]))
    return np.transpose(columns)


@pytest.mark.parametrize("name", ["odd", "tilt_hexarotor", "omni_octorotor", "tiltrotor"])
def test_effectiveness_is_what_mujoco_makes_of_unit_thrusts(name, tmp_path):
    path = shipped_folder("mjcf") / f"{name}.xml"
    if name == "odd":
        path = tmp_path / "odd.xml"
        path.write_text(odd_vehicle(), encoding="utf-8")
    found = read_user_vehicle(str(path), "multirotor")
    rotors = found.vehicle
    tilts = np.linspace(-1.1, 0.7, rotors.tilts)
    expected = by_unit_thrusts(path, tilts, rotors.spins, found.center)
    ours = np.vstack(force_and_torque(rotors.table, tilts.tolist()))
    assert np.abs(ours - expected).max() < 1e-12 * np.abs(expected).max()


LOOSE = '<body><joint name="tilt_2"/><geom size="1"/></body></worldbody>'
SERVO = '<position name="tilt_2" joint="tilt_2" kp="1"/>'


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"rotor_3"', '"rotor_9"', "2 sites named rotor_1, rotor_2, ... without a gap"),
        ('name="rotor_speed_5"', 'name="spare"', "no actuator 'rotor_speed_5'"),
        ('"tilt_1"', '"swing"', "joint 'swing' is not one of a multirotor's"),
        (
            "</worldbody>",
            '<body><freejoint/><geom size="1"/></body></worldbody>',
            "joint without a name is not one of a multirotor's",
        ),
        ('gear="0 0 8e-6 0 0 0"', "", "must be a general one with gear 0 0 Kf 0 0 +-Km"),
        (
            '<inertial pos="0 0 0"',
            '<joint name="tilt_2"/><inertial pos="0 0 0"',
            "at most one hinge",
        ),
        ("</worldbody>", LOOSE, "joint 'tilt_2' tilts no rotor"),
    ],
)
def test_a_wrong_file_is_refused_by_name(old, new, message, tmp_path):
    path, text = tmp_path / "odd.xml", odd_vehicle()
    assert old in text
    text = text.replace(old, new)
    if "tilt_2" in text:
        text = text.replace('<general name="thrust_1"', f'{SERVO}<general name="thrust_1"')
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        read_user_vehicle(str(path), "multirotor")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("body", ["", '<geom size="0.1" mass="0.5"/>', '<geom size="0.1"/>'])
def test_flights_leave_out_what_is_only_drawn(body, tmp_path):
    text = odd_vehicle()
    if "mass" in body:  # its geom is the vehicle's mass
        first = text.index("<inertial")
        text = text.replace(text[first : text.index("/>", first) + 2], body)
    else:
        text = text.replace('<site name="rotor_1"', f'{body}<site name="rotor_1"')
    path = tmp_path / "odd.xml"
    path.write_text(text, encoding="utf-8")
    vehicle = {"model": "multirotor", "mjcf": str(path)}
    controller = {"law": "attitude_force", "dimension": 1, "allow_unstable": True}
    scenario = tiltsim.load_scenario({"vehicle": vehicle, "controller": controller})
    flown, shown = (build_model(assemble(scenario), visuals=visuals) for visuals in (False, True))
    assert shown.ngeom == (body != "")
    assert flown.ngeom == ("mass" in body)
    assert (flown.body_mass == shown.body_mass).all()
