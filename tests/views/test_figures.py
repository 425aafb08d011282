"""The figure of a flight: its content, its formats, its command."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import matplotlib
import numpy as np
import pytest

import tiltsim
from tests.flights import BASE, RECIPES, SAMPLE_FIELDS, flight, saved
from tiltsim.cli import main
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import assemble
from tiltsim.views.figures import style
from tiltsim.views.figures.plot import plot

SIGNATURES = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
PANELS = {"Attitude", "Altitude", "Position error", "Tilt angles", "Rotor speeds", "Plan view"}
PANELS |= {"Singularity margin", "Attitudes flown"}


def legend_of(figure):
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts()]


def heading(figure):
    return figure.texts[0].get_text()


def axes_by_title(figure):
    return {axes.get_title(loc="left"): axes for axes in figure.axes}


@cache
def page(name):
    """The figure of a flight by its name in `RECIPES`, drawn once; do not change it."""
    return plot(flight(name))


# "jumps" is drawn by the comparisons below.
@pytest.mark.parametrize("name", [name for name in RECIPES if name != "jumps"])
def test_every_flight_can_be_drawn(name):
    figure = page(name)
    assert {title.partition(",")[0] for title in axes_by_title(figure)} == PANELS


def test_the_lines_are_the_flights_columns():
    this = flight("trot")
    panels = axes_by_title(page("trot"))
    roll = panels["Attitude"].lines[0]
    np.testing.assert_array_equal(roll.get_xdata(), this["time"])
    np.testing.assert_array_equal(roll.get_ydata(), this["roll"])
    speed = panels["Rotor speeds"].lines[0]
    np.testing.assert_array_equal(speed.get_ydata(), -this["rotor_speed_1"])
    path = next(line for line in panels["Plan view"].lines if line.get_label() == "path")
    np.testing.assert_array_equal(path.get_xdata(), this["x"])
    error = panels["Position error"].lines[1]
    np.testing.assert_array_equal(error.get_ydata(), this["x_ref"] - this["x"])


def test_axes_say_their_units():
    for axes in page("fixed").axes:
        assert any(unit in axes.get_ylabel() for unit in ("rad", "m")), axes.get_title(loc="left")


@pytest.mark.parametrize("panel", ["Attitude", "Position error"])
def test_lines_of_a_panel_differ_without_color(panel):
    lines = axes_by_title(page("trot"))[panel].lines
    named = [line for line in lines if line.get_label() in {"roll", "pitch", "yaw", *"xyz"}]
    assert len({str(line._dash_pattern) for line in named}) == 3


@pytest.mark.parametrize(("period", "shown"), [(0.5, 1.2), (0.05, 0.2)])
def test_of_many_periods_only_the_last_are_shown(period, shown):
    this = flight("trot")
    gait = this.scenario.gait.model_copy(update={"period": period})
    this = replace(this, assembly=assemble(this.scenario.model_copy(update={"gait": gait})))
    names = ["attitude", "tilt_angles", "rotor_speeds", "altitude"]
    panels = axes_by_title(plot(this, panels=names))
    end = this["time"][-1]
    limits = [
        panels[name].get_xlim() for name in ("Attitude", "Tilt angles", "Rotor speeds", "Altitude")
    ]
    assert limits[:3] == [pytest.approx((end - shown, end))] * 3, "one column, one axis of time"
    assert limits[3] == pytest.approx((0.0, end))


def test_rotor_limits_are_drawn_where_there_are_some():
    limited = axes_by_title(page("limited"))["Rotor speeds"]
    free = axes_by_title(page("fixed"))["Rotor speeds"]
    levels = {line.get_ydata()[0] for line in limited.lines if len(set(line.get_ydata())) == 1}
    assert {150.0, 390.0} <= levels
    assert len(limited.lines) == len(free.lines) + 2


def test_the_closest_approach_is_marked():
    this = flight("trot")
    plane = axes_by_title(page("trot"))["Attitudes flown"]
    closest = int(np.argmin(np.abs(this["singularity_margin"])))
    dots = [line.get_xydata()[0] for line in plane.lines if len(line.get_xdata()) == 1]
    np.testing.assert_allclose(dots, [[this["roll"][closest], this["pitch"][closest]]])
    words = plane.get_legend_handles_labels()[1]
    assert f"minimum margin, at {this['time'][closest]:.2f} s" in words
    assert {"singular", "unreachable"} <= set(words)


@pytest.mark.slow
@pytest.mark.parametrize("ending", SIGNATURES)
def test_the_command_writes_the_format_of_the_ending(ending, tmp_path, capsys):
    folder = saved("fixed", tmp_path)
    file = tmp_path / f"figure.{ending}"
    assert main(["plot", str(folder), "--out", str(file)]) == 0
    assert file.read_bytes().startswith(SIGNATURES[ending])
    assert capsys.readouterr().out == f"figure written to {file}\n"


@pytest.mark.parametrize("path", ["", "flight.parquet"])
def test_the_figure_lies_beside_the_flight_by_default(path, tmp_path):
    folder = saved("fixed", tmp_path)
    assert main(["plot", str(folder / path), "--panels", "margin"]) == 0
    assert (folder / "flight.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("out", "words"), [("x.gif", "unknown format '.gif'; choose"), ("no/x.png", "does not exist")]
)
def test_a_bad_target_is_one_line_and_exit_code_2(out, words, tmp_path, capsys):
    folder = saved("fixed", tmp_path)
    assert main(["plot", str(folder), "--out", str(tmp_path / out)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


def test_a_diverged_flight_is_scaled_by_the_time_before_its_divergence():
    whole = flight("fixed")
    samples = whole.samples.copy()
    columns = [i for i, name in enumerate(SAMPLE_FIELDS) if name.startswith("rotor_speed")]
    samples[-1, columns] *= 1e6
    ends = {
        "completed": End("completed", 1.2),
        "diverged": End("diverged", 1.2, "rotor 1 at 3e+08 rad/s"),
    }
    spans = {}
    for kind, end in ends.items():
        lost = replace(whole, samples=samples, end=end)
        panels = axes_by_title(plot(lost, panels="rotor_speeds"))
        low, high = panels["Rotor speeds"].get_ylim()
        spans[kind] = high - low
        words = [text.get_text() for text in panels["Rotor speeds"].texts]
        assert words == (["ends off scale"] if kind == "diverged" else [])
    assert spans["completed"] > 1e8
    assert spans["diverged"] < 1e3


def test_a_flight_of_one_sample_is_drawn_without_a_trace(recwarn):
    """Neither a warning nor another parameter of matplotlib."""
    whole, before = flight("fixed"), dict(matplotlib.rcParams)
    plot(replace(whole, samples=whole.samples[:1].copy()))
    assert not recwarn.list
    assert dict(matplotlib.rcParams) == before


def test_all_attitudes_of_a_red_gait_are_reachable():
    red = BASE | {"gait": {"type": "fixed", "angles": [-0.3, 0.3, -0.3, 0.3]}}
    this = tiltsim.simulate(tiltsim.parse_scenario(red))
    panels = axes_by_title(plot(this, panels="attitude_plane"))
    plane = panels["Attitudes flown"]
    assert "unreachable" not in plane.get_legend_handles_labels()[1]
    assert [len(line.get_xdata()) > 1 for line in plane.lines].count(True) == 1, "the attitudes"


# --- supervised flights, and several on one page -------------------------------------------------


def supervised():
    return flight("supervised")


def test_the_margin_shows_its_threshold_and_when_the_supervisor_is_active():
    this = supervised()
    assert 0.0 < this["supervision"].max() <= 1.0
    panels = axes_by_title(page("supervised"))
    words = panels["Singularity margin"].get_legend_handles_labels()[1]
    assert {"below 0.9", "supervisor active"} <= set(words)
    plain = axes_by_title(page("trot"))["Singularity margin"]
    assert plain.get_legend_handles_labels()[1][0] == "below 0.2"


def test_flights_are_compared_by_margin_determinant_and_error():
    flights = [flight("jumps"), supervised()]
    figure = plot(flights)
    panels = {axes.get_ylabel().replace("\n", " "): axes for axes in figure.axes}
    columns = {
        "singularity margin (rad)": "singularity_margin",
        "determinant n · r₃": "determinant",
        "supervisor (0 to 1)": "supervision",
    }
    others = {"position error (m)", "roll (rad)", "pitch (rad)", "yaw (rad)", "y (m)"}
    assert set(panels) == {*columns, *others}
    for label, column in columns.items():
        axes = panels[label]
        drawn = [line.get_ydata() for line in axes.lines if len(line.get_ydata()) > 2]
        columns = [this.columns[column] for this in flights if column in this.columns]
        for line, expected in zip(drawn, columns, strict=True):
            np.testing.assert_array_equal(line, np.maximum(expected, 0.0))
    assert heading(figure) == "2 flights compared"
    names = ["jumps", "supervised", "margin below 0.9 rad", "determinant below 0.5"]
    assert legend_of(figure) == [*names, "reference", "start", "end"]


def test_a_comparison_says_where_a_flight_terminated():
    lost = replace(flight("jumps"), end=End("singular", 0.7, "why"))
    words = legend_of(plot([lost, supervised()]))
    assert words[0] == "jumps, singular at 0.70 s"
    assert "terminated early" in words


def test_the_command_compares_several_flights(tmp_path, capsys):
    folders = [str(saved(name, tmp_path)) for name in ("jumps", "supervised")]
    file = tmp_path / "both.svg"
    assert main(["plot", *folders, "--out", str(file)]) == 0
    assert "supervised" in file.read_text(encoding="utf-8")
    assert capsys.readouterr().out == f"figure written to {file}\n"


def test_flights_of_one_scenario_are_compared_by_their_folders(tmp_path, monkeypatch):
    folders = [tmp_path / "mod", tmp_path / "con$v"]
    for folder in folders:
        flight("trot").save(folder)
    shown = []
    monkeypatch.setattr(style, "save", lambda figure, _path: shown.append(figure))
    assert main(["plot", *map(str, folders), "--out", str(tmp_path / "both.png")]) == 0
    (figure,) = shown
    assert legend_of(figure)[:2] == ["mod", r"con\$v"]
    assert heading(figure) == "A trot around a circle"


def test_the_page_of_a_variant_names_it():
    def subtitle(address):
        scenario = tiltsim.parse_scenario(BASE | RECIPES["trot"], address)
        named = replace(flight("trot"), assembly=assemble(scenario))
        page = plot(named, panels="altitude", size="220mm x 80mm")
        title, line = (text.get_text() for text in page.texts)
        assert title == "A trot around a circle"
        return line

    plain = subtitle("ch04/circle")
    assert subtitle("ch04/circle#modified_t2") == f"modified_t2  ·  {plain}"


def test_vehicles_of_several_kinds_are_compared_by_available_panels():
    figure = plot([flight("tilt_car"), flight("jumps")])
    panels = {axes.get_ylabel().replace("\n", " "): axes for axes in figure.axes}
    lines = {
        label: sum(len(line.get_xdata()) > 2 for line in axes.lines)
        for label, axes in panels.items()
        if label in {"position error (m)", "singularity margin (rad)"}
    }
    assert lines == {"position error (m)": 2, "singularity margin (rad)": 1}


def test_text_in_any_script_is_drawn_without_a_warning(tmp_path):
    figure = plot(flight("fixed"), panels="altitude", title="四旋翼 🚁")  # any warning is an error
    style.save(figure, tmp_path / "figure.png")
    figure.savefig(tmp_path / "own.png")
    assert (tmp_path / "own.png").is_file()


@pytest.mark.parametrize("title", ["a" * 100_000, "a b\n" * 25_000, "$" * 100_000])
def test_a_title_of_any_length_is_drawn_as_far_as_there_is_room(title, tmp_path):
    scenario = flight("fixed").scenario.model_copy(update={"title": title})
    figure = plot(replace(flight("fixed"), assembly=assemble(scenario)), panels="altitude")
    assert heading(figure).replace("\n", "").endswith("...")
    assert len(heading(figure)) < 700
    style.save(figure, tmp_path / "figure.png")


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("fixed", (1e308, -1e308)),
        ("tilt_car", (1e308, 1e308)),
        pytest.param("fixed", (1e200, -1e200), marks=pytest.mark.slow),
    ],
)
def test_values_near_overflow_are_drawn(name, values, tmp_path):
    whole = flight(name)
    samples = whole.samples.copy()
    samples[-2:, 1:] = np.reshape(values, (2, 1))
    torn = replace(whole, samples=samples)
    for shown in ([torn], [torn, whole]):
        figure = plot(shown, labels=["torn", "whole"][: len(shown)])
        with matplotlib.rc_context({"savefig.dpi": 40}):
            style.save(figure, tmp_path / "figure.png")


def test_a_quadrotor_has_no_panel_of_tilt_angles():
    tables = {"vehicle": {"model": "quadrotor"}, "controller": {"law": "pid"}}
    tables["simulation"] = {**BASE["simulation"], "duration": 0.1}
    assert {*axes_by_title(plot(tiltsim.simulate(tables)))} == PANELS - {"Tilt angles"}


# --- many flights ------------------------------------------------------------------------------


def test_many_flights_are_quantiles_of_the_flights_that_still_fly():
    """The roll of flight i is i; the last flight ends halfway."""
    whole = flight("fixed")
    roll = whole.assembly.loop.sample_fields.index("roll")
    flights = []
    for value in range(21):
        samples = whole.samples.copy()
        samples[:, roll] = 0.01 * value
        flights.append(replace(whole, samples=samples))
    half = len(whole) // 2
    flights[20] = replace(flights[20], samples=samples[:half].copy(), end=End("diverged", 1.0, ""))
    figure = plot(flights, panels=["roll", "path"])
    (axes,) = (axes for axes in figure.axes if "roll" in axes.get_ylabel())
    median = next(line for line in axes.lines if line.get_label() == "median").get_ydata()
    np.testing.assert_allclose(median[:half], 0.10)
    np.testing.assert_allclose(median[half:], 0.095)
    bands = [band.get_paths()[0].vertices[:, 1] for band in axes.collections]
    np.testing.assert_allclose([band[1] for band in bands], [0.01, 0.05])
    assert "90 % of 21 flights" in legend_of(figure)
    assert "1 of 21 terminated early" in legend_of(figure)
