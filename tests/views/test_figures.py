"""The figure of a flight: what it shows, its formats, its command."""

from __future__ import annotations

from dataclasses import replace

import matplotlib
import numpy as np
import pytest

import tiltsim
from tests.flights import BASE, RECIPES, SAMPLE_FIELDS, flight, saved
from tiltsim.cli import main
from tiltsim.flight.end import End
from tiltsim.laws.assembling import assemble
from tiltsim.views.figures import style
from tiltsim.views.figures.comparison import comparison_figure
from tiltsim.views.vehicle_views import flight_figure

SIGNATURES = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
PANELS = {"Attitude", "Altitude", "Position error", "Tilt angles", "Rotor speeds", "Plan view"}
PLANES = {"Attitudes flown; shaded: unreachable", "Attitudes flown; all reachable"}


def axes_by_title(figure):
    return {axes.get_title(loc="left"): axes for axes in figure.axes}


@pytest.mark.parametrize("name", RECIPES)
def test_every_flight_can_be_drawn(name):
    figure = flight_figure(flight(name))
    figure.canvas.draw()
    titles = set(axes_by_title(figure))
    assert titles >= PANELS
    assert titles & PLANES
    assert any(title.startswith("Singularity margin, minimum") for title in titles)


def test_the_lines_are_the_flights_columns():
    this = flight("trot")
    panels = axes_by_title(flight_figure(this))
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
    for axes in flight_figure(flight("fixed")).axes:
        assert any(unit in axes.get_ylabel() for unit in ("rad", "m")), axes.get_title(loc="left")


@pytest.mark.parametrize("panel", ["Attitude", "Position error"])
def test_lines_of_a_panel_differ_without_color(panel):
    lines = axes_by_title(flight_figure(flight("trot")))[panel].lines
    named = [line for line in lines if line.get_label() in {"roll", "pitch", "yaw", *"xyz"}]
    assert len({str(line._dash_pattern) for line in named}) == 3


@pytest.mark.parametrize(("period", "shown"), [(0.5, "Tilt angles"), (0.05, "last 0.3 s")])
def test_of_many_periods_only_the_last_are_shown(period, shown):
    this = flight("trot")
    gait = this.scenario.gait.model_copy(update={"period": period})
    this = replace(this, assembly=assemble(this.scenario.model_copy(update={"gait": gait})))
    panels = axes_by_title(flight_figure(this))
    [title] = [title for title in panels if title.startswith("Tilt angles")]
    assert title.endswith(shown)
    end = this["time"][-1]
    assert panels[title].get_xlim() == pytest.approx((end - 0.3 if period < 0.1 else 0.0, end))
    assert panels["Rotor speeds"].get_xlim() == pytest.approx((0.0, end))


def test_rotor_limits_are_drawn_where_there_are_some():
    limited = axes_by_title(flight_figure(flight("limited")))["Rotor speeds"]
    free = axes_by_title(flight_figure(flight("fixed")))["Rotor speeds"]
    levels = {line.get_ydata()[0] for line in limited.lines if len(set(line.get_ydata())) == 1}
    assert {150.0, 390.0} <= levels
    assert len(limited.lines) == len(free.lines) + 2


def test_the_closest_approach_is_marked():
    this = flight("trot")
    plane = axes_by_title(flight_figure(this))["Attitudes flown; shaded: unreachable"]
    closest = int(np.argmin(np.abs(this["singularity_margin"])))
    dots = [line.get_xydata()[0] for line in plane.lines if len(line.get_xdata()) == 1]
    np.testing.assert_allclose(dots, [[this["roll"][closest], this["pitch"][closest]]])
    (words,) = [text.get_text() for text in plane.texts]
    assert words == (
        f"minimum margin {abs(this['singularity_margin'][closest]):.2f} rad"
        f" at {this['time'][closest]:.2f} s"
    )


def test_drawing_does_not_change_matplotlibs_parameters():
    before = dict(matplotlib.rcParams)
    flight_figure(flight("fixed"))
    assert dict(matplotlib.rcParams) == before


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
    assert main(["plot", str(folder / path)]) == 0
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
        panels = axes_by_title(flight_figure(replace(whole, samples=samples, end=end)))
        low, high = panels["Rotor speeds"].get_ylim()
        spans[kind] = high - low
        words = [text.get_text() for text in panels["Rotor speeds"].texts]
        assert words == (["ends off scale"] if kind == "diverged" else [])
    assert spans["completed"] > 1e8
    assert spans["diverged"] < 1e3


