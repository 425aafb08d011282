"""Figures in the user's size, style and words, from the command line and in Python."""

from __future__ import annotations

import argparse
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

from tests.flights import OTHER_KINDS, RECIPES, SAMPLE_FIELDS, flight, saved
from tiltsim.cli import build_parser, main
from tiltsim.errors import InputError
from tiltsim.laws.assembling import assemble
from tiltsim.scenario.metric_names import METRICS
from tiltsim.scenario.schema import quantity_of_key
from tiltsim.sweeps.tables import PlotTable
from tiltsim.views.figures import style
from tiltsim.views.figures.distributions import distinct_texts, label_of
from tiltsim.views.figures.layout import MIN_PANEL, relabel, retitle
from tiltsim.views.figures.plot import plot
from tiltsim.views.figures.sweep import _least_range


def labels_of(figure):
    return [axes.get_ylabel().replace("\n", " ") for axes in figure.axes]


# --- size and panels -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "inches"),
    [
        ("85mm x 60mm", (85 / 25.4, 60 / 25.4)),
        ("85x60mm", (85 / 25.4, 60 / 25.4)),
        ("3.3x2.4in", (3.3, 2.4)),
        ("8.5cm", (8.5 / 2.54, None)),
        ((4.0, 3.0), (4.0, 3.0)),
    ],
)
def test_sizes_are_given_in_mm_cm_or_inches(text, inches):
    assert style.parse_size("size", text) == pytest.approx(inches)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("85", "add mm, cm or in"),
        ("wide", "write such as 85mm"),
        ("1x1mm", "from 0.5 to 80 inches"),
    ],
)
def test_mistakes_in_sizes(text, words):
    with pytest.raises(InputError, match=words):
        style.parse_size("--size", text)


def test_panels_are_drawn_in_the_requested_order_and_size():
    figure = plot(flight("trot"), panels=["vx", "margin", "path"], size="85mm x 150mm")
    assert labels_of(figure) == ["velocity along x (m/s)", "rad", "y (m)"]
    assert tuple(figure.get_size_inches()) == pytest.approx((85 / 25.4, 150 / 25.4))
    (line,) = [line for line in figure.axes[0].lines if len(line.get_xdata()) > 2]
    np.testing.assert_array_equal(line.get_ydata(), flight("trot")["vx"])


@pytest.mark.parametrize(
    ("names", "size"),
    [(("position_error", "path", "margin"), None), (("path", "margin", "position_error"), "85mm")],
)
def test_squares_keep_their_place_among_panels_over_time(names, size):
    figure = plot(flight("trot"), panels=names, size=size)
    titles = {"position_error": "Position error", "path": "Plan view"}
    expected = [titles.get(name, "Singularity margin") for name in names]
    assert [axes.get_title(loc="left") for axes in figure.axes] == expected
    figure.draw_without_rendering()
    boxes = [axes.get_window_extent() for axes in figure.axes]
    assert all(later.x0 > former.x1 or later.y1 < former.y0 for former, later in pairwise(boxes))


def test_the_attitude_of_several_flights_has_a_panel_per_angle():
    figure = plot([flight("trot"), flight("fixed")], panels=["attitude", "alpha_1"], size="170mm")
    angles = ["roll (rad)", "pitch (rad)", "yaw (rad)"]
    assert labels_of(figure) == [*angles, "tilt angle α₁ (rad)"]


def test_the_height_that_panels_need_is_named_and_suffices():
    two = [flight("trot"), flight("fixed")]
    drawing = {"panels": ["position_error", "margin"], "labels": ["a long name " * 6, "b"]}
    with pytest.raises(InputError, match=r"^60 mm is too low for 2 panels; at least ") as raised:
        plot(two, **drawing, size="85x60mm")
    least = int(str(raised.value).split()[-2])
    assert 60 < least < 120
    figure = plot(two, **drawing, size=f"85x{least}mm")
    figure.draw_without_rendering()
    heights = [axes.get_window_extent().height / figure.dpi for axes in figure.axes]
    assert min(heights) >= MIN_PANEL
    (legend,) = figure.legends
    assert legend.get_window_extent().x1 <= figure.bbox.x1


