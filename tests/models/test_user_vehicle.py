"""A user's vehicle by its MJCF file: measured, overridden and refused properties, and flights."""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import tiltsim
from tests.refusals import refusal
from tests.views.recordings import entities
from tiltsim.cli import main
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.models.parts import TiltServo
from tiltsim.models.rotorcraft import RotorcraftSpec, compile_model
from tiltsim.models.user_vehicle import read_user_vehicle
from tiltsim.plants.command import Command
from tiltsim.plants.mujoco_plant import build_model
from tiltsim.resources import shipped_folder
from tiltsim.vehicles.rotorcraft import COLUMNS
from tiltsim.views.figures.plot import plot
from tiltsim.views.rerun.recording import save_recording
from tiltsim.views.video.offscreen import Overlay

DOCS = Path(__file__).parents[2] / "docs"
TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def block(language):
    """The first code block of a language in the documentation's example."""
    text = (DOCS / "own_vehicle.md").read_text(encoding="utf-8")
    return re.search(rf"```{language}\n(.*?)```", text, re.DOTALL)[1]


XML = block("xml")


@pytest.fixture
def write(tmp_path):
    def save(text=XML, **changes):
        for old, new in changes.items():
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "my_tiltrotor.xml"
        path.write_text(text, encoding="utf-8")
        (tmp_path / "parts").mkdir(exist_ok=True)
        included = f"<mujoco><actuator>{''.join(SERVOS)}</actuator></mujoco>"
        (tmp_path / "parts" / "servos.xml").write_text(included, encoding="utf-8")
        return path

    return save


def changed(old, new, count=1):
    assert old in XML
    return XML.replace(old, new, count)


def edited(*changes):
    """The documented file with texts replaced wherever they stand."""
    text = XML
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


SERVOS = re.findall(r"<position name=.*?/>", XML)
GENERAL_SERVOS = [
    (servo, f'<general {servo.split()[1]} {servo.split()[2]} biastype="affine" biasprm="0 -1 -1"/>')
    for servo in SERVOS
]
DEFAULTS = [("<default>\n", '<default>\n<general ctrlrange="-1 1" forcerange="-2 2"/>')]
INCLUDED_SERVOS = [
    *((servo, "") for servo in SERVOS),
    ("<actuator>", '<include file="parts/servos.xml"/><actuator>'),
]


def scenario(path, model="tiltrotor", vehicle=None, **tables):
    vehicle = {"model": model, "mjcf": str(path), **(vehicle or {})}
    tables.setdefault("simulation", {"duration": 0.2, "timestep": 0.002})
    return tiltsim.parse_scenario({"vehicle": vehicle, **tables})


