"""The blueprint: views, legends, trails."""

from __future__ import annotations

import pytest

from tests.flights import flight
from tests.views.recordings import entities
from tiltsim.cli import main
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.loading import load_scenario
from tiltsim.views.attitude_plane import MOVING_TRAIL_TIME
from tiltsim.views.rerun.blueprint import flight_blueprint
from tiltsim.views.rerun.recording_file import make_recorders, new_recording


def views_of(*scenarios, names=()):
    """The views of flights of these scenarios, by their titles."""
    assemblies = [assemble(scenario) for scenario in scenarios]
    recorders = make_recorders(new_recording(scenarios, names), assemblies, names)
    blueprint = flight_blueprint(recorders)
    found, waiting = {}, [blueprint.root_container]
    while waiting:
        part = waiting.pop()
        waiting += [inner for inner in part.contents if hasattr(inner, "column_shares")]
        found |= {view.name: view for view in part.contents if not hasattr(view, "column_shares")}
    return found


def test_a_vehicle_without_tilt_angles_has_no_plot_of_them():
    tilts = "Tilt angles (rad)"
    quadrotor = views_of(load_scenario("ch01_gust/hover#quadrotor")).keys()
    assert views_of(flight("fixed").scenario).keys() - quadrotor == {tilts}


def test_compared_flights_have_a_vehicle_and_a_plane_each():
    views = views_of(flight("fixed").scenario, flight("trot").scenario)
    for name in ("fixed", "trot"):
        assert views[name].origin == f"world/{name}/camera"
        assert views[f"Unreachable: {name}"].origin == f"plane/{name}"


def test_a_diverging_rotor_does_not_flatten_the_plot():
    axis = views_of(flight("fixed").scenario)["Rotor speeds along their spins (rad/s)"]
    ((low, high),) = axis.properties["ScalarAxis"].range.as_arrow_array().to_pylist()
    hover = flight("fixed").scenario.rotorcraft.resolve().hover_rotor_speed
    assert (low, high) == pytest.approx((0.0, 2.0 * hover))


def test_compared_flights_have_one_legend():
    def legends(*names):
        views = views_of(*(flight(name).scenario for name in names)).values()
        plots = [view.properties["PlotLegend"] for view in views if "PlotLegend" in view.properties]
        return [legend.visible.as_arrow_array().to_pylist() == [True] for legend in plots]

    assert legends("fixed") == [True] * 5
    assert sorted(legends("fixed", "trot")) == [False] * 4 + [True]


@pytest.mark.parametrize(("name", "whole"), [("fixed", True), ("trot", False)])
def test_the_attitudes_trail_is_short_if_the_curve_moves(name, whole):
    view = views_of(flight(name).scenario)["Attitude (shaded: unreachable attitudes)"]
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
