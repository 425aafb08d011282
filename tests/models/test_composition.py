"""Models composed by dm_control and through `mujoco.MjSpec` are equal, array for array."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from PIL import Image

from tests.models.test_user_vehicle import (
    DEFAULTS,
    GENERAL_SERVOS,
    INCLUDED_SERVOS,
    TETRAHEDRON,
    edited,
    write,
)
from tiltsim.models import mjcf_editing, rotorcraft
from tiltsim.models.parts import ExtraActuators, Ground, Pod, RotorLimits, TiltServo
from tiltsim.models.rotorcraft import RotorcraftSpec, compile_model
from tiltsim.models.user_vehicle import read_user_vehicle
from tiltsim.resources import shipped_folder
from tiltsim.vehicles import tilt_car
from tiltsim.vehicles.tilt_car import TiltCarSpec, compile_tilt_car
from tiltsim_controllers.tilt_car.vehicle import THESIS_CAR
from tiltsim_controllers.vehicle.parameters import PRESETS

FILE_NAMES = {"paths", "npaths", "mesh_pathadr", "tex_pathadr", "nbuffer"}
"""Differences where a file names meshes or textures: dm_control gives these files new names."""

MJCF = shipped_folder("mjcf")
SHIPPED_MODELS = {"scene", "tilt_car", "tiltrotor", "quadrotor"}
FLEET = sorted({path.stem for path in MJCF.glob("*.xml")} - SHIPPED_MODELS)

LAYERS = (
    ExtraActuators(states=5, begins_with_rotor_speeds=True, memories=3, wrench=True),
    ExtraActuators(hinge_torques=4),
)
RICH = {
    "timestep": 0.002,
    "integrator": "implicitfast",
    "userdata_size": 7,
    "law_states": 2,
    "rotor_limits": RotorLimits(10.0, 900.0),
    "extra_actuators": LAYERS,
    "ground": Ground(height=-1.0, friction=0.5),
}
STOPS = {
    "pod": Pod(mass=0.01, inertia=1e-5),
    "tilt_servo": TiltServo(damping_ratio=0.0, max_angle=0.5),
}
LUUKKONEN = PRESETS["luukkonen"]
SHIPPED = {
    "tiltrotor": RotorcraftSpec("tiltrotor", LUUKKONEN),
    "tiltrotor, all parts": RotorcraftSpec("tiltrotor", LUUKKONEN, **RICH, **STOPS),
    "quadrotor": RotorcraftSpec("quadrotor", LUUKKONEN),
    "quadrotor, all parts": RotorcraftSpec(
        "quadrotor", LUUKKONEN, **RICH | {"extra_actuators": LAYERS[:1]}
    ),
    "tilt_car": TiltCarSpec(THESIS_CAR._replace(mass=1.3, half_angle=0.4), law_states=1),
    "tilt_car, no floor": TiltCarSpec(THESIS_CAR, rotor_floor=False),
}


def fields(owner):
    """All that a model holds, by name: numbers, arrays as bytes, names, and options alike."""
    found = {}
    for name in (name for name in dir(owner) if not name.startswith("_")):
        value = getattr(owner, name)
        if isinstance(value, np.ndarray):
            found[name] = value.dtype, value.shape, value.tobytes()
        elif isinstance(value, int | float | bytes):
            found[name] = value
        elif type(value).__module__ == "mujoco._structs":
            found |= {f"{name}.{inner}": held for inner, held in fields(value).items()}
    return found


_ = write  # a fixture


def clear_caches():
    for composed in (rotorcraft._complete, rotorcraft._bare, rotorcraft._compose):
        composed.cache_clear()
    tilt_car._compose.cache_clear()


@pytest.fixture
def both_ways(monkeypatch):
    """A spec's model by either way, in full and, of a shipped vehicle, without visuals."""

    def compose(spec):
        compile_it = compile_tilt_car if isinstance(spec, TiltCarSpec) else compile_model
        models = []
        for installed in (find_spec, lambda _: None):
            monkeypatch.setattr(mjcf_editing, "find_spec", installed)
            clear_caches()
            models.append([compile_it(spec, visuals=visuals) for visuals in (True, False)])
        return models

    yield compose
    clear_caches()


def differences(pairs):
    pytest.importorskip("dm_control")
    found = set()
    for one, other in zip(*pairs, strict=True):
        one, other = fields(one), fields(other)
        assert len(one) > 600
        assert one.keys() == other.keys()
        found |= {name for name in one if one[name] != other[name]}
    return found


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_vehicles_are_equal(both_ways, name):
    assert not differences(both_ways(SHIPPED[name]))


