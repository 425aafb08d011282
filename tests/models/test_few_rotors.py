"""Two and three tilting rotors: their controlled outputs, against MuJoCo and numpy."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tiltsim.models.user_vehicle import read_user_vehicle
from tiltsim.resources import shipped_folder
from tiltsim.studies.multirotor_analysis import gait_report
from tiltsim_controllers.gaits import plans

STEP = {"reference": {"type": "setpoint", "position": [0.25, -0.15, 0.1]}}
SHORT = {"simulation": {"duration": 0.2, "timestep": 0.002, "engine": "python"}}
LOW = ('pos="0 0.25 0.08"', 'pos="0 0.25 0"'), ('pos="0 -0.25 0.08"', 'pos="0 -0.25 0"')
"""Rotors at the height of the center of mass."""


def file_of(name, folder, *changes):
    text = (shipped_folder("mjcf") / f"{name}.xml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "scene.xml").write_bytes((shipped_folder("mjcf") / "scene.xml").read_bytes())
    (folder / f"{name}.xml").write_text(text)
    return folder / f"{name}.xml"


def hinge(number, outwards):
    """Changes that fix a rotor of the tricopter: without its hinge, servo and sensor."""
    return [
        (f'        <joint name="tilt_{number}" class="servo" axis="{outwards}"/>\n', ""),
        (f'    <position name="tilt_{number}" class="servo" joint="tilt_{number}"/>\n', ""),
        (f'    <jointpos name="tilt_angle_{number}" joint="tilt_{number}"/>\n', ""),
    ]


def tail_tilts(folder):
    """A tricopter whose rear rotor alone tilts, the only hinge."""
    across = "0.8660254037844386"
    file = file_of(
        "tricopter",
        folder,
        *hinge(1, f"0.5000000000000001 {across} 0"),
        *hinge(3, f"0.5000000000000001 -{across} 0"),
    )
    text = file.read_text()
    start = text.index("  <keyframe>")
    text = text[:start] + text[text.index("</mujoco>") :]  # its hover is another one
    file.write_text(text.replace("tilt_2", "tilt_1").replace("tilt_angle_2", "tilt_angle_1"))
    return file


def accelerations(model, tilts, w):
    """Linear and angular accelerations of MuJoCo's body, at tilt angles (rad) and inputs."""
    data = mujoco.MjData(model)
    data.qpos[3], data.qpos[7:] = 1.0, tilts
    data.ctrl[: len(tilts)] = tilts
    data.ctrl[len(tilts) : len(tilts) + len(w)] = np.abs(w)
    mujoco.mj_forward(model, data)
    return data.qacc[:6].copy()


def input_rows(file, tilts, w):
    """Finite differences of MuJoCo's accelerations by inputs: shares of hover's, and tilts."""
    model = mujoco.MjModel.from_xml_path(str(file))
    inputs = np.concatenate([np.ones(len(w)), tilts])
    step, rows = 1e-4, []
    for change in step * np.eye(len(inputs)):
        after, before = (
            accelerations(model, x[len(w) :], w * x[: len(w)])
            for x in (inputs + change, inputs - change)
        )
        rows.append((after - before) / (2.0 * step))
    assert np.abs(accelerations(model, tilts, w)).max() < 1e-5  # it hovers
    return np.array(rows).T


def states_controlled(rows, gravity=9.81):
    """Rank of the controllability matrix of position, velocity, attitude and body rates."""
    a, b = np.zeros((12, 12)), np.zeros((12, rows.shape[1]))
    a[0:3, 3:6] = a[6:9, 9:12] = np.eye(3)
    a[3, 7], a[4, 6] = gravity, -gravity  # lift turns with pitch and roll
    b[3:6], b[9:12] = rows[:3], rows[3:]
    blocks = [b]
    for _ in range(11):
        blocks.append(a @ blocks[-1])
    sizes = np.linalg.svd(np.hstack(blocks), compute_uv=False)
    return int((sizes > 1e-6 * sizes[0]).sum())


