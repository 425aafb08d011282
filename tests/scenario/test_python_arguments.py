"""Scenarios from Python: addresses, dicts, arrays, changes and controllers."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import tiltsim
from tests.arguments import ADDRESS, hover
from tiltsim.scenario.scenario import Scenario

COARSE = {"simulation.control_timestep": 0.05}
"""Too long for the law of `ADDRESS`."""


def test_an_address_a_path_a_dict_and_a_scenario_give_the_same():
    scenario = tiltsim.load_scenario(ADDRESS)
    tables = scenario.model_dump(exclude_unset=True)
    assert tiltsim.load_scenario(Path(ADDRESS)) == scenario
    assert tiltsim.load_scenario(scenario) == scenario
    assert tiltsim.load_scenario(tables).model_dump() == scenario.model_dump()


def test_a_replaced_value_equals_an_override():
    changes = {"gait.type": "trot_continuous", "gait.amplitude": 0.3, "gait.period": 2.0}
    replaced = tiltsim.load_scenario(ADDRESS).replace(changes)
    assert replaced == tiltsim.load_scenario(ADDRESS, changes)
    assert replaced.address == ADDRESS


def test_a_replaced_value_is_checked():
    with pytest.raises(tiltsim.InputError, match=r"#rho_065_modified: gait\.amplitud = 0\.3"):
        tiltsim.load_scenario(ADDRESS).replace({"gait.amplitud": 0.3})


def test_arrays_numbers_and_paths_of_other_libraries_are_taken():
    own = {"duration": np.float64(2.0), "seed": np.int64(3)}
    place = {"type": "setpoint", "position": np.array([0.0, 0.0, 1.0])}
    scenario = tiltsim.load_scenario(
        {"simulation": own, "reference": place}, {"initial.position": np.ones(3)}
    )
    assert scenario.simulation.seed == 3
    assert scenario.reference.position == (0.0, 0.0, 1.0)
    assert scenario.initial.position == (1.0, 1.0, 1.0)


def test_a_dict_is_not_changed():
    tables = {"initial": {"position": [0.0, 0.0, 0.0]}}
    tiltsim.load_scenario(tables, {"initial.position[2]": 1.0})
    assert tables == {"initial": {"position": [0.0, 0.0, 0.0]}}


def test_overrides_are_not_changed():
    table = {"gait": {"type": "fixed", "angles": [0.0, 0.0, 0.0, 0.0]}}
    file = {"controller": {"law": "python", "function": "own.py:f"}}
    scenario = tiltsim.load_scenario(ADDRESS, {**table, "gait.angles[0]": 0.2})
    assert scenario.gait.angles[0] == 0.2
    scenario.replace(file)
    assert table == {"gait": {"type": "fixed", "angles": [0.0, 0.0, 0.0, 0.0]}}
    assert file["controller"] == {"law": "python", "function": "own.py:f"}


def test_an_entry_of_an_array_that_is_given_with_it_can_be_overridden():
    changes = {"gait.type": "fixed", "gait.angles": np.zeros(4), "gait.angles[0]": 0.1}
    assert tiltsim.load_scenario(ADDRESS, changes).gait.angles == (0.1, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "overrides",
    [
        {"controller.law": "full_pose"},
        {"controller": {"law": "full_pose"}},
        {"controller.function": "x.py:y"},
    ],
)
def test_a_controller_and_overrides_of_another_contradict(overrides):
    with pytest.raises(tiltsim.InputError, match=r"contradicts the given controller .*hover"):
        tiltsim.load_scenario(ADDRESS, overrides, controller=hover)


def test_a_controller_replaces_the_shipped_one_before_anything_is_checked():
    with pytest.raises(tiltsim.InputError, match="control_timestep"):
        tiltsim.load_scenario(ADDRESS, COARSE)
    scenario = tiltsim.load_scenario(ADDRESS, COARSE, controller=hover)
    assert scenario.controller.law == "python"
    assert scenario.own_controller is hover


def test_a_controller_stays_with_its_scenario_until_another_replaces_it():
    scenario = tiltsim.load_scenario(ADDRESS, controller=hover)
    assert scenario.replace({"simulation.duration": 1.0}).own_controller is hover
    assert scenario.replace({"controller.law": "full_pose"}).own_controller is None
    assert scenario.model_copy(update={"title": "other"}).own_controller is hover


def test_a_scenario_pickles_without_its_controller():
    scenario = tiltsim.load_scenario(ADDRESS, controller=lambda observation: hover(observation))
    copy = pickle.loads(pickle.dumps(scenario))
    assert copy.own_controller is None
    assert copy.model_dump() == scenario.model_dump()
    assert copy.address == ADDRESS


def test_the_table_for_notebooks_shows_what_was_given_and_no_tags():
    table = tiltsim.load_scenario(ADDRESS).replace({"title": "<b>bold"})._repr_html_()
    assert "controller.decoupler" in table
    assert "allow_unstable" not in table
    assert "&lt;b&gt;bold" in table
    assert "<b>bold" not in table


def test_a_scenario_in_itself_is_too_deep():
    tables: dict[str, object] = {}
    tables["vehicle"] = tables
    with pytest.raises(tiltsim.InputError, match="nest"):
        tiltsim.load_scenario(tables)


def test_a_scenario_prints_in_a_line_and_completes_to_what_is_of_use():
    scenario = tiltsim.load_scenario(ADDRESS)
    assert str(scenario) == repr(scenario)
    names = dir(scenario)
    assert {"replace", "gait", "model_copy", "own_controller"} <= {*names}
    assert not {"parse_raw", "dict", "json", "copy", "model_fields_set"} & {*names}


def test_the_type_of_a_scenario_is_public():
    assert tiltsim.Scenario is Scenario