IMU, END = '<site name="imu"/>', "</mujoco>"
PARTS = """
<keyframe><key name="home" qpos="0 0 1 1 0 0 0 0 0 0 0"/><key name="hover" ctrl="0.1 0.2 0.3 0.4
  0 0 0 0 0 0 0 0"/></keyframe>
<contact><exclude body1="pod_1" body2="pod_2"/><pair geom1="hull" geom2="ground"/></contact>
<tendon><fixed><joint joint="tilt_1" coef="1"/><joint joint="tilt_2" coef="-1"/></fixed></tendon>
<equality><joint joint1="tilt_1" joint2="tilt_3" active="false"/></equality>
<sensor><gyro site="imu"/><jointpos joint="tilt_1"/></sensor>
<custom><numeric name="n" data="1 2 3"/><text name="t" data="hello"/></custom>
<statistic extent="2"/><visual><global fovy="50"/></visual><size nuser_geom="1"/>
"""
BALL = """
<camera name="c" euler="5 6 7"/><site zaxis="1 1 0" type="box" size="0.1 0.2 0.3"/>
<body euler="5 6 7" pos="0 0 -0.1"><geom size="0.01" mass="0.01" user="1"/></body>
"""
INERTIAL = '<inertial pos="0.001 0 0" mass="0.6" quat="1 0.1 0 0" diaginertia="4e-3 5e-3 6e-3"/>'
MESH = """
<asset><mesh name="wing" file="wing.obj"/><texture type="2d" name="skin" file="skin.png"/>
<material name="skin" texture="skin"/></asset><worldbody>
"""
USERS = {
    "as documented": (),
    "degrees, other parts": (
        (' model="my_tiltrotor"', ""),
        ('angle="radian"', 'eulerseq="zyx" balanceinertia="true"'),
        (IMU, IMU + BALL),
        (END, PARTS + END),
    ),
    "limits that must be stated, inertia": (
        ('autolimits="true"', 'autolimits="false"'),
        (IMU, IMU + INERTIAL),
    ),
    "ranges of joints, damping ratio": (
        (' armature="2e-5"', ' armature="2e-5" range="-1 1"'),
        ('kv="0.01"', 'dampratio="1" inheritrange="1"'),
    ),
    "general servos": GENERAL_SERVOS,
    "defaults of all actuators": DEFAULTS,
    "included servos": INCLUDED_SERVOS,
    "mesh": (("<worldbody>", MESH), (IMU, IMU + '<geom type="mesh" mesh="wing" material="skin"/>')),
}


@pytest.mark.parametrize("name", USERS)
def test_users_vehicles_are_equal(both_ways, write, tmp_path, name):
    (tmp_path / "wing.obj").write_text(TETRAHEDRON)
    Image.new("RGB", (8, 8), "teal").save(tmp_path / "skin.png")
    own = read_user_vehicle(str(write(edited(*USERS[name]))), "tiltrotor")
    heavier = own.vehicle._replace(mass=0.9, inertia_xx=4e-3, inertia_yy=5e-3, inertia_zz=8e-3)
    spec = RotorcraftSpec("tiltrotor", heavier, user_vehicle=own, **RICH, **STOPS)
    assert differences(both_ways(spec)) <= (FILE_NAMES if name == "mesh" else set())


@pytest.mark.slow
@pytest.mark.parametrize(
    "path", [MJCF / f"{name}.xml" for name in FLEET], ids=lambda path: path.stem
)
def test_the_fleet_is_equal(both_ways, path):
    own = read_user_vehicle(str(path), "multirotor")
    spec = RotorcraftSpec("multirotor", own.vehicle, user_vehicle=own, law_states=2)
    assert not differences(both_ways(spec))


def test_files_that_dm_control_cannot_read_are_composed(both_ways, write):
    mjcf = pytest.importorskip("dm_control.mjcf")
    path = write(edited((IMU, f'<frame pos="0 0 0.01">{IMU}</frame>')))
    with pytest.raises(KeyError):
        mjcf.from_path(str(path))
    own = read_user_vehicle(str(path), "tiltrotor")
    spec = RotorcraftSpec("tiltrotor", own.vehicle, user_vehicle=own)
    assert not differences(both_ways(spec))