def test_a_flight_of_one_sample_is_drawn_without_a_warning(recwarn):
    whole = flight("fixed")
    flight_figure(replace(whole, samples=whole.samples[:1].copy()))
    assert not recwarn.list


def test_all_attitudes_of_a_red_gait_are_reachable():
    red = BASE | {"gait": {"type": "fixed", "angles": [-0.3, 0.3, -0.3, 0.3]}}
    panels = axes_by_title(flight_figure(tiltsim.simulate(tiltsim.parse_scenario(red))))
    plane = panels["Attitudes flown; all reachable"]
    assert [len(line.get_xdata()) > 1 for line in plane.lines].count(True) == 1, "the attitudes"


# --- supervised flights, and several on one page -------------------------------------------------


def supervised():
    return flight("supervised")


def test_the_margin_shows_its_threshold_and_when_the_supervisor_is_active():
    this = supervised()
    assert 0.0 < this["supervision"].max() <= 1.0
    panels = axes_by_title(flight_figure(this))
    (title,) = [title for title in panels if title.startswith("Singularity margin")]
    axes = panels[title]
    levels = {line.get_ydata()[0] for line in axes.lines if len(set(line.get_ydata())) == 1}
    assert 0.9 in levels
    assert "shaded: supervisor active" in {text.get_text() for text in axes.texts}
    plain = next(
        v for k, v in axes_by_title(flight_figure(flight("trot"))).items() if "margin" in k
    )
    assert "shaded: supervisor active" not in {text.get_text() for text in plain.texts}


def test_flights_are_compared_by_margin_determinant_and_error():
    flights = [flight("jumps"), supervised()]
    figure = comparison_figure(flights)
    figure.canvas.draw()
    panels = axes_by_title(figure)
    assert list(panels) == [
        "Singularity margin",
        "Determinant, 4 for a level untilted vehicle",
        "Supervisor output",
        "Distance from the reference",
    ]
    for axes, column in zip(
        panels.values(), ("singularity_margin", "determinant", "supervision"), strict=False
    ):
        drawn = [line.get_ydata() for line in axes.lines if len(line.get_ydata()) > 2]
        columns = [this.columns[column] for this in flights if column in this.columns]
        for line, expected in zip(drawn, columns, strict=True):
            np.testing.assert_array_equal(line, np.maximum(expected, 0.0))
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["jumps", "supervised"]
    assert legend.get_title().get_text() == "2 flights compared"


def test_a_comparison_says_where_a_flight_terminated():
    lost = replace(flight("jumps"), end=End("singular", 0.7, "why"))
    (legend,) = comparison_figure([lost, supervised()]).legends
    assert legend.get_texts()[0].get_text() == "jumps, singular at 0.70 s"


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
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["mod", r"con\$v"]
    assert legend.get_title().get_text() == "A trot around a circle"


def test_the_page_of_a_variant_names_it():
    def subtitle(address):
        scenario = tiltsim.parse_scenario(BASE | RECIPES["trot"], address)
        page = flight_figure(replace(flight("trot"), assembly=assemble(scenario)))
        title, line = (text.get_text() for text in page.texts)
        assert title == "A trot around a circle"
        return line

    plain = subtitle("ch04/circle")
    assert subtitle("ch04/circle#modified_t2") == f"modified_t2  ·  {plain}"


def test_a_vehicle_without_a_margin_is_not_compared(tmp_path, capsys):
    folders = [str(saved(name, tmp_path)) for name in ("tilt_car", "jumps")]
    assert main(["plot", *folders]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "the tilt_car has no singularity margin to compare" in line


def test_text_in_any_script_is_drawn_without_a_warning(tmp_path):
    figure = style.new_figure(2.0, 1.0)
    figure.suptitle("四旋翼 🚁")
    style.save(figure, tmp_path / "figure.png")  # any warning is an error
    assert (tmp_path / "figure.png").is_file()
