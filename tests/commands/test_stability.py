"""``tiltsim stability`` and ``tiltsim attraction``."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

import tiltsim
from tiltsim.cli import main
from tiltsim.commands.stability import MARGINS, parse_sweep
from tiltsim.commands.text import table
from tiltsim.linear.attraction import Attraction
from tiltsim.linear.margins import Margin
from tiltsim.linear.stability import sweep_stability
from tiltsim.views.figures.stability import (
    attraction_figure,
    attraction_panels,
    loop_figure,
    stability_figure,
    sweep_figure,
)

SETPOINT = "ch04_tracking/setpoint#rho_065_modified"
THESIS = ["--set", "simulation.plant=thesis"]
THESIS_KEYS = {"simulation.plant": "thesis"}


def test_json_of_a_rest_point_with_margins(capsys):
    assert main(["stability", SETPOINT, *THESIS, "--margins", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert list(report)[:6] == ["kind", "period", "residual", "stable", "neutral", "poles"]
    assert (report["kind"], report["period"], report["stable"]) == ("rest", None, True)
    assert len(report["poles"]) == len(report["states"]) == 16
    assert set(report["modes"][0]) == {"name", "frequency", "damping", "states", "count"}
    assert report["margins"][0]["place"] == "all inputs"


def test_text_and_figure_of_poles(tmp_path, capsys):
    figure = tmp_path / "poles.svg"
    assert main(["stability", SETPOINT, *THESIS, "--plot", str(figure)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["kind      rest point", "verdict   stable"]
    assert "Poles of the rest point: stable" in figure.read_text(encoding="utf-8")


def test_axes_of_poles_are_labeled_where_the_poles_are():
    """Slow poles lie between labels; double poles that rounding splits stretch no axis."""
    poles = np.array(
        [-0.2 + 1.0j, -0.5 + 1.6j, -0.5 - 1.6j, -0.2 - 1.0j, -300 + 1e-3j, -300 - 1e-3j]
    )
    found = replace(tiltsim.stability(tiltsim.load_scenario(SETPOINT, THESIS_KEYS)), poles=poles)
    (axes,) = stability_figure(found).axes
    assert axes.get_xscale() == "symlog"
    assert axes.get_yscale() == "linear"
    low, high = axes.get_xlim()
    real = [tick for tick in axes.get_xticks() if low <= tick <= high]
    assert real == [-100.0, -10.0, -1.0, -0.1, 0.0, 0.1][: len(real)]
    assert len(real) >= 5
    assert sum(0.0 < tick <= axes.get_ylim()[1] for tick in axes.get_yticks()) >= 2


def test_a_sweep_prints_where_stability_is_lost(capsys):
    keys = [*THESIS, "--set", "controller.allow_unstable=true"]
    assert main(["stability", SETPOINT, *keys, "--sweep", "vehicle.mass=0.4:0.5:2"]) == 0
    printed = capsys.readouterr().out
    assert printed.splitlines()[1].split() == ["vehicle.mass", "left", "after", "1", "s", "verdict"]
    assert printed.count("stable") == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("gait.period=1", "write KEY=FROM:TO"),
        ("gait.period=a:b", "write KEY=FROM:TO"),
        ("gait.period=1:1", "with 2 to 1000 :POINTS"),
        ("gait.period=1:inf", "two finite numbers"),
        ("gait.period=1:2:100000000000", "with 2 to 1000 :POINTS"),
        ("period", "gait.period has no value to start from"),
    ],
)
def test_a_wrong_sweep_is_refused(text, message):
    with pytest.raises(tiltsim.InputError, match=message):
        parse_sweep(text, [tiltsim.load_scenario(SETPOINT)])


def test_all_values_of_a_sweep_are_checked_before_the_first_is_analyzed():
    seen = []
    with pytest.raises(tiltsim.InputError, match=r"vehicle.mass = -1"):
        sweep_stability(tiltsim.load_scenario(SETPOINT), "vehicle.mass", [0.4, -1.0], seen.append)
    assert not seen


def test_a_sweep_without_a_range_goes_from_half_to_twice():
    key, values = parse_sweep("vehicle.mass", [tiltsim.parse_scenario({"vehicle": {"mass": 0.4}})])
    assert (key, len(values)) == ("vehicle.mass", 16)
    assert values[0] == pytest.approx(0.2)
    assert values[-1] == pytest.approx(0.8)


def test_a_margin_without_limit_is_a_word():
    unlimited = Margin("thrust", (0.0, inf), inf, inf, nan, 2.0)
    (row,) = table(MARGINS, [unlimited]).splitlines()[1:]
    words = ["thrust", "0 to any", "any: no crossover", "-", "any", "2.000", "x any, 90.0 deg"]
    assert re.split(" {2,}", row) == words


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([SETPOINT, SETPOINT], "2 scenarios need --sweep KEY"),
        ([SETPOINT, "--margins", "--sweep", "vehicle.mass"], "not with --sweep"),
    ],
)
def test_contradicting_options_are_refused(arguments, message, capsys):
    assert main(["stability", *arguments]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--ranges=-1:1", "--ranges -1:1: write LOW:HIGH,LOW:HIGH"),
        ("--axes=roll,rol", "--axes roll,rol: choose two of x, y"),
        ("--coarse=0", "--coarse 0: must be 1 to 125"),
        ("--refine=7", "--refine 7: must be 0 to 6"),
        ("--ranges=0:1,-2:0", "range of pitch = -2:0: must be within pi/2 either way"),
    ],
)
def test_a_wrong_map_is_refused_in_the_words_of_the_user(option, message, capsys):
    assert main(["attraction", SETPOINT, option, "--quiet"]) == 2
    assert capsys.readouterr().err.startswith(f"tiltsim: {message}")


def test_a_map_of_flights_that_are_too_short_is_refused_in_one_line(capsys, monkeypatch):
    keys = [*THESIS, "--set", "simulation.duration=0.05"]
    grid = ["--ranges=-0.1:0.1,-0.1:0.1", "--coarse=1", "--refine=0", "--quiet"]
    assert main(["attraction", SETPOINT, *keys, *grid, "--json"]) == 2
    printed = capsys.readouterr()
    (line,) = printed.err.splitlines()
    assert line.startswith(f"tiltsim: {SETPOINT}: simulation.duration = 0.05 s is short: the slow")
    assert printed.out == ""
    monkeypatch.setattr("tiltsim.linear.attraction.slowest_mode", lambda scenario: None)
    assert main(["attraction", SETPOINT, *keys, *grid, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["flights"], report["duration"], report["engine"]) == (4, 0.05, "python")


def test_figures_of_sweeps_loops_and_maps():
    """A line a scenario; the curve of singular attitudes where there is one."""
    scenario = tiltsim.load_scenario(SETPOINT, {"simulation.plant": "thesis"})
    points = sweep_stability(scenario, "vehicle.mass", [0.4, 0.45])
    upper, lower = sweep_figure("vehicle.mass", {"one": points, "two": points}).axes
    assert [len(axes.lines) for axes in (upper, lower)] == [3, 3]
    assert lower.get_xlabel() == "mass (kg)"
    gain, nyquist, *_ = loop_figure(tiltsim.linearize(scenario)).axes
    assert [len(axes.lines) for axes in (gain, nyquist)] == [5, 6]
    edges = np.linspace(-1.5, 1.5, 5)
    back, all_of_them = np.arange(25).reshape(5, 5) < 10, np.ones((5, 5), dtype=bool)
    found = Attraction(
        scenario, ("roll", "pitch"), (edges, edges), back, 25, "jax", None, all_of_them
    )
    (axes,) = attraction_figure(found).axes
    assert axes.get_title(loc="left") == "37.5 % of the initial states come back"
    assert len(axes.lines) == 2  # the curve and the scenario
    panels = attraction_panels({"one": found, "two": found}, columns=2).axes
    assert [axes.get_title(loc="left") for axes in panels] == ["one\n37.5 % | -", "two\n37.5 % | -"]
