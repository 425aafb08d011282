"""``tiltsim gait --mjcf`` and ``tiltsim fleet``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tiltsim.cli import main
from tiltsim.models.user_vehicle import read_user_vehicle
from tiltsim.resources import shipped_folder
from tiltsim.studies.multirotor_analysis import FLEET, fleet_file, tilted_rotors
from tiltsim.views.figures.vehicles import multirotor_figure
from tiltsim_controllers.analysis.attainable import TiltedRotors
from tiltsim_controllers.analysis.singularity import hover_rotor_speeds, singularity_margin
from tiltsim_controllers.vehicle.parameters import PRESETS
from tiltsim_controllers.vehicle.rotors import force_and_torque

FLEET_PAGE = Path(__file__).parents[2] / "docs" / "fleet.md"
TILTS = (0.4, 0.1, -0.3, 0.2)
TORQUE = "Torque while the lift carries the weight"
TWO = "Singular attitudes: two directions"
LOCATIONS = {"roll_pitch": "left", "attainable": "center"}


def file_of(name):
    return str(shipped_folder("mjcf") / f"{name}.xml")


def report(capsys, *words):
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_four_tilting_rotors_are_analyzed_as_by_the_closed_forms(capsys):
    words = "gait", "--mjcf", file_of("tiltrotor"), "--angles", ",".join(map(str, TILTS))
    found = report(capsys, *words, "--roll", "0.2", "--pitch", "-0.1")
    vehicle = PRESETS["ar_drone_2"]
    assert (found["rotors"], found["tilts"], found["rank"]) == (4, 4, 3)
    assert (found["torque_free_dimension"], found["singular_attitudes"]) == (1, "great circle")
    margin = abs(singularity_margin(TILTS, vehicle, 0.2, -0.1))
    assert found["singularity_margin"] == pytest.approx(float(margin), abs=1e-9)
    expected = hover_rotor_speeds(TILTS, vehicle)
    np.testing.assert_allclose(found["hover_rotor_speeds"], expected, rtol=1e-6)
    assert found["attainable"] is None
    assert "--speed-limits" in found["warnings"][0]


def test_a_file_with_limits_has_attainable_sets_and_faults(capsys):
    found = report(capsys, "gait", "--mjcf", file_of("cant_hexarotor"), "--faults")
    assert (found["torque_free_dimension"], found["singular_attitudes"]) == (3, "none")
    assert found["singularity_margin"] == pytest.approx(np.pi / 2)
    basis = np.array(found["torque_free_forces"])
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), atol=1e-12)
    assert found["attainable"]["forces"]["dimension"] == 3
    assert found["attainable"]["torques"]["dimension"] == 3
    lift = found["attainable"]["forces"]["upper"][2]
    highest = 6.0 * 8.54858e-6 * 838.0**2 * np.cos(np.radians(25.0))
    assert 0.9 * highest < lift < highest  # canted rotors of two spins are not loaded evenly
    hovers = [loss["hover"] is not None for loss in found["faults"]]
    assert hovers == [True] * 4 + [False] * 2
    limited = report(
        capsys, "gait", "--mjcf", file_of("cant_hexarotor"), "--speed-limits", "100,600"
    )
    assert limited["side_force_share"] < found["side_force_share"]


def test_tilting_arms_gain_two_dimensions(capsys):
    words = "gait", "--mjcf", file_of("tilt_hexarotor")
    assert report(capsys, *words)["torque_free_dimension"] == 1
    by_turns = "--angles=0.35,-0.35,0.35,-0.35,0.35,-0.35"
    assert report(capsys, *words, by_turns)["torque_free_dimension"] == 3


def test_tilting_arms_balance_a_gust(capsys):
    found = report(capsys, "gait", "--mjcf", file_of("tilt_hexarotor"), "--balance", "1,0,0")
    assert found["angles"] == found["balance"]["angles"]
    table = read_user_vehicle(file_of("tilt_hexarotor"), "multirotor").vehicle.table
    speeds = np.array(found["balance"]["rotor_speeds"])
    spins = np.array([1.0, -1.0] * 3)
    made = force_and_torque(table, found["angles"])[0] @ (spins * speeds * np.abs(speeds))
    np.testing.assert_allclose(made, [-1.53, 0.0, 1.53 * 9.81], atol=1e-6)


def test_other_tilts_make_the_loss_of_a_rotor_controllable(capsys):
    found = report(capsys, "gait", "--mjcf", file_of("tilt_hexarotor"), "--faults")
    table = read_user_vehicle(file_of("tilt_hexarotor"), "multirotor").vehicle.table
    spins = np.array([1.0, -1.0] * 3)
    for lost, loss in enumerate(found["faults"]):
        assert not loss["hover"]["controllable"]
        free = loss["free_tilts"]
        assert free["controllable"]
        speeds = np.array(free["rotor_speeds"])
        assert (speeds == 0.0).nonzero()[0].tolist() == [lost]
        force, torque = force_and_torque(table, free["angles"])
        np.testing.assert_allclose(torque @ (spins * speeds**2), 0.0, atol=1e-7)
        np.testing.assert_allclose(force @ (spins * speeds**2), [0.0, 0.0, 1.53 * 9.81], atol=1e-6)


def test_a_scenario_has_its_vehicle_and_gait(capsys):
    found = report(capsys, "gait", "fleet/state_drift#restored")
    assert (found["rotors"], found["torque_free_dimension"]) == (7, 3)
    table = found["time"]
    assert found["angles"] == pytest.approx(table["angles"][0])
    assert found["min_torque_free_dimension"] == min(table["torque_free_dimension"]) == 3
    assert found["min_singularity_margin"] == min(table["singularity_margin"])
    assert len(table["time"]) == len(table["rank"]) == len(table["singular_attitudes"])
    assert main(["gait", "fleet/state_drift#restored"]) == 0
    assert "dimension 3 or more\n" in capsys.readouterr().out
    assert "time" not in report(capsys, "gait", "fleet/hexarotor#hover")


def test_the_summary_is_readable(capsys):
    assert main(["gait", "--mjcf", file_of("omni_octorotor"), "--faults"]) == 0
    text = capsys.readouterr().out
    assert "singular attitudes   none\n" in text
    assert "without rotor 8      level, controllable" in text
    words = "--balance", "0,1,0", "--faults"
    assert main(["gait", "--mjcf", file_of("tilt_hexarotor"), *words]) == 0
    text = capsys.readouterr().out
    assert "moves 4 of attitude and lift, 6 of pose\n" in text
    assert "balanced rotor speeds" in text
    assert "level, controllable, up to 678.7 rad/s, at 0, " in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--angles", "0,0"], "--angles 0,0: needs 6 angles"),
        (["--vehicle", "luukkonen"], "--mjcf: cannot be combined with --vehicle"),
        (["--angles", "0,0", "--balance", "1,0,0"], "--mjcf: give either --angles or --balance"),
        (["--balance", "1,0"], "--balance 1,0: must be three numbers"),
        (["--balance", "0,0,9.81"], "--balance 0,0,9.81: no tilt angles up to 1.05 rad"),
        (["x.toml"], "--mjcf: cannot be combined with SCENARIO"),
        (["--list"], "--list: takes no other option than --json"),
        (["--figure", "faults", "--plot", "f.png"], "choose roll_pitch or attainable"),
        (["--figure", "determinant", "--plot", "f.png"], "choose roll_pitch or attainable"),
        (["--figure", "attainable"], "--figure attainable: needs --plot FILE"),
        (["--speed-limits", "3"], "needs MIN,MAX"),
    ],
)
def test_mistakes_are_one_line(capsys, words, message):
    assert main(["gait", "--mjcf", file_of("tilt_hexarotor"), *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_file_that_is_none_and_angles_that_turn_nothing(capsys):
    assert main(["gait", "--mjcf", file_of("tilt_car")]) == 2
    assert "no joint 'vehicle'; a multirotor has" in capsys.readouterr().err
    assert main(["gait", "--mjcf", file_of("scene")]) == 2
    assert "rotor_2, ... without a gap; a multirotor has 2 to 16" in capsys.readouterr().err
    assert main(["gait", "--mjcf", file_of("hexarotor"), "--angles", "0.1"]) == 2
    assert "no rotor of" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "kind", "titles"),
    [
        ("tiltrotor", "roll_pitch", ["Singular attitudes: great circle", ""]),
        ("omni_octorotor", "attainable", ["Force without torque, by weight", TORQUE]),
    ],
)
def test_figures(name, kind, titles):
    vehicle = read_user_vehicle(file_of(name), "multirotor").vehicle
    rotors = tilted_rotors(vehicle, FLEET[name])
    figure = multirotor_figure(rotors, kind)
    assert [axes.get_title(loc=LOCATIONS[kind]) for axes in figure.axes] == titles


def test_two_singular_directions_and_no_hover_are_drawn():
    axes = np.array([[0.0, 0.0, 0.5, 0.0, -0.5], [0.0] * 5, [1.0] * 5])
    places = np.random.default_rng(1).normal(size=(3, 5))
    rotors = TiltedRotors(axes, np.cross(places, axes, axis=0), np.zeros(5), np.ones(5), 100.0)
    assert multirotor_figure(rotors, "roll_pitch").axes[0].get_title(loc="left") == TWO
    assert "none" in [t.get_text() for t in multirotor_figure(rotors, "attainable").axes[1].texts]


def test_plot_is_written(capsys, tmp_path):
    file = tmp_path / "f.png"
    assert main(["gait", "--mjcf", file_of("hexarotor"), "--plot", str(file)]) == 0
    assert capsys.readouterr().out.endswith(f"\nfigure written to {file}\n")
    assert file.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_the_page_has_the_table_that_the_command_prints(capsys):
    assert main(["fleet", "--markdown"]) == 0
    assert capsys.readouterr().out.strip() in FLEET_PAGE.read_text(), "run tiltsim fleet --markdown"


def test_the_fleet_in_two_formats(capsys):
    assert main(["fleet", "--json", "--markdown"]) == 2
    assert "--markdown: not allowed with --json" in capsys.readouterr().err
    assert all(fleet_file(name).is_file() for name in FLEET)
