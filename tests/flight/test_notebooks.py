"""A flight in a notebook: vectors, tables, resolved files of custom controllers."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import tiltsim
from tests.arguments import ADDRESS, hover
from tests.flights import TILT_CAR
from tiltsim.flight.flight import VECTORS
from tiltsim.vehicles.rotorcraft import COLUMNS

SHORT = {"simulation.duration": 0.02, "simulation.engine": "python"}


@pytest.fixture(scope="module")
def flight():
    return tiltsim.simulate(tiltsim.load_scenario(ADDRESS, SHORT))


@pytest.fixture(scope="module")
def own_flight():
    return tiltsim.simulate({"simulation": {"duration": 0.02}}, controller=hover)


def test_vectors_are_columns_side_by_side(flight):
    for name, all_columns in VECTORS.items():
        columns = [column for column in all_columns if column in COLUMNS]
        assert flight[name].shape == (len(flight), len(columns))
        np.testing.assert_array_equal(flight[name][:, -1], flight[columns[-1]])
    assert flight["thrusts"].shape[1] == flight["tilt_angles"].shape[1] == 4
    assert "position" in flight
    assert "positions" not in flight
    assert 3 not in flight
    assert [*flight] == [*flight.units]


def test_a_tilt_car_has_the_vectors_of_its_plane():
    flight = tiltsim.simulate(tiltsim.load_scenario(TILT_CAR, SHORT))
    assert flight["position"].shape == (len(flight), 2)
    assert flight["rotor_speeds"].shape == (len(flight), 2)
    with pytest.raises(tiltsim.InputError, match="no column of this flight"):
        _ = flight["tilt_angles"]


@pytest.mark.parametrize("name", ["positon", 0, ["x", "y"], None])
def test_an_unknown_column_is_answered_with_the_columns(flight, name):
    with pytest.raises(KeyError) as caught:
        _ = flight[name]
    assert isinstance(caught.value, tiltsim.TiltsimError)
    assert "no column of this flight" in str(caught.value)
    if name == "positon":
        assert "did you mean position?" in str(caught.value)


def test_a_data_frame_has_columns_and_units(flight):
    pytest.importorskip("pandas")
    frame = flight.to_pandas()
    assert list(frame.columns) == list(flight.units)
    assert frame.attrs["units"]["x"] == "m"
    np.testing.assert_array_equal(frame["z"], flight["z"])


def test_without_pandas_the_message_says_what_to_install(flight, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(tiltsim.TiltsimError, match="pip install pandas"):
        flight.to_pandas()


def test_the_table_for_notebooks_has_the_end_and_the_metrics(flight):
    table = flight._repr_html_()
    assert "completed at 0.02 s" in table
    assert "max_rotor_speed" in table
    assert "rad/s" in table


def test_the_files_of_a_controller_from_python_say_how_to_fly_it_again(own_flight, tmp_path):
    own_flight.save(tmp_path)
    resolved = tmp_path / "scenario.toml"
    assert f"{hover.__module__}.hover, was given in Python" in resolved.read_text()
    with pytest.raises(tiltsim.InputError, match="give it again as controller="):
        tiltsim.simulate(resolved)
    again = tiltsim.simulate(resolved, controller=hover)
    np.testing.assert_array_equal(again.samples, own_flight.samples)
    own_flight.save(tmp_path)  # tiltsim replaces its own files
    loaded = tiltsim.load_flight(tmp_path)
    np.testing.assert_array_equal(loaded.samples, own_flight.samples)


def test_a_failing_controller_of_a_cell_is_named_by_function_and_line():
    names = {}
    exec(compile("def law(observation):\n    return observation.positon", "cell", "exec"), names)
    with pytest.warns(RuntimeWarning, match="line 2 of law"):
        failed = tiltsim.simulate({"simulation": {"duration": 0.02}}, controller=names["law"])
    assert failed.end.cause.endswith("no attribute 'positon' (line 2 of law)")
    assert "failed at 0 s (the controller" in repr(failed)
