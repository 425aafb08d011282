"""The analysis commands: reports, figures and refusals."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from tests.refusals import refusal
from tiltsim.cli import build_parser
from tiltsim.commands import gait as gait_command
from tiltsim.commands import thesis
from tiltsim.commands.declaring import call
from tiltsim.commands.gait_options import Case, parse_vehicle
from tiltsim.commands.text import json_text, number
from tiltsim.errors import InputError
from tiltsim.models.cross import as_multirotor
from tiltsim.scenario.loading import load_scenario
from tiltsim.simulation.simulate import simulate
from tiltsim.studies.gait_analysis import map_report, vehicle_name
from tiltsim.studies.multirotor_analysis import gait_report
from tiltsim.system import files
from tiltsim.views.figures import style
from tiltsim.views.figures.gaits import gait_figure, map_figure
from tiltsim.views.figures.vehicles import attainable_figure
from tiltsim_controllers.analysis.published_gaits import (
    DETERMINANT_CASES,
    PATHS,
    PUBLISHED_GAITS,
    TRIANGLE,
)
from tiltsim_controllers.analysis.singularity import force_matrix, residuals, torque_matrix
from tiltsim_controllers.analysis.two_color_planner import Circle
from tiltsim_controllers.gaits import plans
from tiltsim_controllers.vehicle.parameters import PRESETS, SPIN

AR_DRONE = PRESETS["ar_drone_2"]
GAIT_PAGE = Path(__file__).parents[2] / "docs" / "gaits.md"
ATTAINABLE = ["--figure", "attainable", "--plot", "f.png"]


def run(*words: str) -> int:
    given = build_parser(words[0]).parse_args(words)
    return int(call(given.command, given))


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
    assert (report["torque_free_dimension"], report["singular_attitudes"]) == (1, "great circle")
    assert report["torque_free_direction"] == pytest.approx([0.0, 0.0, 1.0])
    assert report["singularity_margin"] == pytest.approx(np.pi / 2)
    assert report["acceptable_share"] == pytest.approx(1.0)
    assert report["warnings"] == []
    assert report["determinant"] == report["R"]


def test_report_of_an_untilted_vehicle_has_the_published_normalization(capsys) -> None:
    report = run_json(capsys, "gait", "--angles", "0,0,0,0")
    assert report["R"] == pytest.approx(4.0)


def test_report_of_a_blue_gait_warns_of_its_rank(capsys) -> None:
    words = ["gait", "--angles", "0.5,-0.5,-0.165813558,0.165813558"]
    report = run_json(capsys, *words)
    assert report["rank"] == 2
    assert (report["torque_free_dimension"], report["singular_attitudes"]) == (0, "all")
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
    for key in ("angles", "rank", "singular_attitudes", "R", "singularity_margin", "rates"):
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


SCENARIOS = {
    "fixed": ('type = "fixed"\nangles = [-0.65, -0.65, 0.65, 0.65]', None),
    "trot": ('type = "trot_continuous"\namplitude = 0.65\nperiod = 2.0', 1.0776),
    "walk": ('type = "walk"\namplitude = 1.25\nlean = 1.055\nperiod = 3.0', -0.8746),
    "walk_third": ('type = "walk"\namplitude = 1.0\nperiod = 1.0\nscale = 0.3333333', 1.4389),
    "run": ('type = "run"\namplitude = 1.0\nperiod = 1.0', 0.5905),
    "run_leaning": ('type = "run"\namplitude = 0.5\nlean = 0.5\nperiod = 1.0', 0.8167),
    "transverse": (
        'type = "transverse_gallop"\namplitude = 0.4\nlean = 1.3\nperiod = 1.0\nscale = 0.3333333',
        1.2292,
    ),
    "rotary": (
        'type = "rotary_gallop"\namplitude = 0.4\nlean = 1.3\nperiod = 2.0\nscale = 0.3333333',
        1.2187,
    ),
    "red": ('type = "two_color"\nperiod = 1.0\nrectangle = [[0.2, 0.8], [-0.8, -0.2]]', np.pi / 2),
    "blue": (
        'type = "two_color"\nperiod = 1.0\ncolor = "blue"\ncentre = [0.5, -0.5]\nradius = 0.2',
        0.0,
    ),
    "waypoints": (
        'type = "waypoints"\nperiod = 1.0\nangles = [[0.0, 0.0, 0.0, 0.0], [0.1, 0.2, -0.1, 0.3]]',
        1.4975,
    ),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_gait_of_a_scenario_shows_its_margin_over_the_period(tmp_path, capsys, name) -> None:
    table, least = SCENARIOS[name]
    file = tmp_path / f"{name}.toml"
    file.write_text(f"[gait]\n{table}\n")
    report = run_json(capsys, "gait", str(file))
    if least is None:
        assert "time" not in report
        assert report["singularity_margin"] == pytest.approx(1.0776, abs=1e-4)
        return
    margins = np.array(report["time"]["singularity_margin"])
    assert report["time"]["time"][-1] == pytest.approx(report["period"], rel=0.01)
    assert len(margins) == len(report["time"]["time"]) > 100
    assert report["min_singularity_margin"] == margins.min() == pytest.approx(least, abs=2e-4)


def test_the_table_of_published_gaits(capsys) -> None:
    rows = {row["key"]: row for row in run_json(capsys, "gait", "--list")}
    assert list(rows) == list(PUBLISHED_GAITS)
    for row in rows.values():
        if row["color"] is not None and "blue" in row["color"]:
            assert row["margin_exact"] == 0.0
            assert row["claim_holds"] in (False, None)
        elif row["margin_biased"] is not None:
            assert row["claim_holds"] is True
    assert run("gait", "--list") == 0
    output = capsys.readouterr().out
    lines = output.splitlines()
    assert all(key in output for key in PUBLISHED_GAITS)
    assert re.search(r"ch06_gait_3 +red +printed +1.57\d\d +1.57\d\d +1.2995 +\S+ +yes", output)
    assert re.search(r"ch06_gait_1 +blue +printed +-1.3738 +0.0000 +-1.5183 +0 +no", output)
    assert lines[0].endswith("  claim")
    assert max(map(len, lines)) <= 80


with_docs = pytest.mark.skipif(
    not GAIT_PAGE.is_file(), reason="the docs are not part of a distribution"
)


@with_docs
def test_the_page_on_gaits_shows_the_current_table(capsys) -> None:
    run("gait", "--list")
    assert capsys.readouterr().out in GAIT_PAGE.read_text(encoding="utf-8")


@with_docs
def test_the_documented_own_gait_flies_and_is_analyzed_as_shown(tmp_path, capsys) -> None:
    page = GAIT_PAGE.read_text(encoding="utf-8")
    section = page.partition("## Your own gait")[2].partition("\n## ")[0]
    file = tmp_path / "my_gait.toml"
    file.write_text(re.findall(r"```toml\n(.*?)```", section, re.S)[0])
    brief = {"simulation.duration": 0.1, "simulation.engine": "python"}
    flight = simulate(load_scenario(file, brief))
    assert flight.end.kind == "completed"
    assert flight.metrics()["min_singularity_margin"] > 1.3
    run("gait", str(file))
    assert capsys.readouterr().out in section


@pytest.mark.parametrize(
    ("angles", "backward"),
    [
        ("0.2,0.1,0.2,0.1", "rotors 2 and 4"),
        ("-0.1,-0.2,-0.1,-0.2", "rotors 1 and 3"),
        ("0,0,0,0", ""),
    ],
)
def test_rotors_that_would_spin_backwards_to_hover_are_named(capsys, angles, backward) -> None:
    words = ["gait", f"--angles={angles}"]
    report = run_json(capsys, *words)
    squares = np.array(SPIN) * np.sign(report["hover_rotor_speeds"])
    squares *= np.square(report["hover_rotor_speeds"]) * AR_DRONE.thrust_coefficient
    weight = AR_DRONE.mass * AR_DRONE.gravity
    assert force_matrix(report["angles"]) @ squares == pytest.approx([0, 0, weight], abs=1e-9)
    assert torque_matrix(report["angles"], AR_DRONE) @ squares == pytest.approx([0] * 3, abs=1e-9)
    warning = f"{backward} would have to spin backwards to hover"
    assert report["warnings"] == ([warning] if backward else [])
    run(*words)
    text = capsys.readouterr().out
    shown = ", ".join(f"{speed:.6g}" for speed in report["hover_rotor_speeds"])
    assert re.search(rf"^hover rotor speeds +{shown} rad/s along the spins$", text, re.M)
    assert ("warning: " in text) is bool(backward)


def test_a_leaning_hover_agrees_with_the_analysis_of_any_rotors() -> None:
    tilts = (-0.65, -0.65, 0.65, 0.65)
    rotors = as_multirotor(AR_DRONE, tilting=True, reverses=False)
    found = gait_report(plans.fixed(tilts), rotors)["hover_rotor_speeds"]
    expected = gait_report(plans.fixed(tilts), AR_DRONE)["hover_rotor_speeds"]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_without_a_hover_there_are_no_hover_speeds(capsys) -> None:
    blue = "0.5,-0.5,-0.165813558,0.165813558"
    for gait in (f"--angles={blue}", "--published=ch06_gait_3"):
        assert run_json(capsys, "gait", gait)["hover_rotor_speeds"] is None
        run("gait", gait)
        assert "hover rotor speeds" not in capsys.readouterr().out


def test_a_rotor_at_rest_does_not_count_as_turning_backwards() -> None:
    # Rotors 2 and 4 hover alone at minus delta: the rounding of the others has a sign.
    delta = np.arctan(gait_report(plans.fixed([0] * 4), AR_DRONE)["drag_ratio"])
    for nudge in (-1e-15, 0.0, 1e-15):
        report = gait_report(plans.fixed([0.1, -delta + nudge, 0.1, -delta]), AR_DRONE)
        assert report["hover_rotor_speeds"][0] == pytest.approx(0.0, abs=1e-4)
        assert report["warnings"] == []


def test_a_moving_gait_shows_values_at_its_start_and_the_worst_case(capsys) -> None:
    run("gait", "ch05_gaits/line#walk_full")
    text = capsys.readouterr().out
    assert "  0.839116 rad at roll 0, pitch 0 rad, at the gait's start\n" in text
    assert re.search(
        r"\nminimum margin +-0.874638 rad over the period\n +its sign is relative", text
    )
    assert "\nmaximum tilt angle   2.305 rad\n" in text
    assert "amplitude" not in text


def test_no_number_is_a_negative_zero(capsys) -> None:
    words = ["--list"], ["--angles", "0,0,0,0"], ["--angles=-0.0,0,0,0", "--roll=-0.0"]
    for options in (*words, ["--published", "ch06_gait_4"]):
        for form in ([], ["--json"]):
            run("gait", *options, *form)
            assert not re.search(r"-0(\.0*)?(?![\d.e])", capsys.readouterr().out)


def test_numbers_as_text() -> None:
    assert number(-0.0) == number(-1e-9, ".4f").rstrip("0").rstrip(".") == "0"
    assert number(-0.5) == "-0.5"
    assert json.loads(json_text({"a": [-0.0, (1, -2.5)], "b": None})) == {
        "a": [0.0, [1, -2.5]],
        "b": None,
    }
    assert "-0.0" not in json_text([-0.0])


def test_a_blue_gait_as_printed_is_reported_as_nearly_singular(capsys) -> None:
    report = run_json(capsys, "gait", "--published", "ch09_gait_5")
    assert report["rank"] == 3
    assert "tau is nearly singular: its smallest singular value is 0.00011" in report["warnings"][0]


EVERYTHING = (
    "mass=1.2,inertia_xx=0.01,inertia_yy=0.02,inertia_zz=0.025,arm_length=0.3,"
    "thrust_coefficient=1.1e-05,drag_coefficient=2e-07,gravity=1.62"
)


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        ("luukkonen,arm_length=0.3", {"arm_length": 0.3}),
        ("luukkonen, mass=1, gravity=1.62", {"mass": 1.0, "gravity": 1.62}),
    ],
)
def test_a_preset_with_overrides(text, changes) -> None:
    assert parse_vehicle(text) == PRESETS["luukkonen"]._replace(**changes)


def test_overrides_alone_change_the_default_vehicle(capsys) -> None:
    text = "arm_length=0.2,thrust_coefficient=1e-5,drag_coefficient=2e-7"
    ratio = 2e-7 / (0.2 * 1e-5)
    report = run_json(capsys, "gait", "--angles", "0,0,0,0", "--vehicle", text)
    assert report["drag_ratio"] == pytest.approx(ratio)
    assert report["vehicle"]["mass"] == AR_DRONE.mass
    report = run_json(capsys, "map", "--vehicle", text)
    assert report["P"] == pytest.approx([np.arctan(ratio), -np.arctan(ratio)])
    assert report["blue"]["alpha_3"]["offset"] == pytest.approx(2 * np.arctan(ratio))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("luukkonen", "luukkonen"),
        ("mass=0.5,arm_length=0.2", "ar_drone_2,mass=0.5,arm_length=0.2"),
        ("luukkonen,gravity=1.62", "luukkonen,gravity=1.62"),
        (EVERYTHING, EVERYTHING),
    ],
)
@pytest.mark.parametrize("command", [("gait", "--angles", "0,0,0,0"), ("map",)])
def test_a_vehicle_is_printed_as_it_is_given(command, text, shown, capsys) -> None:
    assert run(*command, "--vehicle", text) == 0
    rows = dict(
        line.split("  ", 1) for line in capsys.readouterr().out.splitlines() if "  " in line
    )
    assert rows["vehicle"].strip() == shown
    assert parse_vehicle(shown) == parse_vehicle(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("arm=0.3", "'arm' is not a parameter; choose mass, inertia_xx, "),
        ("luukkonen,arm_length=0", "arm_length = 0: must be a number from 1e-12 to 1e+09"),
        ("arm_length=-1", "must be a number from 1e-12 to 1e+09"),
        ("arm_length=nan", "must be a number from 1e-12 to 1e+09"),
        ("arm_length=inf", "must be a number from 1e-12 to 1e+09"),
        ("arm_length=", "must be a number from 1e-12 to 1e+09"),
        ("mass=1,mass=2", "mass is given twice"),
        ("luukkonen,ar_drone_2", "'ar_drone_2': write KEY=VALUE after the preset"),
        (
            "quad,mass=1",
            "'quad' is not a vehicle; choose ar_drone_2, ar_drone_2_unrounded, luukkonen, or KEY=",
        ),
        ("", "'' is not a vehicle"),
    ],
)
@pytest.mark.parametrize("command", [["gait", "--angles", "0,0,0,0"], ["map"]])
def test_mistakes_in_a_vehicle_are_one_clear_line(command, text, message) -> None:
    assert message in refusal(run, *command, "--vehicle", text)


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
        (
            ["--angles", "0,0,0,0", "--vehicle", "ardrone"],
            "choose ar_drone_2, ar_drone_2_unrounded, luukkonen",
        ),
        (["--published", "ch06_gait_9"], "choose ch03_gait_1, "),
        ([], "give one of SCENARIO"),
        (["some", "--angles", "0,0,0,0"], "give one of SCENARIO"),
        (["--angles", "0,0,0,0", "--plot", "figure.xyz"], "unknown format '.xyz'"),
        (["--list", "--published", "ch06_gait_3"], "takes no other option than --json"),
        (["--angles", "0,0,0,0", "--figure", "margin"], "needs --plot FILE"),
        (["--angles", "0,0,0,0", "--case", "half"], "needs --figure determinant"),
        (["--figure", "determinant", "--plot", "f.png", "--angles", "0,0,0,0"], "takes --case"),
        (["--figure", "determinant", "--plot", "f.png", "--roll", "0"], "at level attitude"),
        (["--figure", "comparison", "--plot", "f.png", "--angles", "0,0,0,0"], "no bias"),
        ([*ATTAINABLE, "--published", "ch06_gait_3"], "moves"),
        (
            [
                "--figure",
                "attainable",
                "--plot",
                "f.png",
                "--angles",
                "0,0,0,0",
                "--speed-limits",
                "3,2",
            ],
            "must be less",
        ),
        (
            [
                "--figure",
                "attainable",
                "--plot",
                "f.png",
                "--angles",
                "0,0,0,0",
                "--speed-limits",
                "3",
            ],
            "needs MIN,MAX",
        ),
        (["--angles", "0,0,0,0", "--plot", "figure"], "unknown format ''; choose .png, .svg, .pdf"),
        (["--angles", "0,0,0,0", "--plot", "/no/such/folder/f.png"], "folder does not exist"),
    ],
)
def test_mistakes_are_one_clear_line(words, message) -> None:
    assert message in refusal(run, "gait", *words)


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


def test_a_rejected_path_names_the_place(capsys) -> None:
    assert run("map", "--leg", "red", "0.3,-0.8", "0.8,-0.3", "0.1,0.6", "0.3,-0.8") == 1
    output = capsys.readouterr().out
    assert "rejected: red crosses the curve L (R = 0) at (0.452123, 0.147270)" in output


def test_accepted_paths(capsys) -> None:
    legs = "map --leg red P 0.7,-0.25 0.25,-0.7 P --leg blue P -0.3,0.2 -0.5,-0.3 P"
    assert run(*legs.split()) == 1  # for it is singular all the same
    output = capsys.readouterr().out
    assert "accepted by the generalized theorem" in output
    assert "path: singular: color switch at P" in output
    assert "path: singular: blue: tau has rank 2" in output
    report = run_json(capsys, "map", "--circle", "red", "0.5,-0.5", "0.3")
    assert report["path"]["theorem"] == "generalized"
    assert report["path"]["sound"] is True


def test_blue_is_accepted_as_published_but_singular(capsys) -> None:
    assert run("map", "--circle", "blue", "0.3,-0.5", "0.2", "--json") == 1
    verdict = json.loads(capsys.readouterr().out)["path"]
    assert verdict["accepted"] is True
    assert verdict["sound"] is False


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--leg green 0,0 1,1", "unknown color; choose red, blue"),
        ("--leg red", "needs two finite points"),
        ("--leg red 0,0 30,40", "more than half a turn"),
        ("--leg red 0,0 1", "needs 2 angles"),
        ("--circle red 0,0 -1", "radius -1.0: the radius must be positive"),
        ("--circle red 0,0 x", "must be a number, in rad"),
        ("--circle red 0,0 0.2 --leg red 0,0 1,1", "--circle: not allowed with --leg"),
        ("--plot map.xyz", "unknown format '.xyz'"),
        ("--vehicle none", "choose ar_drone_2, ar_drone_2_unrounded, luukkonen"),
    ],
)
def test_mistakes_on_the_map(words, message) -> None:
    with pytest.raises(InputError, match=message):
        run("map", *words.split())


# --- figures -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_figures_are_written(tmp_path) -> None:
    figures = {
        "singular.svg": gait_figure(PUBLISHED_GAITS["ch08_gait_1"].gait, AR_DRONE),
        "map.png": map_figure(AR_DRONE, [*PATHS.items(), ("C", Circle("red", (0.5, -0.5), 0.2))]),
        "flat.png": attainable_figure(PUBLISHED_GAITS["ch09_gait_7"].exact, AR_DRONE),
    }
    for name, figure in figures.items():
        style.save(figure, tmp_path / name)
        assert (tmp_path / name).stat().st_size > 5_000


FIGURE_WORDS = {
    "roll_pitch.svg": ["--published", "ch06_gait_3"],
    "comparison.png": ["--published", "ch06_gait_4", "--figure", "comparison"],
    "margin.pdf": ["--published", "ch06_gait_4", "--figure", "margin"],
    "attainable.png": [
        "--published",
        "ch09_gait_2",
        "--figure",
        "attainable",
        "--speed-limits",
        "250,400",
    ],
    "determinant.png": ["--figure", "determinant", "--case", "half"],
}


@pytest.mark.parametrize("name", FIGURE_WORDS)
def test_every_kind_of_figure_is_written_by_the_command(tmp_path, capsys, name) -> None:
    target = tmp_path / name
    assert run("gait", *FIGURE_WORDS[name], "--plot", str(target)) == 0
    marks = {".svg": b"<?xml", ".png": b"\x89PNG", ".pdf": b"%PDF"}
    assert target.read_bytes().startswith(marks[target.suffix])
    assert capsys.readouterr().out


def test_an_empty_attainable_set_is_a_warning(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setattr(style, "save", lambda *_: None)
    figure = ["--figure", "attainable", "--plot", str(tmp_path / "attainable.png")]
    words = "nothing is attainable: no rotor speeds from 305.27 to 394.10 rad/s hover"
    for gait, expected in (("ch09_gait_1", True), ("ch09_gait_2", False)):
        run("gait", "--published", gait, *figure)
        assert (f"warning: {words}" in capsys.readouterr().out) is expected
        warnings = run_json(capsys, "gait", "--published", gait, *figure)["warnings"]
        assert any(warning.startswith(words) for warning in warnings) is expected
    run("gait", "--published", "ch09_gait_1")
    assert words not in capsys.readouterr().out


ALL_MARKS = ["unreachable (darker: for longer)", "singular", "level"]


@pytest.mark.parametrize(
    ("gait", "marks", "bar"),
    [
        (plans.continuous_trot(0.65, 1.0), ALL_MARKS, True),
        (PUBLISHED_GAITS["ch08_gait_1"].gait, [ALL_MARKS[0], "level"], False),
        (plans.fixed([0.0] * 4), ["level"], False),
    ],
)
def test_the_legend_explains_only_what_is_drawn(gait, marks, bar) -> None:
    figure = gait_figure(gait, AR_DRONE)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == marks
    assert any(axes.get_ylabel() == "time (s)" for axes in figure.axes) is bar


def test_the_tilt_angles_of_a_constant_gait_are_level_lines() -> None:
    angles = [0.1, 0.2, 0.3, 0.4]
    (axes,) = gait_figure(plans.fixed(angles), AR_DRONE, ["tilt_angles"]).axes
    assert [line.get_ydata().tolist() for line in axes.lines] == [[a, a] for a in angles]


def test_equal_figures_give_equal_files(tmp_path) -> None:
    gait = plans.fixed([0.1, 0.2, 0.3, 0.4])
    figures = [gait_figure(gait, AR_DRONE, ["margin"]) for _ in range(2)]
    for ending in style.FORMATS:
        files = [tmp_path / f"{index}{ending}" for index in range(2)]
        for figure, file in zip(figures, files):
            style.save(figure, file)
        assert files[0].read_bytes() == files[1].read_bytes()


def test_the_margin_figure_shows_the_biased_twin(tmp_path, monkeypatch) -> None:
    shown = []
    monkeypatch.setattr(style, "save", lambda figure, path: shown.append(figure))
    file = tmp_path / "biased.toml"
    file.write_text(f"[gait]\nbias = 0.8\n{SCENARIOS['red'][0]}\n")
    for words in (["--published", "ch06_gait_3"], [str(file)], ["--published", "ch09_gait_2"]):
        run("gait", *words, "--figure", "margin", "--plot", str(tmp_path / "margin.png"))
    labels = [[text.get_text() for text in f.axes[0].get_legend().get_texts()] for f in shown]
    assert labels == [
        ["ch06 gait 3, as printed", "biased, η = 80%"],
        ["two color, biased 80%", "without bias"],
        ["ch09 gait 2, as printed"],
    ]


def test_a_bad_target_is_noticed_before_any_work(tmp_path, monkeypatch) -> None:
    def work(*_: object, **__: object) -> None:
        raise AssertionError("worked")

    monkeypatch.setattr(gait_command, "_select", work)
    monkeypatch.setattr(thesis, "parse_vehicle", work)
    closed = tmp_path / "closed.png"
    closed.touch()
    monkeypatch.setattr(files.os, "access", lambda path, mode: path != closed)
    for target, message in (
        (tmp_path / "f.bmp", "unknown format '.bmp'; choose .png, .svg, .pdf"),
        (tmp_path / "no" / "f.png", "folder does not exist"),
        (closed, "not writable"),
    ):
        for words in (["gait", "--angles", "0,0,0,0"], ["map"]):
            with pytest.raises(InputError, match=message):
                run(*words, "--plot", str(target))


def test_cases_on_the_command_line_agree_with_the_thesis() -> None:
    assert tuple(DETERMINANT_CASES) == get_args(Case)


def test_plot_option_writes_a_file(tmp_path, capsys, monkeypatch) -> None:
    for words in (["gait", "--angles", "0.1,0.2,0.3,0.4", "--panels", "margin"], ["map"]):
        target = tmp_path / f"{words[0]}.png"
        assert run(*words, "--plot", str(target)) == 0
        assert target.read_bytes().startswith(b"\x89PNG")
        assert capsys.readouterr().out.endswith(f"\nfigure written to {target}\n")
        with monkeypatch.context() as patch:
            patch.setattr(style, "save", lambda *_: None)
            assert run(*words, "--plot", str(target), "--json") == 0
        json.loads(capsys.readouterr().out)


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