@pytest.mark.parametrize(
    ("make", "lift", "pose", "states"),
    [
        pytest.param(lambda folder: file_of("bicopter", folder), 4, 4, 12, id="bicopter"),
        pytest.param(lambda folder: file_of("bicopter", folder, *LOW), 3, 4, 10, id="low bicopter"),
        pytest.param(lambda folder: file_of("tricopter", folder), 4, 6, 12, id="tricopter"),
    ],
)
def test_outputs_moved_by_rotors_and_tilts_agree_with_mujoco(tmp_path, make, lift, pose, states):
    file = make(tmp_path)
    vehicle = read_user_vehicle(str(file), "multirotor").vehicle
    found = gait_report(plans.fixed((0.0,) * vehicle.tilts), vehicle)["with_tilts"]
    speeds = np.array(found["rotor_speeds"])
    rows = input_rows(file, np.array(found["angles"]), speeds * np.abs(speeds))
    sizes = [np.linalg.svd(part, compute_uv=False) for part in (rows[[2, 3, 4, 5]], rows)]
    ranks = [int((values > 1e-6 * values[0]).sum()) for values in sizes]
    assert ranks == [lift, pose] == [found["attitude_and_lift"], found["pose"]]
    assert states_controlled(rows) == states


@pytest.mark.parametrize("plant", ["mujoco", "rigid_body"])
@pytest.mark.parametrize("name", ["bicopter", "tricopter"])
def test_python_and_native_fly_few_rotors_the_same(name, plant):
    changes = {"simulation.duration": 0.2, "simulation.plant": plant, "expect": []}
    flights = [
        tiltsim.simulate(
            tiltsim.load_scenario(f"fleet/{name}#hover", {**changes, "simulation.engine": engine})
        )
        for engine in ("python", "native")
    ]
    assert [flight.end.kind for flight in flights] == ["completed"] * 2
    for column in flights[0].columns:
        np.testing.assert_array_equal(*(flight[column] for flight in flights))


@pytest.mark.parametrize("name", ["bicopter", "tricopter"])
def test_mujoco_flies_few_rotors_as_the_equations_do(name):
    changes = {"simulation.duration": 6.0, "simulation.engine": "native", "expect": []}
    flights = [
        tiltsim.simulate(
            tiltsim.load_scenario(f"fleet/{name}#hover", {**changes, "simulation.plant": plant})
        )
        for plant in ("mujoco", "rigid_body")
    ]
    away = np.abs(flights[0]["position"] - flights[1]["position"]).max()
    assert away < 1e-5  # servos and pods of MuJoCo have some inertia


def test_a_tricopter_whose_tail_tilts_leans_against_its_side_force(tmp_path):
    """Allocation also takes fixed rotors, and the axis of the force is found, not assumed."""
    file = str(tail_tilts(tmp_path))
    flight = tiltsim.simulate(
        {
            "vehicle": {"model": "multirotor", "mjcf": file},
            "simulation": {"duration": 12.0, "timestep": 0.004},
            "controller": {"law": "geometric", "tilts": "free"},
            "initial": {"rotor_speed": 618.0},
            **STEP,
        }
    )
    assert flight.end.kind == "completed"
    np.testing.assert_allclose(flight["position"][-1], [0.25, -0.15, 0.1], atol=1e-4)
    assert 0.005 < abs(flight["roll"][-1]) < 0.1


@pytest.mark.parametrize(
    ("controller", "message"),
    [
        ({"law": "attitude_force"}, "2 rotors control attitude and lift only together with"),
        ({"law": "pid"}, "choose full_pose, or geometric with tilts = free"),
        ({"law": "geometric"}, 'controller.law = "geometric": 2 rotors control attitude'),
        ({"law": "full_pose"}, "at the initial tilt angles the inputs move 4 of six outputs"),
    ],
)
def test_a_law_that_cannot_control_two_rotors_says_why(controller, message):
    vehicle = {"model": "multirotor", "mjcf": str(shipped_folder("mjcf") / "bicopter.xml")}
    scenario = {"vehicle": vehicle, "controller": controller, **SHORT, **STEP}
    assert message in refusal(tiltsim.simulate, scenario)


def test_rotors_beside_the_center_of_mass_do_not_pitch(tmp_path):
    vehicle = {"model": "multirotor", "mjcf": str(file_of("bicopter", tmp_path, *LOW))}
    controller = {"law": "geometric", "tilts": "free"}
    message = refusal(tiltsim.simulate, {"vehicle": vehicle, "controller": controller, **SHORT})
    assert 'controller.tilts = "free"' in message
    assert "move 3 of the four outputs attitude and lift" in message


def test_roll_and_pitch_are_no_outputs_of_a_bicopter():
    message = refusal(
        tiltsim.load_scenario, "fleet/bicopter#hover", {"reference.roll": 0.1, "expect": []}
    )
    assert "reference.roll = 0.1" in message
