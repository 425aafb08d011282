"""The shipped vehicles of any number of rotors: their files hover as they say."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from tiltsim.resources import shipped_folder

FLEET = {
    "bicopter": (2, 2),
    "tricopter": (3, 3),
    "hexarotor": (6, 0),
    "cant_hexarotor": (6, 0),
    "tilt_hexarotor": (6, 6),
    "tilt_heptarotor": (7, 7),
    "tilt_octorotor": (8, 8),
    "omni_octorotor": (8, 0),
    "cant_quadrotor": (4, 0),
}
"""Numbers of rotors and of tilt hinges."""


@pytest.mark.parametrize("name", FLEET)
def test_hover_is_an_equilibrium_within_the_rotors_range(name):
    model = mujoco.MjModel.from_xml_path(str(shipped_folder("mjcf") / f"{name}.xml"))
    rotors, tilts = FLEET[name]
    assert (model.na, model.njnt, model.nu) == (rotors, 1 + tilts, tilts + 2 * rotors)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qacc, 0.0, atol=1e-12)
    thrusts = data.ctrl[tilts : tilts + rotors]
    spins = [-np.sign(model.actuator(f"thrust_{i + 1}").gear[5]) for i in range(rotors)]
    np.testing.assert_allclose(thrusts, spins * data.act * np.abs(data.act), rtol=1e-14)
    low, high = model.actuator_actrange[tilts + rotors :].T
    assert (low <= data.act).all()
    assert (data.act <= high).all()
