"""The drawings of docs/concepts.md: signs are the model's, numbers the control laws'."""

from __future__ import annotations

import re
from copy import copy
from math import pi
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.flights import flight
from tiltsim.cli import main
from tiltsim.commands.files import scenario_schema
from tiltsim.commands.key_tables import key_tables
from tiltsim.commands.thesis import DECOUPLER_FLIGHTS, drawings, fly_decouplers
from tiltsim.scenario.metric_names import METRICS
from tiltsim.views.figures import concepts, vehicle_drawing
from tiltsim.views.figures.vehicle_drawing import ABOVE, Pose, View
from tiltsim_controllers.analysis.singularity import (
    force_matrix,
    singularity_margin,
    torque_free_direction,
)
from tiltsim_controllers.gaits.plans import continuous_trot
from tiltsim_controllers.laws.feedback import exact_decoupler
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN

VEHICLE = PRESETS["ar_drone_2"]
TILTED = (0.5, 0.4, 0.3, 0.2)
PAGE = Path(__file__).parents[2] / "docs" / "concepts.md"


def wrench(pose, rotor):
    """Force (N) and torque (N m) of one rotor on the level vehicle, by MuJoCo's actuators."""
    pose.data.ctrl[:] = 0.0
    pose.data.actuator(f"thrust_{rotor}").ctrl = 1e5
    mujoco.mj_forward(pose.model, pose.data)
    return np.split(pose.data.qfrc_actuator[:6], 2)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_rotors_are_drawn_with_the_signs_of_the_physics(number):
    pose = Pose(TILTED)
    rotor = pose.rotors[number - 1]
    force, torque = wrench(pose, number)
    np.testing.assert_allclose(rotor.thrust, force / np.linalg.norm(force), atol=1e-12)
    of_drag = torque - np.cross(rotor.hub, force)
    assert of_drag @ rotor.thrust * rotor.spin < 0.0  # the drag torque opposes the spin
    # The controllers' model: signs of the rotor speeds, and directions of the forces.
    assert rotor.spin == SPIN[number - 1]
    column = force_matrix(TILTED)[:, number - 1] * SPIN[number - 1]
    np.testing.assert_allclose(rotor.thrust, column, atol=1e-12)
    # Rotors 1 to 4 are on +x, +y, -x, -y; hinges point outwards; positive tilts lean the thrust
    # clockwise around the vehicle, seen from above.
    np.testing.assert_allclose(
        rotor.hinge, [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)][number - 1]
    )
    assert rotor.hub @ rotor.hinge == pytest.approx(VEHICLE.arm_length)
    assert np.cross(rotor.hub, rotor.thrust)[2] < 0.0


def test_signs_are_read_from_the_model(monkeypatch):
    before = Pose(TILTED).rotors
    model = copy(vehicle_drawing._model())
    model.jnt_axis[1:] *= -1.0
    model.actuator_gear[:, 5] *= -1.0
    monkeypatch.setattr(vehicle_drawing, "_model", lambda: model)
    for old, new in zip(before, Pose(TILTED).rotors, strict=True):
        assert new.spin == -old.spin
        np.testing.assert_allclose(new.hinge, -old.hinge)
        np.testing.assert_allclose(new.thrust[:2], -old.thrust[:2])


def test_arrows_of_spin_and_tilt_turn_as_the_rotors_do(monkeypatch):
    curved = []

    def record(axes, points, *_, **__):
        if len(points) > 2:
            curved.append(points)

    monkeypatch.setattr(vehicle_drawing, "arrow", record)
    figure = concepts.vehicle_figure()
    rotors = Pose((concepts.POSITIVE_TILT,) * 4).rotors
    for rotor, tilt, spin in zip(rotors, curved[::2], curved[1::2], strict=True):
        lean = concepts.BESIDE.project(rotor.thrust - [0.0, 0.0, 1.0])
        moved = tilt[-1] - tilt[0]
        np.testing.assert_allclose(moved / np.linalg.norm(moved), lean / np.linalg.norm(lean))
        x, y = (spin - ABOVE.project(rotor.hub)).T
        assert np.sign(np.diff(np.unwrap(np.arctan2(y, x)))) == pytest.approx(rotor.spin)
    above = figure.axes[1]
    numbers = [text for text in above.texts if text.get_text().isdigit()]
    for number, rotor, text in zip("1234", rotors, numbers, strict=True):
        assert text.get_text() == number
        assert text.get_position() == pytest.approx(ABOVE.project(rotor.hub))