def test_the_last_periods_shown_belong_to_the_shortest_flight():
    scenario = flight("trot").scenario
    gait = scenario.gait.model_copy(update={"period": 0.05})
    assembly = assemble(scenario.model_copy(update={"gait": gait}))
    long = replace(flight("trot"), assembly=assembly)
    half = len(long) // 2
    short = replace(long, samples=long.samples[: half + 1].copy())
    (axes,) = plot([long, short], panels="roll").axes
    end = short["time"][-1]
    assert axes.get_xlim() == pytest.approx((end - 0.2, end))
    assert axes.get_xlabel() == "time (s), the last 4 periods of all flights"


def test_angles_that_are_as_good_as_zero_have_an_axis_of_a_degree():
    whole = flight("fixed")
    samples = whole.samples.copy()
    samples[:, SAMPLE_FIELDS.index("yaw")] = 1e-9 * np.sin(whole["time"])
    (axes,) = plot(replace(whole, samples=samples), panels="yaw").axes
    assert np.ptp(axes.get_ylim()) == pytest.approx(0.02)


def test_a_vector_is_a_panel_of_its_components():
    (axes,) = plot(flight("trot"), panels="velocity", size="85x60mm").axes
    assert (axes.get_title(loc="left"), axes.get_ylabel()) == ("Velocity", "m/s")
    shown = {line.get_label(): line.get_ydata() for line in axes.lines}
    assert [*shown] == ["along x", "along y", "along z"]
    np.testing.assert_array_equal(np.stack([*shown.values()], axis=-1), flight("trot")["velocity"])
    compared = plot([flight("trot"), flight("tilt_car")], panels="position", size="85x150mm")
    assert labels_of(compared) == ["x (m)", "y (m)", "z (m)"]


