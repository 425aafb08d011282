"""Names of flights that are shown together, and their common title."""

from __future__ import annotations

from pathlib import Path

import pytest

import tiltsim
from tests.flights import FIXED, TROT
from tiltsim.views.titles import common_title, flight_names


def scenarios(*addresses):
    return [tiltsim.parse_scenario(FIXED, address) for address in addresses]


SAME = ("g2.toml", "g2.toml")


@pytest.mark.parametrize(
    ("addresses", "paths", "names"),
    [
        (("walk#a", "walk#b"), ("x", "y"), ["a", "b"]),
        (("own/g2.toml", "ch06/red"), ("x", "y"), ["g2", "red"]),
        (("ch04/circle#a", "ch06/walk#a"), ("x", "y"), ["circle#a", "walk#a"]),
        (("ch04/walk#a", "ch06/walk#a"), ("x", "y"), ["ch04/walk#a", "ch06/walk#a"]),
        (SAME, ("f/mod", "f/conv"), ["mod", "conv"]),
        (("walk#a", "walk#b", "walk#a"), ("one", "two", "three"), ["one", "two", "three"]),
        (SAME, ("f/mod/flight.parquet", "f/conv"), ["mod", "conv"]),
        (SAME, ("f/mod.parquet", "f/conv.parquet"), ["mod", "conv"]),
        (SAME, ("old/f/mod", "new/f/mod"), ["old/f/mod", "new/f/mod"]),
        (SAME, ("/mod", "/f/mod"), ["/mod", "f/mod"]),
        (SAME, ("f/mod", "f/\udcff"), ["mod", r"\udcff"]),
        (SAME, ("f/mod", "f/mod"), ["g2_1", "g2_2"]),
        (SAME, (), ["g2_1", "g2_2"]),
        (("walk", "walk", "walk_1"), (), ["walk_1", "walk_2", "walk_1_3"]),
        (("", ""), (), ["flight_1", "flight_2"]),
    ],
)
def test_flights_have_distinct_names(addresses, paths, names):
    assert flight_names(scenarios(*addresses), [Path(path) for path in paths]) == names


def test_a_folder_given_by_dots_has_its_own_name(tmp_path, monkeypatch):
    here = tmp_path / "mod" / "inner"
    here.mkdir(parents=True)
    monkeypatch.chdir(here)
    assert flight_names(scenarios(*SAME), [Path(), Path("..")]) == ["inner", "mod"]


def test_a_title_is_common_where_all_have_it():
    fixed, trot = FIXED | {"title": "Fixed"}, TROT
    assert common_title([tiltsim.parse_scenario(trot)] * 2) == "A trot around a circle"
    assert common_title([tiltsim.parse_scenario(one) for one in (fixed, trot)]) == ""
    assert common_title(scenarios(*SAME)) == ""
    assert common_title(scenarios("ch06/walk#a", "ch06/slow_walk#b")) == ""
    walks = scenarios("ch06/slow_walk#a", "ch06/slow_walk#b")
    assert common_title(walks) == "Slow walk"
    titles = ("A trot that leans, held", "A trot that leans: loses control")
    trots = [tiltsim.parse_scenario(trot | {"title": title}) for title in titles]
    assert common_title(trots) == "A trot that leans"
    assert common_title(scenarios("ch06/walk#a", "ch04/walk#a")) == ""


def test_names_of_changed_scenarios_are_what_was_changed():
    base = tiltsim.load_scenario("ch04_tracking/setpoint#rho_0_modified")
    exact = base.replace({"controller.decoupler": "exact"})

    def hover(observation):
        return tiltsim.Command(thrusts=[1.0] * 4)

    own = tiltsim.load_scenario(base, controller=hover)
    assert flight_names([base, exact, own]) == ["modified", "exact", "hover"]
    heavy = base.replace({"vehicle.mass": 0.5})
    assert flight_names([heavy, heavy.replace({"vehicle.mass": 0.6})]) == ["mass 0.5", "mass 0.6"]
    biased = base.replace({"gait.bias": 0.1})
    assert flight_names([base, biased]) == ["bias 1.0", "bias 0.1"]
    assert flight_names([base, base]) == ["rho_0_modified_1", "rho_0_modified_2"]