def total_inertia(model):
    """Mass and inertia of all that moves, about its center of mass, world axes, from mj_crb."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    mass = full[0, 0]
    lever = full[3:6, :3] / mass
    center = np.array([lever[2, 1], lever[0, 2], lever[1, 0]])
    return mass, full[3:6, 3:6] - mass * (center @ center * np.eye(3) - np.outer(center, center))


@pytest.mark.slow
def test_the_documented_example_flies_and_meets_its_expectation(write, tmp_path, capsys):
    write()
    (tmp_path / "my_flight.toml").write_text(block("toml"), encoding="utf-8")
    out = tmp_path / "out"
    film = ["--out", str(out), "--rerun", str(tmp_path / "flight.rrd")]
    assert main(["run", str(tmp_path / "my_flight.toml"), *film]) == 0
    assert "ok  final_position_error_x" in capsys.readouterr().out
    assert main(["plot", str(out), "--out", str(tmp_path / "flight.png")]) == 0
    short = ["--set", "simulation.duration=0.1", "--set", "expect=[]", "--quiet"]
    assert main(["run", str(out / "scenario.toml"), *short]) == 0


def test_parameters_come_from_the_file(write):
    own = read_user_vehicle(str(write()), "tiltrotor")
    mass, inertia = total_inertia(mujoco.MjModel.from_xml_string(XML))
    assert own.vehicle.mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(own.vehicle[1:4], np.diag(inertia), rtol=1e-9)
    assert own.vehicle[4:] == pytest.approx((0.2, 8e-6, 2.4e-7, 9.81), rel=1e-12)
    assert own.layout_mismatch == ""
    # A cylinder of 30 g about its diameter, and the armature.
    pod = 0.03 * (0.015**2 / 4.0 + 0.04**2 / 12.0)
    assert own.hinge_inertias == pytest.approx([pod + 2e-5] * 4, rel=1e-9)


def test_a_file_placed_askew_is_measured_in_the_bodys_own_axes(write):
    level = read_user_vehicle(str(write()), "tiltrotor")
    turned = changed('<body name="vehicle">', '<body name="vehicle" pos="1 2 3" euler="1 0.5 2">')
    askew = read_user_vehicle(str(write(turned)), "tiltrotor")
    np.testing.assert_allclose(askew.vehicle, level.vehicle, rtol=1e-9)
    assert askew.layout_mismatch == ""


@pytest.mark.parametrize(
    "own",
    [
        {},
        {"mass": 0.9},
        {"inertia": [4e-3, 5e-3, 8e-3]},
        {"mass": 0.7, "inertia": [3e-3, 3.2e-3, 6e-3], "thrust_coefficient": 1e-5, "gravity": 1.6},
    ],
)
def test_the_compiled_model_has_the_requested_mass_and_inertia(write, own):
    this = scenario(write(), vehicle=own)
    expected = this.rotorcraft.resolve()
    model = build_model(assemble(this))
    mass, inertia = total_inertia(model)
    assert mass == pytest.approx(expected.mass, rel=1e-9)
    np.testing.assert_allclose(inertia, np.diag(expected[1:4]), atol=1e-9)
    assert model.opt.gravity[2] == -expected.gravity
    assert model.actuator("thrust_2").gear[2] == expected.thrust_coefficient
    pods = [model.body_mass[model.body(f"pod_{i}").id] for i in (1, 2, 3, 4)]
    assert pods == pytest.approx([0.03] * 4)  # never touched


def test_a_center_of_mass_off_the_origin_stays_where_it_is(write):
    heavy = '<geom name="camera" type="sphere" size="0.02" pos="0.05 0.02 -0.03" mass="0.1"/>'
    text = changed('<site name="imu"/>', heavy + '<site name="imu"/>')
    path = write(text)
    before, after = (build_model(assemble(scenario(path, vehicle=v))) for v in ({}, {"mass": 0.85}))
    centers = []
    for model in (before, after):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        centers.append(data.subtree_com[model.body("vehicle").id])
    np.testing.assert_allclose(centers[1], centers[0], atol=1e-12)
    assert np.abs(centers[0]).max() > 1e-3
    mass, inertia = total_inertia(after)
    assert mass == pytest.approx(0.85)
    np.testing.assert_allclose(
        np.diag(inertia), read_user_vehicle(str(path), "tiltrotor").vehicle[1:4]
    )


SKEW = "".join(
    f'<geom name="skew_{side}" type="sphere" size="0.01" pos="{x} {x} {z}" mass="0.05"/>'
    for side, x, z in (("front", 0.05, 0.03), ("back", -0.05, -0.03))
)


@pytest.mark.parametrize("vehicle", [{}, {"mass": 0.9}, {"inertia": [4e-3, 5e-3, 8e-3]}])
def test_products_of_inertia_stay_the_files(write, vehicle):
    path = write(changed('<site name="imu"/>', SKEW + '<site name="imu"/>'))
    _, inertia = total_inertia(build_model(assemble(scenario(path, vehicle=vehicle))))
    products = [inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    np.testing.assert_allclose(products, [-2.5e-4, -1.5e-4, -1.5e-4], atol=1e-9)


def off_centre(x):
    return f'<geom name="battery" type="sphere" size="0.01" pos="{x} 0 0" mass="0.05"/>'


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("", None),
        (off_centre(1e-4), None),  # 7 micrometers: within the tolerance of alignment
        (off_centre(0.073), "not modeled: its center of mass at (0.005, 0, 0) m\n"),
        (
            SKEW,
            "not modeled: its products of inertia (xy, xz, yz) = "
            "(-0.00025, -0.00015, -0.00015) kg m^2\n",
        ),
        (SKEW + off_centre(0.083), "(0.005, 0, 0) m and its products of inertia"),
    ],
)
def test_properties_that_the_law_does_not_model_are_reported(write, tmp_path, capsys, more, words):
    write(changed('<site name="imu"/>', more + '<site name="imu"/>'))
    (tmp_path / "my_flight.toml").write_text(block("toml"), encoding="utf-8")
    command = ["run", str(tmp_path / "my_flight.toml"), "--set", "simulation.duration=0.01"]
    assert main([*command, "--set", "expect=[]"]) == 0
    error = capsys.readouterr().err
    assert (words is None and error == "") or words in error
    assert error.count("\n") <= 1
    assert main([*command, "--set", "expect=[]", "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_an_own_controller_may_know_more(write, tmp_path, capsys):
    write(changed('<site name="imu"/>', SKEW + off_centre(0.083) + '<site name="imu"/>'))
    (tmp_path / "my_flight.toml").write_text(block("toml"), encoding="utf-8")
    (tmp_path / "law.py").write_text(
        "import tiltsim\n\ndef law(seen):\n    return tiltsim.Command(rotor_speeds=[470.0] * 4)\n"
    )
    command = ["run", str(tmp_path / "my_flight.toml"), "--set", "simulation.duration=0.01"]
    assert main([*command, "--set", "expect=[]", "--controller", f"{tmp_path}/law.py:law"]) == 0
    assert capsys.readouterr().err == ""


def test_a_center_of_mass_to_the_side_costs_the_documented_error(write):
    path = write(changed('<site name="imu"/>', off_centre(0.0073) + '<site name="imu"/>'))
    flight = tiltsim.simulate(
        scenario(
            path,
            simulation={"duration": 12.0, "timestep": 0.004},
            initial={"rotor_speed": 470.0},
            controller={"decoupling": "exact", "decoupler": "exact", "gains": "exact"},
        )
    )
    vehicle = flight.scenario.rotorcraft.resolve()
    turn = vehicle.mass * vehicle.gravity * 0.0005 / vehicle.inertia_yy
    expected = -vehicle.gravity * (40.0 / 4000.0) * turn / 1.0
    measured = flight.metrics()["final_position_error_x"]
    assert measured == pytest.approx(expected, rel=0.01)
    assert measured == pytest.approx(-0.093, abs=1e-3)


def test_the_servo_is_the_scenarios(write):
    servo = {"natural_frequency": 40.0, "damping_ratio": 0.7, "max_angle": 0.5}
    model = build_model(assemble(scenario(write(), vehicle={"tilt_servo": servo})))
    inertia = model.dof_M0[6]
    assert model.actuator("tilt_1").gainprm[0] == pytest.approx(1600.0 * inertia)
    assert model.actuator("tilt_1").biasprm[2] == pytest.approx(-2.0 * 0.7 * 40.0 * inertia)
    np.testing.assert_array_equal(model.actuator("tilt_4").ctrlrange, [-0.5, 0.5])
    np.testing.assert_array_equal(model.joint("tilt_3").range, [-0.5, 0.5])


def test_a_stop_is_an_angle_in_rad_even_in_a_file_of_degrees(write):
    servo = {"tilt_servo": {"max_angle": 0.5}}
    text = edited(('angle="radian" ', ""), ('autolimits="true"', 'autolimits="false"'))
    model = build_model(assemble(scenario(write(text), vehicle={**servo, "max_rotor_speed": 900})))
    assert model.joint("tilt_3").range == pytest.approx([-0.5, 0.5], rel=1e-15)
    assert model.actuator("tilt_3").ctrlrange.tolist() == [-0.5, 0.5]
    assert model.actuator_ctrllimited[:8].all()


def test_a_general_actuator_can_be_the_servo(write):
    models = [build_model(assemble(scenario(write(edited(*c))))) for c in ((), GENERAL_SERVOS)]
    for name in ("gainprm", "biasprm", "gaintype", "biastype", "ctrllimited"):
        one, other = (getattr(model, f"actuator_{name}") for model in models)
        np.testing.assert_array_equal(one, other)


def test_defaults_of_a_file_are_not_for_what_is_added_to_it(write):
    this = scenario(write(edited(*DEFAULTS)), vehicle={"rotor_inertia": 1e-6})
    model = build_model(assemble(this))
    added = range(12, model.nu)
    assert len(added) > 4
    for name in ("ctrllimited", "forcelimited"):
        assert getattr(model, f"actuator_{name}")[4:12].all()
        assert not getattr(model, f"actuator_{name}")[added].any()


def test_included_actuators_keep_their_place(write):
    model = build_model(assemble(scenario(write(edited(*INCLUDED_SERVOS)))))
    assert [model.actuator(i).name for i in range(5)] == [f"tilt_{i}" for i in range(1, 5)] + [
        "thrust_1"
    ]


def test_keyframes_need_not_give_everything(write):
    keys = '<keyframe><key name="home" qpos="0 0 1 1 0 0 0 0 0 0 0"/><key name="hover"/></keyframe>'
    model = build_model(assemble(scenario(write(changed("</mujoco>", f"{keys}</mujoco>")))))
    speed = read_user_vehicle(str(write()), "tiltrotor").vehicle.hover_rotor_speed
    assert model.key("home").act[:4].tolist() == [0.0] * 4
    assert model.key("hover").act[:4] == pytest.approx([-speed, speed, -speed, speed])
    assert model.key("hover").ctrl[:8] == pytest.approx([0.0] * 4 + [speed**2] * 4)


@pytest.mark.parametrize("model", ["tiltrotor", "quadrotor"])
def test_a_shipped_file_as_ones_own_flies_the_shipped_flight(model):
    file = shipped_folder("mjcf") / f"{model}.xml"
    law = {"quadrotor": {"law": "yaw_position"}, "tiltrotor": {"decoupler": "exact"}}[model]
    tables = {
        "simulation": {"duration": 0.5, "timestep": 0.002, "engine": "python"},
        "controller": law,
        "initial": {"attitude": [0.05, -0.1, 0.1]},
    }
    theirs = tiltsim.simulate(tiltsim.parse_scenario({"vehicle": {"model": model}, **tables}))
    ours = tiltsim.simulate(scenario(file, model, **tables))
    np.testing.assert_allclose(ours.samples, theirs.samples, atol=1e-7)


def test_meshes_beside_the_file_are_found(write, tmp_path):
    (tmp_path / "wing.obj").write_text(TETRAHEDRON, encoding="utf-8")
    text = changed(
        "<worldbody>", '<asset><mesh name="wing" file="wing.obj"/></asset>\n  <worldbody>'
    )
    text = text.replace('<site name="imu"/>', '<site name="imu"/><geom type="mesh" mesh="wing"/>')
    assert build_model(assemble(scenario(write(text)))).nmesh == 1


def test_an_edited_file_is_read_again(write):
    path = write()
    assert scenario(path).rotorcraft.resolve().mass == pytest.approx(0.68)
    path = write(changed('mass="0.5"', 'mass="0.6"'))
    assert scenario(path).rotorcraft.resolve().mass == pytest.approx(0.78)
    assert total_inertia(build_model(assemble(scenario(path))))[0] == pytest.approx(0.78)


def test_an_edited_include_is_read_again(write, tmp_path):
    text = re.sub(r"<option .*?/>", '<include file="moon.xml"/>', XML, count=1)
    path = write(text)
    for gravity in (1.62, 1.625):
        (tmp_path / "moon.xml").write_text(f"<mujoco><option gravity='0 0 -{gravity}'/></mujoco>")
        assert scenario(path).rotorcraft.resolve().gravity == gravity
        assert -build_model(assemble(scenario(path))).opt.gravity[2] == gravity


def rename(name):
    return lambda: XML.replace(f'name="{name}"', 'name="other"')


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (lambda: XML.replace('"vehicle">\n      <free', '"hull_body">\n      <free'), ["no body"]),
        (lambda: changed('joint name="tilt_2"', 'joint name="hinge"'), ["tilt_2"]),
        (rename("imu"), ["no site 'imu'", "rotor_4"]),
        (rename("rotor_3"), ["rotor_3"]),
        (rename("thrust_4"), ["no actuator 'thrust_4'", "rotor_speed_1"]),
        (rename("rotor_speed_1"), ["no actuator 'rotor_speed_1'"]),
        (lambda: changed('position name="tilt_1"', 'position name="tlit_1"'), ["tilt_1"]),
        (
            lambda: changed("<actuator>", '<actuator><motor name="fan" site="imu"/>'),
            ["actuator 'fan' is not one of a tiltrotor"],
        ),
        (
            lambda: changed('joint name="tilt_1" axis', 'joint name="tilt_1" type="slide" axis'),
            ["joint 'tilt_1' must be a hinge"],
        ),
        (
            lambda: changed('gear="0 0 8e-6 0 0 2.4e-7"', 'gear="0 0 8e-6 0 0 -2.4e-7"'),
            ["'thrust_1' must be a general one with gear 0 0 Kf 0 0 +Km"],
        ),
        (
            lambda: changed('gear="0 0 8e-6 0 0 2.4e-7"', 'gear="0 0 9e-6 0 0 2.4e-7"'),
            ["same Kf and Km"],
        ),
        (
            lambda: changed('"thrust_2" site="rotor_2"', '"thrust_2" site="rotor_1"'),
            ["'thrust_2' must act on the site 'rotor_2'"],
        ),
        (
            lambda: changed('<position name="tilt_3" joint', '<motor name="tilt_3" joint').replace(
                'joint="tilt_3" class="pod"/>\n    <position name="tilt_4"',
                'joint="tilt_3"/>\n    <position name="tilt_4"',
            ),
            ["'tilt_3' must be a position servo"],
        ),
        (
            lambda: edited((SERVOS[2], SERVOS[2].replace("position", "velocity"))),
            ["'tilt_3' must be a position servo"],
        ),
        (lambda: changed('dyntype="integrator"', 'dyntype="none"'), ["dyntype integrator"]),
        (lambda: changed('gravity="0 0 -9.81"', 'gravity="1 0 -9.81"'), ["must point down z"]),
        (
            lambda: edited(("8e-6 0 0", "1e308 0 0")),
            ["gear of an actuator: 1e+308: must be at most 1e+09, at least 1e-12"],
        ),
        (lambda: edited(("8e-6 0 0", "1e-320 0 0")), ["gear of an actuator", "at least 1e-12"]),
        (
            lambda: changed('gravity="0 0 -9.81"', 'gravity="0 0 -1e300"'),
            ["option gravity: 1e+300"],
        ),
        (lambda: changed('pos="0.2 0 0"', 'pos="0 0 0"'), ["'rotor_1' lies in the middle"]),
        (lambda: "<mujoco", ["not XML"]),
        (lambda: "<mujoco><worldbody/></mujoco>", ["no body 'vehicle'"]),
        (lambda: changed('pos="0 0.2 0"', 'pos="0 0.25 0"'), ["'rotor_2' lies at (0, 0.25, 0)"]),
        (lambda: changed('axis="0 1 0"', 'axis="0 -1 0"'), ["'tilt_2' turns about (0, -1, 0)"]),
        (
            lambda: changed('<site name="rotor_4"/>', '<site name="rotor_4" euler="0.2 0 0"/>'),
            ["z axis of site 'rotor_4'", "attitude_altitude law needs four equal arms"],
        ),
    ],
)
def test_mistakes_are_named(write, text, words):
    path = write(text())
    message = refusal(scenario, path)
    assert "vehicle.mjcf" in message
    assert "\n" not in message
    for word in words:
        assert word in message


def test_the_actuators_order_counts(write):
    text = changed('    <position name="tilt_1" joint="tilt_1" class="pod"/>\n', "")
    text = text.replace(
        '    <general name="thrust_1"',
        '    <position name="tilt_1" joint="tilt_1" class="pod"/>\n    <general name="thrust_1"',
    )
    with pytest.raises(InputError, match="actuators must be in the order tilt_1, tilt_2"):
        scenario(write(text))


@pytest.mark.parametrize(
    ("vehicle", "words"),
    [
        ({"arm_length": 0.3}, ["vehicle.arm_length", "defined by vehicle.mjcf"]),
        ({"pod": {"mass": 0.1, "inertia": 1e-4}}, ["vehicle.pod", "defined by vehicle.mjcf"]),
        ({"mjcf": "nowhere.xml"}, ["cannot be read: No such file"]),
        ({"model": "quadrotor"}, ["no actuator", "joint 'tilt_1' is not one of a quadrotor"]),
    ],
)
def test_scenarios_that_contradict_the_file_are_refused(write, vehicle, words):
    line = refusal(scenario, write(), vehicle=vehicle)
    assert any(word in line for word in words)


@pytest.mark.parametrize(
    ("vehicle", "words"),
    [
        ({"mass": 0.1}, "carries already have 0.12 kg"),
        ({"inertia": [1e-3, 1e-3, 1.5e-3]}, "principal moments"),
    ],
)
def test_a_mass_that_no_body_makes_up_for_is_refused(write, vehicle, words):
    with pytest.raises(InputError, match=words):
        build_model(assemble(scenario(write(), vehicle=vehicle)))


@pytest.fixture
def other_layout(write):
    """A hovering tiltrotor with one rotor higher than the others."""
    text = changed('pos="0 0.2 0"', 'pos="0 0.2 0.05"')
    return tiltsim.simulate(
        scenario(
            write(text),
            controller={"law": "python", "function": "test"},
            simulation={"duration": 0.3, "timestep": 0.002, "control_timestep": 0.01},
        ),
        controller=lambda seen: Command(thrusts=[seen.vehicle.mass * 9.81 / 4.0] * 4),
    )


def test_ones_own_controller_flies_any_layout(other_layout):
    assert other_layout.end.kind == "completed"
    assert abs(other_layout["z"][-1]) < 1e-6


def test_numbers_of_another_layout_are_left_out(other_layout, tmp_path, capsys):
    flight = other_layout
    assert {*COLUMNS} - {*flight.units} == {"singularity_margin", "determinant"}
    assert not {"min_singularity_margin", "min_decoupling_condition"} & {*flight.metrics()}
    titles = " ".join(axes.get_title("left") for axes in plot(flight).axes)
    assert "Position error" in titles
    assert "margin" not in titles
    assert "Attitudes flown" not in titles
    save_recording([flight], tmp_path / "flight.rrd")
    drawn = " ".join(entities(tmp_path / "flight.rrd"))
    assert "position_error" in drawn
    assert "singularity" not in drawn
    assert "/plane/" not in drawn
    film = Overlay(flight, 240)
    assert film.rows(0) == {"roll, pitch": "+0.00, +0.00 rad"}
    path = tmp_path / "mine.toml"
    path.write_text(
        '[vehicle]\nmodel = "tiltrotor"\nmjcf = "my_tiltrotor.xml"\n'
        '[controller]\nlaw = "python"\nfunction = "mine.py:law"\n'
    )
    assert main(["gait", str(path)]) == 2
    assert "not on four equal arms at right angles" in capsys.readouterr().err


def test_a_ground_needs_geoms_to_touch_it(write):
    with pytest.raises(InputError, match=r"ground.*needs a geom 'ground', and geoms"):
        scenario(write(), ground={"height": -1.0})
    path = write(changed('<geom name="hull" type', '<geom name="hull_collision" type'))
    model = build_model(assemble(scenario(path, ground={"height": -1.0})))
    assert model.geom("hull_collision").contype[0] == 1
    assert model.geom("ground").pos[2] == -1.0


def test_stops_hold_for_servos_that_inherit_the_range_of_their_joints(write):
    joint = (' armature="2e-5"', ' armature="2e-5" range="-1 1"')
    servo = ('kv="0.01"', 'dampratio="1" inheritrange="1"')
    own = read_user_vehicle(str(write(edited(joint, servo))), "tiltrotor")
    for limit in (0.5, None):
        tilt = TiltServo(damping_ratio=0.0, max_angle=limit)
        spec = RotorcraftSpec("tiltrotor", own.vehicle, user_vehicle=own, tilt_servo=tilt)
        model = compile_model(spec)
        for i in range(1, 5):
            hinge, command = model.joint(f"tilt_{i}"), model.actuator(f"tilt_{i}")
            assert (hinge.limited[0], command.ctrllimited[0]) == (limit is not None,) * 2
            if limit:
                assert hinge.range.tolist() == command.ctrlrange.tolist() == [-limit, limit]
