"""A sweep in one call from Python."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

import tiltsim

SWEEP = {
    "title": "Two masses",
    "scenario": {"simulation": {"duration": 0.02}},
    "metrics": ["max_rotor_speed"],
    "axis": [{"type": "list", "key": "vehicle.mass", "values": np.array([0.4, 0.45])}],
}


@pytest.fixture(scope="module")
def results():
    finished = []
    base = tiltsim.load_scenario(SWEEP["scenario"])
    results = tiltsim.sweep({**SWEEP, "scenario": base}, progress=finished.append)
    assert finished[-1] == 2
    return results


def test_the_rows_are_the_flights(results):
    table = results.to_arrow()
    assert table["vehicle.mass"].to_pylist() == [0.4, 0.45]
    flights = [
        tiltsim.simulate({**SWEEP["scenario"], "vehicle": {"mass": mass}}) for mass in (0.4, 0.45)
    ]
    expected = [flight.metrics()["max_rotor_speed"] for flight in flights]
    assert table["max_rotor_speed"].to_pylist() == expected


def test_a_row_flies_again(results):
    scenario = tiltsim.load_scenario(json.loads(results["scenario"][1]))
    assert scenario.vehicle.mass == 0.45
    assert tiltsim.simulate(scenario).metrics()["max_rotor_speed"] == results["max_rotor_speed"][1]


def test_the_rows_as_a_data_frame(results):
    pandas = pytest.importorskip("pandas")
    frame = results.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame["end"].tolist() == ["completed", "completed"]


def test_without_pandas_the_message_says_what_to_install(results, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(tiltsim.TiltsimError, match="pip install pandas"):
        results.to_pandas()


def test_results_show_themselves(results):
    assert repr(results).startswith("<SweepResults of Two masses: 2 rows of")
    assert "2 completed" in repr(results)
    assert "vehicle.mass" in results._repr_html_()


def test_values_of_a_number_are_refused(results):
    with pytest.raises(tiltsim.InputError, match="expression = 3: must be a column"):
        results.values(3)


def test_a_folder_keeps_the_rows_and_continues(tmp_path):
    first = tiltsim.sweep(SWEEP, out=tmp_path / "sweep")
    again = tiltsim.sweep(SWEEP, out=str(tmp_path / "sweep"))
    assert first.to_arrow().equals(again.to_arrow())


def test_a_controller_of_a_notebook_is_refused_with_a_way_out():
    base = tiltsim.load_scenario(SWEEP["scenario"], controller=lambda observation: None)
    with pytest.raises(tiltsim.TiltsimError, match=r"given in Python.*use tiltsim\.fly"):
        tiltsim.sweep({**SWEEP, "scenario": base})
