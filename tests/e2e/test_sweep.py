"""Sweeps from the command line: results, figures, mistakes, the shipped definitions."""

from __future__ import annotations

import json

import pyarrow.parquet as pq
import pytest

from tests.sweeps.files import boundary_sweep, short_sweep
from tiltsim.cli import main
from tiltsim.figures.sweep import sweep_figure
from tiltsim.library import library_sweeps, scenario_files, shipped_folder
from tiltsim.sweeps.dataset import load_results
from tiltsim.sweeps.plan import Plan, load_definition

SHIPPED = [address for address, _, _ in library_sweeps()]
GRID = """
title = "A grid"
[scenario.simulation]
duration = 0.02
timestep = 0.002
engine = "python"
[[axis]]
type = "linspace"
key = "initial.attitude[0]"
start = 0.0
stop = 0.4
count = 4
[[axis]]
type = "linspace"
key = "initial.attitude[1]"
start = 0.0
stop = 0.3
count = 3
[[axis]]
type = "list"
key = "controller.decoupler"
values = ["conventional", "modified"]
"""


@pytest.fixture
def grid(tmp_path):
    file = tmp_path / "grid.toml"
    file.write_text(GRID, encoding="utf-8")
    return file


def test_sweep_writes_one_dataset_and_sums_up(grid, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["sweep", str(grid), "--out", str(out), "--jobs", "1"]) == 0
    printed = capsys.readouterr()
    assert "A grid: 24 flights" in printed.err
    assert "24 flights: 24 completed" in printed.out
    table = pq.read_table(out / "sweep.parquet")
    assert table.num_rows == 24
    assert table["index"].to_pylist() == list(range(24))
    assert main(["sweep", str(grid), "--out", str(out), "--jobs", "1", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_the_dataset_goes_to_a_folder_of_its_own_by_default(grid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "grid.toml", "--jobs", "1", "--quiet"]) == 0
    assert (tmp_path / "sweeps" / "grid" / "sweep.parquet").is_file()


def test_set_changes_the_base(grid, tmp_path):
    options = ["--out", str(tmp_path / "out"), "--jobs", "1", "--quiet"]
    assert main(["sweep", str(grid), *options, "--set", "simulation.duration=0.004"]) == 0
    assert set(pq.read_table(tmp_path / "out" / "sweep.parquet")["end_time"].to_pylist()) == {0.004}


def test_a_changed_sweep_is_refused(grid, tmp_path, capsys):
    options = ["--out", str(tmp_path / "out"), "--jobs", "1", "--quiet"]
    assert main(["sweep", str(grid), *options]) == 0
    grid.write_text(GRID.replace("count = 3", "count = 5"), encoding="utf-8")
    assert main(["sweep", str(grid), *options]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "axis[1].count was 3 and is 5" in error


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["no/such"], "no/such: no such file"),
        (["ch04_tracking/setpoint"], "a scenario, not a sweep"),
        (["ch04_tracking/sweeps/periods", "--jobs", "0"], "at least 1"),
        (["ch04_tracking/sweeps/periods", "--set", "gait.perod=1"], "did you mean period"),
        (["ch04_tracking/sweeps/periods", "--set", "gait.period=1"], "an axis sets it, too"),
    ],
)
def test_mistakes_are_one_line_and_exit_2(arguments, words, capsys):
    try:
        code = main(["sweep", *arguments])
    except SystemExit as exit_:
        code = exit_.code
    assert code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert words in error


@pytest.mark.parametrize("address", SHIPPED)
def test_every_shipped_sweep_is_valid(address):
    definition = load_definition(address)
    assert len(Plan(definition)) > 1
    assert definition.sweep["title"]
    assert definition.sweep["source"]


def test_list_shows_sweeps_in_a_section_of_their_own(capsys):
    assert main(["list"]) == 0
    scenarios, _, sweeps = capsys.readouterr().out.partition("\nsweeps, for tiltsim sweep:\n")
    for address in SHIPPED:
        assert address in sweeps
        assert address not in scenarios
    assert main(["list", "--sweeps", "--json"]) == 0
    assert [entry["sweep"] for entry in json.loads(capsys.readouterr().out)] == SHIPPED


def test_check_leaves_sweeps_out():
    files = scenario_files(shipped_folder("scenarios"))
    assert files
    assert not [file for file in files if file.parent.name == "sweeps"]


def test_schema_of_sweeps(capsys):
    assert main(["schema", "--sweep"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert {"scenario", "axis", "sample", "derive", "bisect"} <= set(schema["properties"])
    assert schema["additionalProperties"] is False


# --- figures -------------------------------------------------------------------------------------


def swept(file, out):
    assert main(["sweep", str(file), "--out", str(out), "--jobs", "1", "--quiet"]) == 0
    return out


def test_plot_draws_a_map_of_two_axes(grid, tmp_path, capsys):
    out = swept(grid, tmp_path / "out")
    assert main(["plot", str(out), "--metric", "max_abs_roll"]) == 0
    assert (out / "sweep.png").read_bytes().startswith(b"\x89PNG")
    figure = sweep_figure(load_results(out), ("max_abs_roll",))
    left, right = figure.axes[:2]
    assert (left.get_title(loc="left"), right.get_title(loc="left")) == ("conventional", "modified")
    cells = left.collections[0].get_array()
    assert cells.shape == (3, 4)
    rows = pq.read_table(out / "sweep.parquet").to_pylist()
    wanted = [r["max_abs_roll"] for r in rows if r["controller.decoupler"] == "conventional"]
    assert sorted(cells.ravel().tolist()) == sorted(wanted)
    capsys.readouterr()
    assert main(["plot", str(out), "--metric", "roll"]) == 2
    assert "choose" in capsys.readouterr().err


def test_plot_draws_lines_and_says_what_was_lost(grid, tmp_path):
    text = GRID.replace("stop = 0.4", "stop = 3.1").replace("count = 3", "count = 2")
    grid.write_text(text + '[plot]\nkind = "lines"\nx = "initial.attitude[0]"\n', encoding="utf-8")
    figure = sweep_figure(load_results(swept(grid, tmp_path / "out")), ("max_abs_roll",))
    assert figure.axes[0].get_xlabel() == "initial.attitude[0] (rad)"
    assert len(figure.axes[0].lines) in {4, 5}  # two decouplers, their lost flights, the key


def test_plot_draws_distributions(tmp_path):
    out = swept(short_sweep(tmp_path / "sweep.toml", count=8), tmp_path / "out")
    figure = sweep_figure(load_results(out), ("max_abs_roll", "max_abs_pitch"))
    curve = figure.subfigs[0].axes[0].lines[0]
    assert list(curve.get_ydata()) == [step / 8 for step in range(9)]
    assert list(curve.get_xdata()) == sorted(curve.get_xdata())


def test_plot_draws_boundaries(tmp_path):
    out = swept(boundary_sweep(tmp_path / "sweep.toml"), tmp_path / "out")
    figure = sweep_figure(load_results(out))
    values = [value for line in figure.axes[0].lines for value in line.get_ydata()]
    assert max(values) == pytest.approx(0.2345, abs=0.001)


def test_plot_draws_an_unfinished_sweep(tmp_path):
    out = swept(short_sweep(tmp_path / "sweep.toml"), tmp_path / "out")
    (out / "sweep.parquet").unlink()
    (out / "parts" / "000001.parquet").unlink()
    results = load_results(out)
    assert results.columns["index"].tolist() == [0, 1, 2, 6, 7, 8, 9, 10, 11]
    assert "3 of 12 points still to come" in sweep_figure(results).get_suptitle()