def test_positive_rho_pushes_to_the_left_and_back():
    begin = continuous_trot(0.65, 1.0).angles(0.0)
    assert tuple(begin) == concepts.TROT_ANGLES
    one, two, three, four = (rotor.thrust for rotor in Pose(concepts.TROT_ANGLES).rotors)
    assert min(one[1], three[1]) > 0.5
    assert max(two[0], four[0]) < -0.5


def test_a_view_from_the_side_shows_right_and_up():
    from_behind = View(azimuth=pi, elevation=0.0)  # y is on the left
    np.testing.assert_allclose(
        from_behind.project(np.eye(3)), [[0, 0], [-1, 0], [0, 1]], atol=1e-15
    )
    np.testing.assert_allclose(ABOVE.project(np.eye(3)), [[1, 0], [0, 1], [0, 0]], atol=1e-15)


def test_leans_of_the_decouplers_agree_with_the_control_laws():
    figure = concepts.decoupler_figure(dict.fromkeys(DECOUPLER_FLIGHTS, flight("fixed")))
    words = [text.get_text() for axes in figure.axes for text in axes.texts]
    n = torque_free_direction(concepts.TROT_ANGLES, VEHICLE)
    assert f"force {np.degrees(np.arccos(n[2])):.1f}° off vertical" in words  # level
    assert "force 0.0° off vertical" in words  # exact
    assert "28.3°" in "".join(words)
    assert "28.3°" in PAGE.read_text(encoding="utf-8")


def test_the_drawn_margin_is_the_margin():
    figure = concepts.attitude_figure()
    side, plane = figure.axes
    arc = side.lines[-1].get_xydata()
    turned = np.arctan2(*np.flip(arc[[0, -1]].T, axis=0))
    margin = float(singularity_margin(concepts.TROT_ANGLES, VEHICLE, *concepts.LEANING))
    assert turned[1] - turned[0] == pytest.approx(margin)
    shown = [text.get_text() for text in plane.texts]
    assert {f"leaning: {margin:.2f} rad", "level: 1.08 rad", "hover: 1.57 rad"} <= set(shown)
    assert all(value in PAGE.read_text(encoding="utf-8") for value in (f"{margin:.2f}", "1.08"))


@pytest.mark.parametrize("draw", [concepts.gait_figure, concepts.color_figure])
def test_gaits_and_colors_are_drawn(draw):
    draw().draw_without_rendering()


def test_the_page_shows_all_drawings():
    shown = re.findall(r"\(pictures/concepts_(\w+)\.svg\)", PAGE.read_text(encoding="utf-8"))
    assert shown == list(drawings())


def test_keys_columns_and_flights_of_the_page_exist():
    text = PAGE.read_text(encoding="utf-8")
    keys = set(re.findall(r"`(\w+\.\w+)[ `]", text))
    tables = key_tables(scenario_schema())
    described = {f"{t.places[0][0].name}.{key.name}" for t in tables[1:] for key in t.keys}
    assert keys
    assert keys <= described
    columns = set(re.findall(r"`([a-z]+_\w+)`", text.partition("## Glossary")[2]))
    assert columns
    assert columns <= {*flight("fixed").units, *METRICS}
    assert all(f"#{address.partition('#')[2]}`" in text for address in DECOUPLER_FLIGHTS.values())


@pytest.fixture(scope="module")
def flown():
    return fly_decouplers()


@pytest.mark.slow
def test_the_decouplers_rest_where_the_page_says(flown):
    force = torque_free_direction(concepts.TROT_ANGLES, VEHICLE)
    text = PAGE.read_text(encoding="utf-8")
    hover = exact_decoupler(0.0, 0.0, 0.0, 0.0, 9.8, tuple(force))
    for name, this in flown.items():
        assert (this["roll"][-1], this["pitch"][-1]) == pytest.approx(hover, abs=1e-6)
        away = np.hypot(this["x"][-1], this["y"][-1])
        row = f"| {name} | ({this['x'][-1]:.2f}, {this['y'][-1]:.2f}) m | {away:.2f} m |"
        assert row in text or (name == "exact" and away < 1e-6 and "| below 1e-6 m |" in text)


@pytest.mark.slow
def test_the_command_draws_the_pictures_of_the_page(flown, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("tiltsim.commands.thesis.fly_decouplers", lambda: flown)
    assert main(["concepts", "--out", str(tmp_path / "pictures")]) == 0
    files = sorted(tmp_path.glob("pictures/*"))
    assert {file.name for file in files} == {f"concepts_{name}.svg" for name in drawings()}
    assert all(file.read_bytes().startswith(b"<?xml") for file in files)
    assert len(capsys.readouterr().out.splitlines()) == len(files)
