"""Sweeps from the command line: results, figures, mistakes, the shipped definitions."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest

import tiltsim
from tests.sweeps.files import boundary_sweep, short_sweep
from tiltsim.cli import main
from tiltsim.resources import shipped_folder
from tiltsim.scenario.library import library_sweeps, scenario_files
from tiltsim.sweeps.dataset import load_results
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.points import SweepPoints
from tiltsim.views.figures.distributions import wilson_interval
from tiltsim.views.figures.sweep import sweep_figure

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
count = 3
[[axis]]
type = "linspace"
key = "initial.attitude[1]"
start = 0.0
stop = 0.3
count = 2
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


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("grid")
    (folder / "grid.toml").write_text(GRID, encoding="utf-8")
    swept(folder / "grid.toml", folder / "out")
    return folder


@pytest.fixture
def finished(flown, tmp_path):
    """A copy of the folder with the grid and, in ``out``, its results."""
    return shutil.copytree(flown, tmp_path / "finished")


def test_sweep_writes_one_dataset_and_prints_a_summary(grid, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["sweep", str(grid), "--out", str(out), "--jobs", "1"]) == 0
    printed = capsys.readouterr()
    assert "A grid: 12 flights" in printed.err
    assert "12 flights: 12 completed" in printed.out
    table = pq.read_table(out / "sweep.parquet")
    assert table.num_rows == 12
    assert table["index"].to_pylist() == list(range(12))
    assert main(["sweep", str(grid), "--out", str(out), "--jobs", "1", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_a_continued_sweep_prints_how_much_is_finished(finished, capsys):
    out = finished / "out"
    command = ["sweep", str(finished / "grid.toml"), "--out", str(out), "--jobs", "1"]
    assert main(command) == 0
    assert capsys.readouterr().err == "A grid: all 12 flights finished, nothing to fly\n"
    for number in (3, 7):
        (out / "parts" / f"{number:06d}.parquet").unlink()
    assert main(command) == 0
    assert capsys.readouterr().err == "A grid: 10 of 12 flights finished, 2 to fly\n"


def test_the_dataset_has_its_own_folder_by_default(grid, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "grid.toml", "--jobs", "1", "--quiet"]) == 0
    assert (tmp_path / "sweeps" / "grid" / "sweep.parquet").is_file()


def test_set_changes_the_base(grid, tmp_path):
    options = ["--out", str(tmp_path / "out"), "--jobs", "1", "--quiet"]
    assert main(["sweep", str(grid), *options, "--set", "simulation.duration=0.004"]) == 0
    assert set(pq.read_table(tmp_path / "out" / "sweep.parquet")["end_time"].to_pylist()) == {0.004}


def test_a_changed_sweep_is_refused(finished, capsys):
    options = ["--out", str(finished / "out"), "--jobs", "1", "--quiet"]
    grid = finished / "grid.toml"
    grid.write_text(GRID.replace("count = 2", "count = 5"), encoding="utf-8")
    assert main(["sweep", str(grid), *options]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "axis[1].count was 2 and is 5" in error


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["no/such"], "no/such: no such file"),
        (["ch04_tracking/setpoint"], "a scenario, not a sweep"),
        (["ch04_tracking/sweeps/periods", "--jobs", "0"], "at least 1"),
        (["ch04_tracking/sweeps/periods", "--set", "gait.perod=1"], "did you mean period"),
        (["ch04_tracking/sweeps/periods", "--set", "gait.period=1"], "also set by an axis"),
        (["ch04_tracking/sweeps/perods"], "did you mean ch04_tracking/sweeps/periods?"),
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
    definition = load_sweep(address)
    assert len(SweepPoints(definition)) > 1
    assert definition.sweep["title"]
    assert definition.sweep["source"]


def test_list_shows_sweeps_in_their_own_section(capsys):
    assert main(["list"]) == 0
    scenarios, _, sweeps = capsys.readouterr().out.partition("\nsweeps, for tiltsim sweep:\n")
    for address in SHIPPED:
        assert address in sweeps
        assert address not in scenarios
    assert main(["list", "--sweeps", "--json"]) == 0
    assert [entry["sweep"] for entry in json.loads(capsys.readouterr().out)] == SHIPPED


def test_check_skips_sweeps():
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


def test_plot_draws_a_map_of_two_axes(finished, capsys):
    out = finished / "out"
    assert main(["plot", str(out), "--metric", "max_abs_roll"]) == 0
    assert (out / "sweep.png").read_bytes().startswith(b"\x89PNG")
    figure = sweep_figure(load_results(out), ("max_abs_roll",))
    left, right = figure.axes[:2]
    assert (left.get_title(loc="left"), right.get_title(loc="left")) == ("conventional", "modified")
    cells = left.images[0].get_array()
    assert cells.shape == (2, 3)
    rows = pq.read_table(out / "sweep.parquet").to_pylist()
    expected = [r["max_abs_roll"] for r in rows if r["controller.decoupler"] == "conventional"]
    assert sorted(cells.ravel().tolist()) == sorted(expected)
    capsys.readouterr()
    assert main(["plot", str(out), "--metric", "roll"]) == 2
    assert "choose" in capsys.readouterr().err


def test_plot_draws_lines_and_counts_lost_flights(grid, tmp_path):
    text = GRID.replace("stop = 0.4", "stop = 3.1")
    grid.write_text(
        text + '[plot]\nkind = "lines"\nx = "initial.attitude[0]"\nlog = ["y"]\n', encoding="utf-8"
    )
    figure = sweep_figure(load_results(swept(grid, tmp_path / "out")), ("max_abs_roll",))
    assert figure.axes[0].get_xlabel() == "initial attitude roll (rad)"
    assert (figure.axes[0].get_xscale(), figure.axes[0].get_yscale()) == ("linear", "log")
    assert len(figure.axes[0].lines) in {4, 5}  # two decouplers, their lost flights, the key


def test_lost_flights_lie_below_the_lines_in_the_order_of_the_legend(grid, tmp_path):
    text = GRID.replace("stop = 0.4", "stop = 3.1")
    plot = '[plot]\nkind = "lines"\nx = "initial.attitude[0]"\nlines = "controller.decoupler"\n'
    grid.write_text(text + plot, encoding="utf-8")
    results = load_results(swept(grid, tmp_path / "out"))
    for name in ("max_abs_roll", "max_abs_pitch"):  # as if half of them had been lost
        results.columns[name][results.columns["initial.attitude[0]"] > 1.5] = np.nan
    results.columns["end"][results.columns["initial.attitude[0]"] > 1.5] = "diverged"
    axes = sweep_figure(results, ("max_abs_roll",)).axes[0]
    named = [line for line in axes.lines if not line.get_label().startswith("_")]
    assert [line.get_label() for line in named] == [
        *("conventional", "modified", "terminated early, in this order")
    ]
    rows = [line for line in axes.lines if line.get_marker() == "x" and len(line.get_xdata())]
    first, second = (line.get_ydata()[0] for line in rows)
    assert first > second
    low, high = axes.get_ylim()
    least = min(np.nanmin(line.get_ydata()) for line in named[:2])
    assert (least - low) / (high - low) > first


def test_plot_draws_distributions(tmp_path):
    out = swept(short_sweep(tmp_path / "sweep.toml", count=8), tmp_path / "out")
    figure = sweep_figure(load_results(out), ("max_abs_roll", "max_abs_pitch"))
    curve = figure.subfigs[0].axes[1].lines[0]
    assert list(curve.get_ydata()) == [step / 8 for step in range(1, 9)]
    assert list(curve.get_xdata()) == sorted(curve.get_xdata())


def test_lost_flights_are_the_worst_of_a_distribution(tmp_path):
    """Upside down nobody flies: errors end below all flights, margins begin above none."""
    file = short_sweep(tmp_path / "sweep.toml", count=10)
    text = file.read_text(encoding="utf-8").replace("deviation = 0.1", "deviation = 1.0")
    file.write_text(text.replace("duration = 0.01", "duration = 0.5"), encoding="utf-8")
    results = load_results(swept(file, tmp_path / "out"))
    metrics = ("max_abs_pitch", "min_singularity_margin")
    figure = sweep_figure(results, metrics)
    shares, errors, margins = figure.subfigs[0].axes
    completed = results.columns["end"] == "completed"
    kept = results.columns["controller.decoupler"] == "conventional"
    share = completed[kept].mean()
    assert 0.2 < share < 0.9
    assert shares.patches[0].get_width() == pytest.approx(share)
    assert errors.lines[0].get_ydata()[-1] == pytest.approx(share)
    assert margins.lines[0].get_ydata()[0] == pytest.approx(1.0 - share + 1.0 / 10.0)
    assert margins.lines[0].get_ydata()[-1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # Newcombe, "Two-sided confidence intervals for the single proportion", 1998, Table I.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611)],
)
def test_intervals_of_shares_are_wilsons(successes, trials, low, high):
    assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=1e-4)


LAYERS = """
metrics = ["max_abs_roll", "min_rotor_speed"]
[scenario.simulation]
duration = 0.3
timestep = 0.004
[scenario.controller]
decoupling = "exact"
decoupler = "exact"
gains = "exact"
[scenario.initial]
rotor_speed = 361.0
[scenario.air]
drag = { linear = [0.2, 0.2, 0.1] }
[derive]
air.wind = ["wind", 0, 0]
[[axis]]
type = "list"
key = "wind"
values = [0.0, 5.0]
[[axis]]
type = "list"
key = "sensors.attitude_noise"
values = [0.0, 0.02]
[[axis]]
type = "list"
key = "vehicle.mass"
values = [0.4, 0.5]
[[axis]]
type = "seed"
key = "simulation.seed"
[sample]
count = 2
"""


def test_groups_of_a_distribution_differ_without_color(tmp_path):
    out = swept(short_sweep(tmp_path / "sweep.toml", count=8), tmp_path / "out")
    figure = sweep_figure(load_results(out), ("max_abs_roll",))
    shares, curves = figure.subfigs[0].axes
    assert len({bar.get_hatch() for bar in shares.patches}) == 2
    drawn = [line for line in curves.lines if line.get_linestyle() != "None"]
    assert len(drawn) == len({str(line._unscaled_dash_pattern) for line in drawn}) == 2
    assert len({line.get_marker() for line in curves.lines} - {"None"}) == 2
    dots = figure.subfigs[1].axes[0].lines
    assert len({line.get_marker() for line in dots} - {"x"}) == 2


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("", '[plot]\nkind = "map"', "needs two numeric axes, or x and y"),
        ('title = "short flights"', "metrics = []", "the sweep has no metric to plot"),
        (
            "",
            '[plot]\nx = "initial.atitude[0]"\nkind = "lines"',
            "did you mean initial.attitude[0]?",
        ),
    ],
)
def test_figures_that_cannot_be_drawn_are_refused_in_one_line(tmp_path, capsys, old, new, words):
    file = short_sweep(tmp_path / "sweep.toml", count=1)
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace(old, new) if old else text + new, encoding="utf-8")
    assert main(["plot", str(swept(file, tmp_path / "out"))]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert words in error


def test_user_text_is_not_a_formula(tmp_path):
    file = short_sweep(tmp_path / "sweep.toml", count=1)
    text = file.read_text(encoding="utf-8").partition("[[axis]]")[0].replace("flights", "$x_$ ü")
    cases = '[[axis]]\ntype = "cases"\nkey = "price"\n'
    for number, name in enumerate(("5 $", "$y_$")):
        cases += f'[axis.cases."{name}"]\ninitial.attitude = [{number}.1, 0, 0]\n'
    file.write_text(text + cases + '[plot]\npanels = "price"\n', encoding="utf-8")
    figure = sweep_figure(load_results(swept(file, tmp_path / "out")))
    assert figure.texts[0].get_text() == r"short \$x_\$ ü"
    assert [axes.get_title(loc="left") for axes in figure.axes[:2]] == [r"5 \$", r"\$y_\$"]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["python", "native"])
def test_axes_of_layers_fly_as_their_rows_say(tmp_path, engine):
    """Wind, noise, mass and seed: in batches as alone, the layers coming and going by row."""
    file = tmp_path / "sweep.toml"
    file.write_text(LAYERS, encoding="utf-8")
    out = tmp_path / "out"
    options = ["--jobs", "1", "--quiet", "--set", f"simulation.engine={engine}"]
    assert main(["sweep", str(file), "--out", str(out), *options]) == 0
    rows = pq.read_table(out / "sweep.parquet").to_pylist()
    assert len(rows) == 16
    assert {row["end"] for row in rows} == {"completed"}
    for row in rows:
        alone = tiltsim.simulate(tiltsim.parse_scenario(json.loads(row["scenario"]))).metrics()
        assert {name: row[name] for name in ("max_abs_roll", "min_rotor_speed")} == {
            name: alone[name] for name in ("max_abs_roll", "min_rotor_speed")
        }
    found = [(row["max_abs_roll"], row["min_rotor_speed"]) for row in rows]
    # Without noise the seed makes no difference, and everything else does.
    assert len(set(found)) == 12


def test_a_user_controller_can_be_a_case_beside_built_in_controllers(tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(
        "import numpy as np\nimport tiltsim\n\n\n"
        "def law(observation):\n    return tiltsim.Command(thrusts=np.full(4, 1.2))\n",
        encoding="utf-8",
    )
    (tmp_path / "sweep.toml").write_text(
        """
[scenario.simulation]
duration = 0.1
timestep = 0.002
[[axis]]
type = "uniform"
key = "model_error.mass"
low = 0.9
high = 1.1
[[axis]]
type = "cases"
key = "law"
[axis.cases.mine]
controller = { law = "python", function = "mine.py:law" }
[axis.cases.exact]
controller = { decoupling = "exact", decoupler = "exact", gains = "exact" }
[sample]
count = 2
""",
        encoding="utf-8",
    )
    monkeypatch.setenv("TILTSIM_TRUST", "1")
    rows = pq.read_table(swept(tmp_path / "sweep.toml", tmp_path / "out") / "sweep.parquet")
    assert rows["law"].to_pylist() == ["mine", "mine", "exact", "exact"]
    assert set(rows["end"].to_pylist()) == {"completed"}
    laws = [json.loads(text)["controller"]["law"] for text in rows["scenario"].to_pylist()]
    assert laws == ["python", "python", "attitude_altitude", "attitude_altitude"]
    masses = rows["model_error.mass"].to_pylist()
    assert masses[:2] == masses[2:]


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
    assert sweep_figure(results).texts[1].get_text() == "3 of 12 points missing"