def test_an_unknown_panel_is_one_line(tmp_path, capsys):
    assert main(["plot", str(saved("fixed", tmp_path)), "--panels", "path,margins"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "panels: 'margins': " in line
    assert "margin" in line.partition("'margins'")[2]


def test_too_small_a_figure_is_one_line(tmp_path, capsys):
    words = ["plot", str(saved("fixed", tmp_path)), "--panels", "margin", "--size", "20x15mm"]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "20 mm x 15 mm are too small for these panels" in line


GAIT = ["gait", "--angles", "0,0,0,0", "--panels", "a"]


def test_every_command_that_draws_has_the_options():
    (commands,) = (
        action
        for action in build_parser()._actions
        if isinstance(action, argparse._SubParsersAction)
    )
    for name, parser in commands.choices.items():
        options = {option for action in parser._actions for option in action.option_strings}
        draws = name == "plot" or "--plot" in options
        assert ({"--size", "--style", "--title", "--label"} <= options) is draws, name
        assert ("--panels" in options) is (name in ("plot", "gait")), name


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["map", "--size", "85mm"], "--size: needs --plot FILE"),
        (GAIT, "--panels: needs --plot FILE"),
        ([*GAIT, "--figure", "margin", "--plot", "FILE"], "--panels: this figure has no panels"),
        ([*GAIT, "--plot", "FILE"], "panels: 'a': choose"),
    ],
)
def test_options_of_no_use_are_one_line(words, message, tmp_path, capsys):
    words = [str(tmp_path / "figure.png") if word == "FILE" else word for word in words]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_figures_of_gaits_take_panels_size_and_words(tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr(style, "save", lambda figure, _path: shown.append(figure))
    words = ["gait", "ch05_gaits/line#walk_full", "--plot", str(tmp_path / "gait.png")]
    words += ["--panels", "margin", "--size", "85mm x 60mm", "--title", "A walk"]
    assert main([*words, "--label", "rad=margin"]) == 0
    (figure,) = shown
    (axes,) = figure.axes
    assert (axes.get_title(loc="left"), axes.get_ylabel()) == ("A walk", "margin")
    assert tuple(figure.get_size_inches()) == pytest.approx((85 / 25.4, 60 / 25.4))


# --- style ---------------------------------------------------------------------------------------


def test_the_users_settings_take_precedence_and_stay_as_they_are():
    users = {"font.family": ["serif"], "font.size": 7.0, "axes.prop_cycle": plt.cycler(color="km")}
    with matplotlib.rc_context(users):
        before = dict(matplotlib.rcParams)
        figure = plot([flight("trot"), flight("fixed")], panels=["margin"])
        assert dict(matplotlib.rcParams) == before
    label = figure.axes[0].yaxis.label
    assert label.get_fontfamily()[0] == "serif"
    assert label.get_fontsize() == 7.0
    colors = {line.get_color() for line in figure.axes[0].lines if len(line.get_xdata()) > 2}
    assert colors == {"k", "m"}
    assert plt.get_fignums() == []


def test_a_matplotlibrc_is_respected_even_where_it_says_the_default(tmp_path, monkeypatch):
    file = tmp_path / "matplotlibrc"
    file.write_text("axes.spines.right: True\n", encoding="utf-8")
    monkeypatch.setenv("MATPLOTLIBRC", str(file))
    axes = plot(flight("fixed"), panels=["altitude"]).axes[0]
    assert axes.spines["right"].get_visible()
    assert not axes.spines["top"].get_visible()


def test_a_style_file_takes_precedence(tmp_path):
    file = tmp_path / "paper.mplstyle"
    file.write_text("font.family: serif\nfont.size: 6\nsavefig.dpi: 50\n", encoding="utf-8")
    with style.paper_style(file, style.parse_size("--size", "3x2in")):
        label = plot(flight("fixed"), panels=["altitude"]).axes[0].yaxis.label
        assert (label.get_fontfamily()[0], label.get_fontsize()) == ("serif", 6.0)
        assert matplotlib.rcParams["savefig.dpi"] == 50.0
    with style.paper_style(size=style.parse_size("--size", "3x2in")):
        assert matplotlib.rcParams["savefig.dpi"] == style.PRINT_DPI


def test_a_missing_style_file_is_one_line(tmp_path, capsys):
    words = ["plot", str(saved("fixed", tmp_path)), "--style", "no.mplstyle"]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("tiltsim: --style no.mplstyle: No such file or directory; give a")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"font.size: 6\nA letter\n", "Missing colon in file "),
        (b"font.sise: 6\n", "Bad key font.sise in file "),
        (b"font.size: big\n", "Bad value in file "),
        (b"\xff\xfe", "is no text; "),
    ],
)
def test_a_file_that_is_no_style_is_one_line(text, words, tmp_path, capfd):
    file = tmp_path / "paper.mplstyle"
    file.write_bytes(text)
    with (
        pytest.raises(InputError, match=rf"^--style {file}: {words}") as caught,
        style.paper_style(file),
    ):
        pass
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


# --- words ---------------------------------------------------------------------------------------


def test_title_and_labels_are_the_users(tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr(style, "save", lambda figure, _path: shown.append(figure))
    folders = [str(saved(name, tmp_path)) for name in ("trot", "fixed")]
    options = ["--label", "trot=A trot of 1 s", "--label", "singularity margin=margin μ"]
    assert main(["plot", *folders, "--title", "Two gaits", "--panels", "margin", *options]) == 0
    (figure,) = shown
    assert figure.texts[0].get_text() == "Two gaits"
    assert labels_of(figure) == ["margin μ (rad)"]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()][:2] == ["A trot of 1 s", "fixed"]


