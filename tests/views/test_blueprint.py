"""The blueprint: views, legends, trails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.flights import SAMPLE_FIELDS, flight
from tests.views.recordings import entities
from tiltsim.cli import main
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import load_scenario
from tiltsim.views.attitude_plane import MOVING_TRAIL_TIME
from tiltsim.views.rerun.blueprint import flight_blueprint
from tiltsim.views.rerun.recording import Recording
from tiltsim.views.signals import signals_of


def views_of(*scenarios, names=(), flights=()):
    """The views of flights of these scenarios, by their titles."""
    assemblies = [assemble(scenario) for scenario in scenarios]
    recorders = Recording(assemblies, names).recorders
    blueprint = flight_blueprint(recorders, flights)
    found, waiting = {}, [blueprint.root_container]
    while waiting:
        part = waiting.pop()
        waiting += [inner for inner in part.contents if hasattr(inner, "column_shares")]
        found |= {view.name: view for view in part.contents if not hasattr(view, "column_shares")}
    return found


def test_a_vehicle_without_tilt_angles_has_no_plot_of_them():
    tilts = "Tilt angles (rad)"
    quadrotor = views_of(load_scenario("ch01_gust/hover#quadrotor")).keys()
    assert tilts in views_of(flight("fixed").scenario).keys() - quadrotor


def test_compared_flights_have_a_vehicle_and_a_plane_each():
    scenarios = [flight(name).scenario for name in ("fixed", "trot")]
    recorders = Recording([assemble(each) for each in scenarios]).recorders
    rows = flight_blueprint(recorders).root_container.contents[0].contents
    origins = [{view.name: view.origin for view in row.contents} for row in rows]
    assert origins[0] == {name: f"world/{name}/camera" for name in ("fixed", "trot")}
    assert origins[1] == {name: f"plane/{name}" for name in ("fixed", "trot")}


def test_flights_of_a_tilt_car_and_a_rotorcraft_are_compared_in_the_plots_of_each():
    compared = [flight("fixed"), flight("tilt_car")]
    views = views_of(*(each.scenario for each in compared), flights=compared)
    paths = {
        name: sorted({path.partition("/")[0] for path in views[name].contents})
        for name in ("Distance from the reference (m)", "Slowest rotor and limits (rad/s)")
    }
    recorders = Recording([each.assembly for each in compared]).recorders
    names = [recorder.part for recorder in recorders]
    assert paths == {
        "Distance from the reference (m)": sorted(names),
        "Slowest rotor and limits (rad/s)": names[:1],
    }


def range_of(view):
    ((low, high),) = view.properties["ScalarAxis"].range.as_arrow_array().to_pylist()
    return low, high


def test_a_diverging_rotor_does_not_flatten_the_plot():
    this = flight("fixed")
    samples = this.samples.copy()
    samples[-1, SAMPLE_FIELDS.index("rotor_speed_2")] = 1e8
    title, speeds = "Rotor speeds along the spin (rad/s)", this["rotor_speeds"]
    for kind, least, most in (("diverged", 1.0, 2.0), ("completed", 1e5, 1e6)):
        lost = replace(this, samples=samples, end=End(kind, 1.2))
        high = range_of(views_of(this.scenario, flights=[lost])[title])[1]
        assert least < high / np.abs(speeds).max() < most


def test_rounding_does_not_fill_a_plot():
    this = flight("fixed")
    samples = this.samples.copy()
    for name in "pqr":
        samples[:, SAMPLE_FIELDS.index(name)] = 1e-16 * np.sin(9.0 * this["time"])
    level = replace(this, samples=samples)
    low, high = range_of(views_of(this.scenario, flights=[level])["Body rates (rad/s)"])
    assert 0.02 < high - low < 0.025


def test_every_column_is_plotted():
    """Also panels of a control law: in the main plots or in the second tab."""
    for name in ("supervised", "tilt_car"):
        scenario = flight(name).scenario
        signals = signals_of(assemble(scenario)).values()
        drawn = {line.values for each in signals for line in each.lines}
        drawn |= {line.reference for each in signals for line in each.lines}
        drawn |= {bound for each in signals for bound in each.bounds}
        speeds = {f"rotor_speed_{rotor}" for rotor in (1, 2, 3, 4)}  # along the spins
        assert drawn >= flight(name).units.keys() - {"time"} - speeds
        titles = views_of(scenario).keys()
        for each in signals:  # a plot beside another one is named by its line
            label = each.lines[0].label.capitalize()
            assert any(title.startswith((each.text, f"{label} (")) for title in titles)


def test_compared_flights_have_one_legend():
    def legends(*names):
        views = views_of(*(flight(name).scenario for name in names)).values()
        plots = [view.properties["PlotLegend"] for view in views if "PlotLegend" in view.properties]
        return [legend.visible.as_arrow_array().to_pylist() == [True] for legend in plots]

    assert sorted(legends("fixed")) == [False, False] + [True] * 10
    assert sorted(legends("fixed", "trot")) == [False] * 4 + [True]


def test_legends_lie_before_the_flight():
    view = views_of(flight("fixed").scenario)["Attitude (rad)"]
    (shown,) = view.properties["TimeAxis"].view_range.as_arrow_array().to_pylist()
    assert shown["start"] < -0.25e9 * flight("fixed").end.time
    assert 1.0 < shown["end"] / (1e9 * flight("fixed").end.time) < 1.1


@pytest.mark.parametrize(("name", "whole"), [("fixed", True), ("trot", False)])
def test_the_attitudes_trail_is_short_if_the_curve_moves(name, whole):
    view = views_of(flight(name).scenario)["Attitude (shaded: unreachable)"]
    (shown,) = view.visualizer_overrides["plane/trail"].ranges.as_arrow_array().to_pylist()
    assert shown["range"]["start"] == (None if whole else -1e9 * MOVING_TRAIL_TIME)


def test_flights_of_one_scenario_are_recorded_under_their_folders(tmp_path, capsys):
    folders = [tmp_path / "mod", tmp_path / "with a.dot"]
    for folder in folders:
        flight("fixed").save(folder)
    path = tmp_path / "both.rrd"
    assert main(["view", *map(str, folders), "--rerun", str(path)]) == 0
    assert {"/mod/singularity/margin", r"/with\ a.dot/singularity/margin"} <= entities(path)


def test_the_plots_of_compared_flights_find_lines_of_any_name():
    view = views_of(*[flight("fixed").scenario] * 2, names=("mod", "a b"))[
        "Singularity margin and threshold (rad)"
    ]
    assert [line.partition("/singularity")[0] for line in view.contents[:2]] == ["mod", r"a\ b"]
