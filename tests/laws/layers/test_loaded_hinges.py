"""Hinges beside or inclined to the thrust of their rotors: servos that give way, on every plant."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import tiltsim
from tiltsim.cli import main
from tiltsim.laws.assembling import assemble
from tiltsim.plants.command import Command, check_command
from tiltsim.plants.commanded_plant import CommandedPlant
from tiltsim.vehicles.rotorcraft import Layout

MOTION = ("position", "attitude", "tilt_angles")
LAG = {"rotor_time_constant": 0.05}


def numbers(values):
    return " ".join(repr(float(value)) for value in np.ravel(values))


def unit(vector):
    return vector / np.linalg.norm(vector)


def vehicle_file(folder, *, beside=0.0, inclined=0.0, armature=1e-5, pod=(1e-9, 1e-13), seed=None):
    """Rotors on tilting arms of 0.2 m, as MJCF: one on each of six, or six on five.

    Args:
        folder: Folder of the file.
        beside: Distance of each rotor from its hinge, m.
        inclined: Angle of its thrust to the right angle with the hinge, rad.
        armature: Armature of each hinge, kg m^2.
        pod: Mass (kg) and moment of inertia (kg m^2) of each pod, about its hinge.
        seed: Seed of random places, directions, coefficients and products of inertia on five arms;
            None for six regular arms.
    """
    rng, random = np.random.default_rng(seed), float(seed is not None)
    arms = [0, 1, 2, 3, 4, 5] if seed is None else [0, 1, 2, 3, 4, 4]
    pods, servos, thrusts, speeds, count = {}, "", "", "", len({*arms})
    for rotor, arm in enumerate(arms, 1):
        angle = 2.0 * np.pi * arm / count
        out, z = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([0.0, 0.0, 1.0])
        if arm not in pods:
            axis = unit(out + 0.1 * random * rng.normal(size=3))
            pods[arm] = (
                f'<body name="pod_{arm + 1}" pos="{numbers(0.2 * out)}">'
                f'<inertial pos="0 0 0" mass="{pod[0]}" diaginertia="{numbers([pod[1]] * 3)}"/>'
                f'<joint name="tilt_{arm + 1}" axis="{numbers(axis)}" armature="{armature}"/>'
            )
            servos += f'<position name="tilt_{arm + 1}" joint="tilt_{arm + 1}" kp="1" kv="1"/>'
        place = beside * (np.cross(z, out) + random * rng.normal(size=3))
        up = unit(z + np.tan(inclined) * (out + random * rng.normal(size=3)))
        pods[arm] += f'<site name="rotor_{rotor}" pos="{numbers(place)}" zaxis="{numbers(up)}"/>'
        thrust, drag = (8.5e-6, 1.4e-7) * (1.0 + 0.1 * random * rng.uniform(-1.0, 1.0, 2))
        gear = numbers([0.0, 0.0, thrust, 0.0, 0.0, (-1.0) ** rotor * drag])
        thrusts += f'<general name="thrust_{rotor}" site="rotor_{rotor}" gear="{gear}"/>'
        speeds += (
            f'<general name="rotor_speed_{rotor}" joint="vehicle" dyntype="integrator" '
            'gainprm="0"/>'
        )
    inertia = [0.035, 0.046, 0.07, *(0.004 * random * rng.uniform(-1.0, 1.0, 3))]
    file = folder / "vehicle.xml"
    file.write_text(
        '<mujoco><worldbody><body name="vehicle"><freejoint name="vehicle"/>'
        f'<inertial pos="0 0 0" mass="1.5" fullinertia="{numbers(inertia)}"/>'
        f"{'</body>'.join(pods.values())}</body></body></worldbody>"
        f"<actuator>{servos}{thrusts}{speeds}</actuator></mujoco>"
    )
    return {"model": "multirotor", "mjcf": str(file)}


def tables(vehicle, plant="mujoco", tilts=6, simulation=None, **others):
    timing = {"duration": 0.2, "timestep": 0.001, "engine": "python", "record_timestep": 0.02}
    return {
        "vehicle": vehicle,
        "controller": {"law": "attitude_force", "dimension": 1},
        "gait": {"type": "fixed", "angles": [0.3 * (-1.0) ** tilt for tilt in range(tilts)]},
        "initial": {"angular_velocity": [0.1, -0.08, 0.12]},
        "simulation": {**timing, "plant": plant, **(simulation or {})},
        **others,
    }


def furthest(one, other, names=MOTION):
    return max(np.abs(one[name] - other[name]).max() for name in names)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("frequency", "armature"), [(300.0, 1e-5), (60.0, 2.5e-4)])
def test_the_rigid_body_deflects_as_mujoco_does(seed, frequency, armature, tmp_path):
    """Rotors of random places, axes and coefficients, that lag and have spin inertia."""
    file = vehicle_file(tmp_path, beside=0.004, inclined=0.1, armature=armature, seed=seed)
    servo = {"natural_frequency": frequency, "damping_ratio": 0.5}
    vehicle = {**file, **LAG, "rotor_inertia": 1e-5, "tilt_servo": servo}
    mujoco, rigid = (
        tiltsim.simulate(tables(vehicle, plant, tilts=5)) for plant in ("mujoco", "rigid_body")
    )
    assert mujoco.end.kind == rigid.end.kind == "completed"
    assert furthest(mujoco, rigid) < 1e-9
    deflection = np.abs(mujoco["tilt_angles"] - mujoco["reference_tilt_angles"]).max()
    assert deflection > 0.02, deflection


@pytest.mark.parametrize("plant", ["mujoco", "rigid_body", "thesis"])
def test_a_servo_gives_way_until_it_carries_its_rotor(plant, tmp_path):
    """Drag of the inclined rotor, and thrust beside the hinge, on a spring of 0.9 N m/rad."""
    vehicle = vehicle_file(tmp_path, beside=0.004, inclined=0.1)
    desired = tables(
        {**vehicle, **LAG}, plant, initial={}, simulation={"duration": 1.0, "timestep": 0.002}
    )
    flight = tiltsim.simulate(desired)
    squares = np.square(flight["rotor_speeds"][-1])
    drag = 1.4e-7 * np.sin(0.1) * np.tile([1.0, -1.0], 3)
    expected = (8.5e-6 * 0.004 * np.cos(0.1) - drag) * squares / 0.9
    deflections = (flight["tilt_angles"] - flight["reference_tilt_angles"])[-1]
    np.testing.assert_allclose(deflections, expected, rtol=2e-3)


@pytest.mark.parametrize(
    ("plant", "beside", "words"),
    [
        ("mujoco", 0.01, "by about 0.027 rad against its servo at hover; more armature or"),
        ("rigid_body", 0.0003, None),
        ("thesis", 0.004, "hover, which the ideal pods of the thesis plant neglect; more armature"),
    ],
)
def test_a_soft_servo_is_reported(plant, beside, words, tmp_path, capsys):
    path = tmp_path / "flight.toml"
    vehicle_file(tmp_path, beside=beside)
    path.write_text(
        f"simulation = {{ plant = '{plant}', duration = 0.01, engine = 'python' }}\n"
        "vehicle = { model = 'multirotor', mjcf = 'vehicle.xml' }\n"
        "controller = { law = 'attitude_force' }\n"
    )
    assert main(["run", str(path)]) == 0
    error = capsys.readouterr().err
    assert (words is None and error == "") or words in error
    assert error.count("\n") <= 1


def test_a_center_of_mass_to_the_side_is_reported(tmp_path, capsys):
    path, vehicle = tmp_path / "flight.toml", vehicle_file(tmp_path)
    file = Path(vehicle["mjcf"])
    file.write_text(file.read_text().replace('pos="0 0 0" mass="1.5"', 'pos="0.01 0 0" mass="1.5"'))
    path.write_text(
        "simulation = { duration = 0.01, engine = 'python' }\n"
        "vehicle = { model = 'multirotor', mjcf = 'vehicle.xml' }\n"
        "controller = { law = 'attitude_force' }\n"
    )
    assert main(["run", str(path)]) == 0
    error = capsys.readouterr().err
    assert "body's origin; not modeled: its center of mass at (0.01, " in error


# --- spin inertia ------------------------------------------------------------------------------

INERTIA = 1e-5  # kg m^2, of a rotor
POD = (0.02, 2e-5)


def spinning_model(own, file):
    """The vehicle of ``own`` with bodies that really spin on its pods, beside and inclined."""
    spec = mujoco.MjSpec.from_file(file)
    turned = {}
    for rotor in range(1, 7):
        site = own.site(f"rotor_{rotor}")
        name, rotation = own.body(site.bodyid[0]).name, np.empty(9)
        mujoco.mju_quat2Mat(rotation, site.quat)
        along = rotation.reshape(3, 3)[:, 2]
        turned[name] = turned.get(name, 0.0) + 0.5 * INERTIA * (np.eye(3) + np.outer(along, along))
        body = spec.body(name).add_body(name=f"spin_{rotor}", pos=site.pos, quat=site.quat)
        body.mass, body.inertia, body.explicitinertial = 1e-12, [INERTIA / 2] * 2 + [INERTIA], True
        body.ipos, body.iquat = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]
        body.add_joint(name=f"spin_{rotor}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    for name, carried in turned.items():
        xx, xy, xz, _, yy, yz, _, _, zz = (POD[1] * np.eye(3) - carried).ravel()
        spec.body(name).inertia = [0.0, 0.0, 0.0]
        spec.body(name).fullinertia = [xx, yy, zz, xy, xz, yz]
    return spec.compile()


@pytest.mark.parametrize("kind", ["rotor_speeds", "rotor_accelerations"])
def test_body_and_pods_react_as_to_bodies_that_spin(kind, tmp_path):
    """A jump of the speeds, and accelerations; two rotors are on one pod."""
    vehicle = vehicle_file(tmp_path, beside=0.01, inclined=0.6, armature=0.0, pod=POD, seed=5)
    law = {"law": "python", "function": "unused.py:law"}
    desired = tables({**vehicle, "rotor_inertia": INERTIA}, tilts=5, controller=law, initial={})
    plant = CommandedPlant(assemble(tiltsim.parse_scenario(desired)))
    own, data, real = plant.model, plant.data, spinning_model(plant.model, vehicle["mjcf"])
    other = mujoco.MjData(real)
    for name in ("vehicle", *(f"tilt_{tilt}" for tilt in range(1, 6))):
        other.joint(name).qpos = data.joint(name).qpos
    mujoco.mj_forward(real, other)
    mass = np.empty((real.nv, real.nv))
    for column, unit_speed in zip(mass, np.eye(real.nv), strict=True):
        mujoco.mj_mulM(real, other, column, unit_speed)
    spins = [real.joint(f"spin_{rotor}").dofadr[0] for rotor in range(1, 7)]
    same = [dof for dof in range(real.nv) if dof not in spins]
    change = np.array([50.0, -30.0, 80.0, 20.0, -60.0, 40.0])
    expected = -np.linalg.solve(mass[np.ix_(same, same)], mass[np.ix_(same, spins)] @ change)

    def moved(by):
        values = by + np.multiply(data.act[:6], kind == "rotor_speeds")
        along_spin = tuple((values * plant._spins).tolist())
        plant.apply(check_command(Command(**{kind: along_spin}), Layout(6, 5)))
        mujoco.mj_forward(own, data)
        return np.array(data.qvel if kind == "rotor_speeds" else data.qacc)

    before = moved(np.zeros(6))
    np.testing.assert_allclose(moved(change) - before, expected, rtol=1e-7, atol=1e-7)
    assert np.abs(expected[6:]).min() > 1.0