@pytest.mark.parametrize("names", [["trot"], ["trot", "fixed"]])
def test_panels_are_relabeled_by_their_names(names):
    labels = {"position_error": "Distance", "trot": "T"} if len(names) > 1 else {}
    labels = labels or {"position_error": "Distance"}
    figure = plot([flight(name) for name in names], panels="position_error", labels=labels)
    (axes,) = figure.axes
    assert (axes.get_title(loc="left") or axes.get_ylabel()) in {"Distance", "Distance (m)"}


def test_the_label_of_a_single_flight_is_its_title():
    figure = plot(flight("trot"), panels="margin", labels=["mine"])
    assert figure.texts[0].get_text() == "mine"


def test_a_label_of_nothing_is_one_line(tmp_path, capsys):
    words = ["plot", str(saved("fixed", tmp_path)), "--panels", "altitude"]
    words += ["--label", "altitud=Height"]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "label 'altitud': " in line
    assert "Altitude" in line


def test_metrics_are_relabeled_by_their_names_and_keep_their_units():
    figure = Figure()
    axes = figure.subplots()
    axes.set_xlabel(METRICS["sup_position_error_after_20s"].quantity.text)
    relabel(figure, {"sup_position_error_after_20s": "error"})
    assert axes.get_xlabel() == "error (m)"
    retitle(figure, "A $ sign")
    assert figure.get_suptitle() == r"A \$ sign"


def test_every_metric_and_column_has_a_distinct_label():
    assert len({metric.label for metric in METRICS.values()}) == len(METRICS)
    for name in (*RECIPES, *OTHER_KINDS):
        this = flight(name)
        labels = [this.assembly.loop.label(column).label for column in this.units]
        assert len(set(labels)) == len(labels), name
        assert not [label for label in labels if "_" in label or not label]


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("gait.period", "gait period (s)"),
        ("vehicle.tilt_servo.max_rate", "tilt servo max rate (rad/s)"),
        ("vehicle.rotor_inertia", "rotor inertia (kg m²)"),
        ("initial.attitude[1]", "initial attitude pitch (rad)"),
        ("gait.angles[0]", "gait angles α₁ (rad)"),
        ("companion[0].offset[1]", "companion[0] offset y (m)"),
        ("fault[1].time", "fault[1] time (s)"),
        ("my_own_variable", "my own variable"),
    ],
)
def test_keys_have_the_units_of_their_descriptions(key, text):
    assert quantity_of_key(key).text == text


def test_columns_of_a_sweep_have_the_labels_of_its_plot_table():
    plot_table = PlotTable(labels={"wind": "wind speed (m/s)"})
    results = SimpleNamespace(sweep=SimpleNamespace(plot=plot_table))
    results.metrics = ("max_abs_roll", "wing.max_abs_roll")
    names = ("wind", "gait.period", "simulation.duration", *results.metrics)
    labels = [label_of(SimpleNamespace(points=results), name) for name in names]
    roll = "largest roll (rad)"
    assert labels[:3] == ["wind speed (m/s)", "gait period (s)", "duration (s)"]
    assert labels[3:] == [roll, f"wing: {roll}"]


def test_a_map_of_rounding_errors_has_one_shade():
    low, high, varies = _least_range("max_abs_roll", np.array([2.2e-16, np.nan, 2.4e-16]))
    assert high - low == pytest.approx(0.02)
    assert not varies
    assert _least_range("max_abs_roll", np.array([0.1, 0.3])) == (0.1, 0.3, True)


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([0.0392, 0.0963, 0.247], ["0.0392", "0.0963", "0.247"]),
        ([4.93312, 4.93328, 4.9341], ["4.9331", "4.9333", "4.9341"]),
        ([-1.5, -1.5], ["−1.5", "−1.5"]),
    ],
)
def test_unequal_quantiles_have_distinct_texts(values, texts):
    assert distinct_texts(values) == texts
