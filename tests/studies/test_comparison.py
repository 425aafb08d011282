"""Controllers side by side: rows, searches, the figure and the command."""

from __future__ import annotations

import json
from concurrent.futures import Future

import numpy as np
import pytest

import tiltsim
from tiltsim.cli import main
from tiltsim.commands.compare import chosen_controllers
from tiltsim.errors import INTERRUPTED, InputError
from tiltsim.studies.benchmark import compiled_time_per_call
from tiltsim.studies.comparison import (
    MEASURES,
    SEARCHES,
    Compared,
    Entry,
    Search,
    _last,
    _latency_refusal,
    _survived,
    compare,
    controller_tables,
    fly_entries,
    is_last_tried,
    why_none,
)
from tiltsim.views.figures.comparisons import comparison_figure

SETPOINT = "ch04_tracking/setpoint#rho_0_modified"
SHORT = {"simulation.duration": 0.3, "initial.position": [0.3, 0.0, 0.0], "expect": []}


@pytest.fixture(scope="module")
def rows():
    names = ["given", "lqr", "yaw_position"]
    return list(compare([SETPOINT], controller_tables(names), SHORT, searches=False))


def test_a_row_is_of_its_flight(rows):
    flight = tiltsim.simulate(tiltsim.load_scenario(SETPOINT, {**SHORT, "controller.law": "lqr"}))
    row = rows[1].row
    assert (row["controller"], row["scenario"], row["end"]) == ("lqr", SETPOINT, "completed")
    error = np.linalg.norm(flight["position"] - flight["reference_position"], axis=1)
    assert row["rms_position_error"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
    assert row["max_position_error"] == error.max()
    change = np.diff(flight["rotor_speeds"], axis=0) / np.diff(flight["time"])[:, None]
    effort = np.sqrt(np.mean(change**2))
    assert row["rms_rotor_acceleration"] == pytest.approx(effort, rel=1e-12)
    assert row["min_rotor_speed"] == flight.metrics()["min_rotor_speed"]
    assert row["time_per_call"] > 0.0
    np.testing.assert_array_equal(rows[1].error, error)


def test_a_controller_that_does_not_fit_is_part_of_the_result(rows):
    row = rows[2].row
    assert row["end"] == "refused"
    assert "controls the quadrotor" in row["refused"]
    assert {row[measure] for measure in MEASURES} == {None}
    assert set(row) == set(rows[0].row)


def test_the_figure_has_every_flight(rows):
    figure = comparison_figure(rows)
    (axes,) = figure.axes
    assert len([line for line in axes.lines if len(line.get_xdata())]) == 2
    assert [text.get_text() for text in figure.legends[0].get_texts()][:2] == [
        "the scenario's own",
        "LQR",
    ]


@pytest.mark.parametrize(("fails_at", "found"), [(9.0, None), (2.3, 2.2), (0.9, 0.8)])
def test_a_search_ends_at_the_last_value_that_holds(fails_at, found):
    search = Search("", 1.0, 3.0, 0.5, 0.15)
    if fails_at == 0.9:
        search = Search("", 1.0, 0.3, 0.2, 0.05)
        last = _last(lambda value: value > fails_at, search)
        assert fails_at < last <= fails_at + 0.05
        return
    last = _last(lambda value: value < fails_at, search)
    assert last == 3.0 if found is None else fails_at - 0.15 <= last < fails_at


def test_nothing_is_found_where_the_true_value_fails():
    assert _last(lambda value: False, SEARCHES["max_mass_factor"]) is None
    row = {"max_mass_factor": 3.0, "max_latency": 0.1, "control_period": 0.005}
    assert is_last_tried(row, "max_mass_factor")
    assert is_last_tried(row, "max_latency")
    assert not is_last_tried({**row, "max_latency": 0.05}, "max_latency")


def test_a_latency_is_sought_in_control_periods(monkeypatch):
    """With the sample time of the scenario, and a law that a latency of one sample ends."""
    scenario = tiltsim.load_scenario(
        {
            "controller": {"law": "lqr", "attitude_error": 0.02, "rate_error": 0.1},
            "simulation": {"duration": 1.2, "timestep": 0.004, "control_timestep": 0.008},
            "initial": {"angular_velocity": [1.0, 0.0, 0.0]},
        }
    )
    search = Search("simulation.control_latency", 0.0, 4.0, 2.0, 1.0)
    tried = []

    def noticed(flown):
        tried.append(flown.simulation.control_latency)
        return tiltsim.simulate(flown)

    monkeypatch.setattr("tiltsim.studies.comparison.simulate_to_end", noticed)
    found = _survived(scenario, search)
    assert tried[:2] == [0.0, pytest.approx(0.016)]
    assert found is not None
    assert found == pytest.approx(0.008 * round(found / 0.008))
    assert found < 0.032


def test_the_command_prints_rows_and_writes_a_folder(tmp_path, capsys):
    options = [x for key, value in SHORT.items() for x in ("--set", f"{key}={json.dumps(value)}")]
    names = ["--controllers", "lqr,yaw_position", "--jobs", "1", "--nominal", *options]
    only = ["--controllers", "yaw_position", "--jobs", "1", "--nominal"]
    assert main(["compare", SETPOINT, SETPOINT.replace("0_m", "065_m"), *only]) == 2
    printed = capsys.readouterr()
    assert "yaw_position: " in printed.out
    assert "nothing could be flown; most frequent reason (2 of 2): controller.law" in printed.err
    assert main(["compare", SETPOINT, *names, "--json", "--out", str(tmp_path)]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert [row["controller"] for row in printed] == ["lqr", "yaw_position"]
    assert json.loads((tmp_path / "comparison.json").read_text())[0].keys() == printed[0].keys()
    assert (tmp_path / "comparison.png").stat().st_size > 10_000
    assert main(["compare", SETPOINT, *names]) == 0
    table = capsys.readouterr().out.splitlines()
    assert table[0] == SETPOINT
    assert table[1].split()[:2] == ["controller", "rms"]
    assert "yaw_position: " in table[4]


def test_measures_of_contacts_are_shown_where_there_are_some(capsys):
    short = ["--set", "simulation.duration=0.1", "--set", "expect=[]", "--nominal"]
    command = ["compare", "interaction/door", "arena/quadrotor#step", "--controllers", "pid"]
    assert main([*command, *short, "--jobs", "1"]) == 0
    door, step = (line for line in capsys.readouterr().out.splitlines() if "rms error" in line)
    assert "peak (N)" in door
    assert "swing (rad)" not in door
    assert "peak (N)" not in step


def test_a_comparison_is_reported_as_soon_as_it_is_finished(monkeypatch):
    def in_turn(work, entries, _jobs):
        for entry in entries:
            answered.append(entry.name)
            future = Future()
            future.set_result(Compared({"controller": entry.name}, np.zeros(0), np.zeros(0)))
            yield entry, future

    answered = []
    monkeypatch.setattr("tiltsim.studies.comparison.in_processes", in_turn)
    entries = [Entry(SETPOINT, name, {"law": name}, {}) for name in ("pid", "lqr")]
    flown = fly_entries(entries, searches=True, jobs=2)
    assert next(flown).row["controller"] == "pid"
    assert answered == ["pid"]
    assert [one.row["controller"] for one in flown] == ["lqr"]


def named(controllers=(), *own):
    return chosen_controllers(controllers, own)


def test_every_controller_has_separate_gains(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_law.py").touch()
    fast = 'fast={law="pid", velocity_gains=[6.0, 3.6]}'
    assert named(["pid"], fast, "my_law.py:hover") == {
        "pid": {"law": "pid"},
        "fast": {"law": "pid", "velocity_gains": [6.0, 3.6]},
        "hover": {"law": "numpy", "function": f"{tmp_path}/my_law.py:hover"},
    }
    entry = Entry(SETPOINT, "fast", named((), fast)["fast"], {"simulation.duration": 1.0})
    assert entry.scenario().controller.velocity_gains == (6.0, 3.6)
    within = Entry(SETPOINT, "fast", entry.table, {"controller.position_gain": 2.0})
    assert within.scenario().controller.velocity_gains == (6.0, 3.6)
    assert within.scenario().controller.position_gain == 2.0


@pytest.mark.parametrize("text", ["pid", "fast=2", "fast={position_gain=2.0}", "mine.py"])
def test_gains_that_are_no_table_are_refused(text):
    with pytest.raises(InputError, match=r"write NAME=\{law=\"pid\", KEY=VALUE, ...\}"):
        named((), text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('x={law="pdi"}', "law: did you mean pid? choose "),
        ('x={law="pid", position_gian=2.0}', "position_gian: did you mean position_gain? "),
        ("none.py:hover", "none.py: no such file"),
        ('x={law="numpy", function="none.py:hover"}', "none.py: no such file"),
        ('={law="pid"}', "write NAME={law="),
    ],
)
def test_a_misspelt_controller_is_a_mistake_and_no_refusal(text, message):
    with pytest.raises(InputError) as caught:
        named((), text)
    assert str(caught.value).startswith(f"--controller {text}: ")
    assert message in str(caught.value)


def test_two_controllers_of_one_name_are_refused():
    with pytest.raises(InputError, match="pid is there twice"):
        named(["pid"], 'pid={law="pid"}')


def test_a_refused_sample_time_is_not_a_lost_flight():
    refusal = _latency_refusal(tiltsim.load_scenario(SETPOINT))
    assert "control_timestep = 0.005: too long" in refusal
    assert _latency_refusal(tiltsim.load_scenario(SETPOINT, {"controller.law": "pid"})) is None
    row = {"end": "completed", "latency_refused": refusal}
    assert why_none(row, "max_latency") == "refused"
    assert why_none(row, "max_mass_factor") == "lost"
    assert why_none({**row, "latency_refused": None}, "max_latency") == "lost"
    assert why_none({**row, "end": "refused"}, "max_latency") == "-"
    assert why_none(row, "min_rotor_speed") == "-"


def test_the_time_of_compiled_code_belongs_to_the_mujoco_plant():
    scenario = tiltsim.load_scenario(SETPOINT)
    assert compiled_time_per_call(scenario) >= 0.0
    assert np.isnan(compiled_time_per_call(scenario.replace({"simulation.plant": "thesis"})))


def test_an_unknown_controller_is_refused():
    with pytest.raises(InputError, match=r"--controllers pdi: did you mean pid\? choose given, "):
        controller_tables(["pdi"])


def test_no_controller_at_all_is_refused():
    with pytest.raises(InputError, match="--controllers: name one at least"):
        next(compare([SETPOINT], {}, {}))


def test_finished_flights_are_kept_after_an_interrupt(rows, tmp_path, capsys, monkeypatch):
    def interrupted(*_, **__):
        yield rows[0]
        raise KeyboardInterrupt

    monkeypatch.setattr("tiltsim.studies.comparison.compare", interrupted)
    options = ["--controllers", "lqr,pid", "--out", str(tmp_path), "--quiet"]
    assert main(["compare", SETPOINT, *options]) == INTERRUPTED
    assert len(json.loads((tmp_path / "comparison.json").read_text())) == 1
    assert f"comparison written to {tmp_path}" in capsys.readouterr().out
