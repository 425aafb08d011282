"""The analysis commands: what they report, draw and refuse."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys

import numpy as np
import pytest

from controllers.gaits import plans
from controllers.published_gaits import DETERMINANT_CASES, PATHS, PUBLISHED_GAITS, TRIANGLE
from controllers.singularity import residuals
from controllers.two_color_planner import Circle
from controllers.vehicle import PRESETS
from tiltsim.analysis import gait_report, map_report, vehicle_name
from tiltsim.commands import gait as gait_command
from tiltsim.commands import map as map_command
from tiltsim.errors import InputError
from tiltsim.figures import style
from tiltsim.figures.attainable import attainable_figure
from tiltsim.figures.determinant import determinant_figure
from tiltsim.figures.gait import comparison_figure, gait_figure, margin_figure
from tiltsim.figures.two_color_map import map_figure

AR_DRONE = PRESETS["ar_drone_2"]


def run(*words: str) -> int:
    parser = argparse.ArgumentParser()
    subparsers = parser.add_subparsers(required=True)
    gait_command.add_parser(subparsers)
    map_command.add_parser(subparsers)
    arguments = parser.parse_args(words)
    return int(arguments.run(arguments))


def run_json(capsys, *words: str) -> dict:
    assert run(*words, "--json") == 0
    return json.loads(capsys.readouterr().out)


# --- gait --------------------------------------------------------------------------------------


def test_report_of_a_red_gait(capsys) -> None:
    report = run_json(capsys, "gait", "--angles", "0.3,-0.2,0.3,-0.2")
    assert report["angles"] == [0.3, -0.2, 0.3, -0.2]
    assert report["vehicle"] == "ar_drone_2"
    assert report["rank"] == 3
    assert len(report["singular_values"]) == 3
    assert report["R_phi"] == report["R_theta"] == 0.0
    assert report["torque_free_direction"] == pytest.approx([0.0, 0.0, 1.0])
    assert report["singularity_margin"] == pytest.approx(np.pi / 2)
    assert report["acceptable_share"] == pytest.approx(1.0)
    assert report["warnings"] == []
    assert "determinant" not in report


def test_report_of_an_untilted_vehicle_has_the_published_normalisation(capsys) -> None:
    report = run_json(capsys, "gait", "--angles", "0,0,0,0")
    assert report["R"] == pytest.approx(4.0)


def test_report_of_a_blue_gait_says_that_rank_is_lost(capsys) -> None:
    words = ["gait", "--angles", "0.5,-0.5,-0.165813558,0.165813558"]
    report = run_json(capsys, *words)
    assert report["rank"] == 2
    assert report["torque_free_direction"] is None
    assert report["singularity_margin"] == 0.0
    assert report["acceptable_share"] == 0.0
    assert "rank of tau is 2" in report["warnings"][0]
    assert run(*words) == 0
    assert "warning: rank of tau is 2" in capsys.readouterr().out


def test_report_at_an_attitude(capsys) -> None:
    words = ["gait", "--angles", "-0.65,-0.65,0.65,0.65", "--roll", "0.1", "--pitch", "-1.4"]
    report = run_json(capsys, *words)
    R, R_phi, R_theta = residuals(report["angles"], AR_DRONE)
    expected = (R * np.cos(0.1) + R_phi * np.sin(0.1)) * np.cos(1.4) - R_theta * np.sin(1.4)
    assert report["determinant"] == pytest.approx(float(expected))
    length = float(np.linalg.norm([R, R_phi, R_theta]))
    expected_margin = np.arcsin(float(expected) * np.sign(float(R)) / length)
    assert report["singularity_margin"] == pytest.approx(expected_margin)
    assert report["singularity_margin"] < 0.0


def test_report_of_a_moving_gait_covers_the_period() -> None:
    walk = plans.cat("walk", 1.0, 2.0)
    report = gait_report(walk, AR_DRONE)
    table = report["time"]
    times = np.array(table["time"])
    assert (times[0], times[-1]) == (0.0, 2.0)
    for key in ("angles", "rank", "singular_values", "R", "singularity_margin", "rates"):
        assert len(table[key]) == len(times)
    assert report["angles"] == table["angles"][0]
    assert report["min_singularity_margin"] == min(table["singularity_margin"]) < 0.0
    assert report["singularity_margin"] > 1.0
    assert "R changes sign before t = " in report["warnings"][0]
    json.dumps(report, allow_nan=False)
    calm = gait_report(walk.scaled(3), AR_DRONE)
    assert calm["min_singularity_margin"] > 1.4
    assert calm["warnings"] == []


def test_reports_of_jumping_and_switching_gaits_are_json() -> None:
    trot = gait_report(plans.instant_trot(0.65, 2.0), AR_DRONE)
    assert trot["max_rate"] is None
    assert trot["continuous"] is False
    switching = gait_report(PUBLISHED_GAITS["ch08_gait_1"].gait, AR_DRONE)
    assert switching["min_rank"] == 2
    assert None in switching["time"]["torque_free_direction"]
    assert "rank of tau is 2 at t = 0.000 s" in switching["warnings"][0]
    for report in (trot, switching):
        json.dumps(report, allow_nan=False)


def test_warning_on_the_curve_l() -> None:
    second = float(
        np.arctan(np.tan(0.6) - 2 * gait_report(plans.fixed([0] * 4), AR_DRONE)["drag_ratio"])
    )
    report = gait_report(plans.fixed([0.6, second, 0.6, second]), AR_DRONE)
    assert report["rank"] == 3
    assert "curve L" in report["warnings"][0]


def test_published_gaits_by_name(capsys) -> None:
    report = run_json(capsys, "gait", "--published", "ch06_gait_3")
    assert report["source"] == "ch. 6, Gait 3"
    assert report["min_singularity_margin"] == pytest.approx(np.pi / 2, abs=2e-3)


def test_vehicles_are_named_or_listed() -> None:
    assert vehicle_name(PRESETS["luukkonen"]) == "luukkonen"
    assert vehicle_name(AR_DRONE._replace(mass=1.0))["mass"] == 1.0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--angles", "0,0,0"], "needs 4 angles separated by commas, has 3"),
        (["--angles", "0,0,0,0,0"], "has 5"),
        (["--angles", "0,0,zero,0"], "must be 4 numbers, in rad"),
        (["--angles", "0,nan,0,0"], "must be finite"),
        (["--angles", "0,inf,0,0"], "must be finite"),
        (["--angles", "-30,-30,30,30"], "degrees would be -0.5236"),
        (["--angles", "0,0,0,0", "--roll", "45"], "more than half a turn"),
        (["--angles", "0,0,0,0", "--pitch", "up"], "must be a number"),
        (["--angles", "0,0,0,0", "--vehicle", "ardrone"], "choose ar_drone_2, luukkonen"),
        (["--published", "ch06_gait_9"], "choose ch03_gait_1, "),
        ([], "give one of SCENARIO"),
        (["some", "--angles", "0,0,0,0"], "give one of SCENARIO"),
        (["--angles", "0,0,0,0", "--plot", "figure.xyz"], "unknown format 'xyz'"),
        (["--angles", "0,0,0,0", "--plot", "/no/such/folder/f.png"], "folder does not exist"),
    ],
)
def test_mistakes_are_one_clear_line(words, message) -> None:
    with pytest.raises(InputError) as caught:
        run("gait", *words)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


# --- map ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "offset"), [("ar_drone_2", 0.334186442), ("luukkonen", 0.3368238)]
)
def test_map_report(capsys, name, offset) -> None:
    report = run_json(capsys, "map", "--vehicle", name)
    assert report["delta"] == pytest.approx(offset / 2, abs=5e-10)
    assert report["P"] == pytest.approx([offset / 2, -offset / 2], abs=5e-10)
    assert report["red"]["alpha_3"] == {"slope": 1.0, "offset": 0.0}
    assert report["blue"]["alpha_3"] == {"slope": -1.0, "offset": pytest.approx(offset, abs=1e-9)}
    assert report["blue"]["alpha_4"] == {"slope": -1.0, "offset": pytest.approx(-offset, abs=1e-9)}
    counts = np.array(report["roots"]["count"])
    assert (counts[8, 8], counts[0, 8], counts[0, 0]) == (2, 3, 5)
    assert len(report["roots"]["list"]) == counts.sum()


def test_map_of_any_vehicle() -> None:
    report = map_report(AR_DRONE._replace(drag_coefficient=2 * AR_DRONE.drag_coefficient))
    assert report["delta"] == pytest.approx(np.arctan(2 * 0.168663), abs=1e-4)


def test_a_refused_path_is_refused_with_the_place(capsys) -> None:
    assert run("map", "--leg", "red", "0.3,-0.8", "0.8,-0.3", "0.1,0.6", "0.3,-0.8") == 1
    output = capsys.readouterr().out
    assert "refused: red crosses the curve L (R = 0) at (0.452123, 0.147270)" in output


def test_accepted_paths(capsys) -> None:
    legs = "map --leg red P 0.7,-0.25 0.25,-0.7 P --leg blue P -0.3,0.2 -0.5,-0.3 P"
    assert run(*legs.split()) == 0
    output = capsys.readouterr().out
    assert "accepted by the generalized theorem" in output
    assert "warning: color switch at P" in output
    report = run_json(capsys, "map", "--circle", "red", "0.5,-0.5", "0.3")
    assert report["path"]["theorem"] == "generalized"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--leg green 0,0 1,1", "unknown color; choose red, blue"),
        ("--leg red", "needs two finite points"),
        ("--leg red 0,0 30,40", "more than half a turn"),
        ("--leg red 0,0 1", "needs 2 angles"),
        ("--circle red 0,0 -1", "radius -1"),
        ("--circle red 0,0 0.2 --leg red 0,0 1,1", "either --leg or --circle"),
        ("--vehicle none", "choose ar_drone_2, luukkonen"),
    ],
)
def test_mistakes_on_the_map(words, message) -> None:
    with pytest.raises(InputError, match=message):
        run("map", *words.split())


# --- figures -----------------------------------------------------------------------------------


def test_figures_are_written(tmp_path) -> None:
    walk = plans.cat("walk", 0.6, 1.0)
    figures = {
        "fixed.png": gait_figure(plans.fixed([-0.65, -0.65, 0.65, 0.65]), AR_DRONE),
        "moving.svg": gait_figure(walk, AR_DRONE),
        "singular.png": gait_figure(PUBLISHED_GAITS["ch08_gait_1"].gait, AR_DRONE),
        "biased.png": comparison_figure([("walk", walk), ("biased", walk.biased(0.8))], AR_DRONE),
        "margin.pdf": margin_figure([("walk", walk), ("third", walk.scaled(3))], AR_DRONE),
        "map.png": map_figure(AR_DRONE, [*PATHS.items(), ("C", Circle("red", (0.5, -0.5), 0.2))]),
        "determinant.png": determinant_figure("negative", AR_DRONE),
        "attainable.png": attainable_figure(PUBLISHED_GAITS["ch09_gait_2"].gait, AR_DRONE),
        "flat.png": attainable_figure(PUBLISHED_GAITS["ch09_gait_7"].exact, AR_DRONE),
        "none.png": attainable_figure(PUBLISHED_GAITS["ch09_gait_1"].gait, AR_DRONE),
    }
    for name, figure in figures.items():
        style.save(figure, tmp_path / name)
        assert (tmp_path / name).stat().st_size > 5_000


def test_plot_option_writes_a_file(tmp_path, capsys) -> None:
    for words in (["gait", "--angles", "0.1,0.2,0.3,0.4"], ["map"]):
        target = tmp_path / f"{words[0]}.png"
        assert run(*words, "--plot", str(target)) == 0
        assert target.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("case", DETERMINANT_CASES)
def test_the_region_of_interest_is_free_of_singularities(case) -> None:
    """Ch. 3, Figs. 10-13: R > 0 within the triangle for all twenty pairs."""
    share = np.linspace(0.0, 1.0, 151)
    first, second = np.meshgrid(share, share)
    inside = first + second <= 1.0
    corners = np.array(TRIANGLE)
    points = (
        corners[0]
        + first[inside, np.newaxis] * (corners[1] - corners[0])
        + second[inside, np.newaxis] * (corners[2] - corners[0])
    )
    for alpha_1, alpha_3 in DETERMINANT_CASES[case].pairs:
        angles = np.insert(points, [0, 1], [alpha_1, alpha_3], axis=1)
        assert residuals(angles, AR_DRONE).R.min() > 0.05


def test_parsers_and_reports_do_not_import_matplotlib() -> None:
    code = (
        "import argparse, sys; from tiltsim.commands import gait, map as m;"
        "s = argparse.ArgumentParser().add_subparsers(); gait.add_parser(s); m.add_parser(s);"
        "assert not {'numpy', 'scipy', 'matplotlib', 'mujoco'} & set(sys.modules);"
        "import tiltsim.analysis, controllers.published_gaits, controllers.attainable;"
        "assert not {'matplotlib', 'mujoco', 'numba', 'scipy'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
