"""The arena: tasks, scores, the page, the figure and the command."""

from __future__ import annotations

import json

import numpy as np
import pytest

import tiltsim
from tiltsim.cli import main
from tiltsim.errors import InputError
from tiltsim.studies import arena
from tiltsim.studies.comparison import Compared, compare_one
from tiltsim.views.figures.arena_scores import arena_figure


def row(controller, task, position=0.0, yaw=0.0, end="completed"):
    return {
        "controller": controller,
        "scenario": f"arena/tiltrotor#{task}",
        "end": end,
        "refused": "arena/tiltrotor#x: needs legs" if end == "refused" else None,
        "rms_position_error": position,
        "rms_yaw_error": yaw,
    }


@pytest.fixture
def rows():
    return [
        row("pid", "step", 0.25),
        row("pid", "circle", end="refused"),
        row("full_pose", "step", 0.5),
        row("full_pose", "circle", 0.1, 0.2),
        row("lqr", "step", end="singular"),
        row("lqr", "circle", 0.1),
    ]


def test_an_error_halves_the_score_where_it_says(rows):
    expected = [50.0, None, 100.0 / 3.0, 25.0, 0.0, 50.0]
    assert list(map(arena.score, rows)) == pytest.approx(expected)
    assert arena.score(row("pid", "circle")) == 100.0
    assert arena.score(row("pid", "yaw_step", 0.0, 1.571 / 4)) == pytest.approx(50.0)


def test_the_scale_of_a_step_is_that_of_a_first_order_response():
    time = np.linspace(0.0, 8.0, 8001)
    assert pytest.approx(np.sqrt(np.mean(np.exp(-2.0 * time))), rel=1e-3) == arena.STEP


def test_a_refusal_counts_as_zero_in_the_total_alone(rows):
    ranked = arena.standings(rows)
    assert [standing.controller for standing in ranked] == ["full_pose", "pid", "lqr"]
    by_name = {standing.controller: standing for standing in ranked}
    assert by_name["pid"].scores == {"step": 50.0, "circle": None}
    assert (by_name["pid"].total, by_name["pid"].of_flown) == (25.0, 50.0)
    assert (by_name["lqr"].total, by_name["lqr"].of_flown) == (25.0, 25.0)


def test_the_page_says_first_where_a_baseline_wins(rows):
    lines = arena.arena_page({"tiltrotor": rows}, "Made.").splitlines()
    assert lines[4] == "- tiltrotor, `step`: `pid` 50 against 33 (`full_pose`)"
    assert lines[5] == "- tiltrotor, `circle`: `lqr` 50 against 25 (`full_pose`)"
    assert "| `circle` | 25 | - | 50 |" in lines
    assert "- `pid`: needs legs" in lines
    assert "- `lqr` in `step`: singular" in lines
    assert not arena.beaten(arena.standings(rows[2:4]))


def test_the_figure_shows_every_score(rows):
    figure = arena_figure({"tiltrotor": arena.standings(rows)})
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts == ["33", "50", "0", "25", "–", "50", "29", "25", "25"]


def test_every_task_is_flown_by_the_scenarios_own_controller():
    tasks = arena.vehicles()
    assert list(map(len, tasks.values())) == [len(tasks["quadrotor"]), len(tasks["tiltrotor"])]
    names = {task.partition("#")[2] for task in tasks["tiltrotor"]}
    assert names >= {task.partition("#")[2] for task in tasks["quadrotor"]}
    assert set(arena.HALF_OF) <= names
    for address in (*tasks["tiltrotor"], *tasks["quadrotor"]):
        assert tiltsim.load_scenario(address).simulation.duration <= 10.0


def test_a_vehicle_has_the_controllers_that_fit():
    tasks = arena.vehicles()
    own = ["given", "attitude_altitude", "full_pose", *arena.BASELINES]
    assert arena.fitting(tasks["tiltrotor"])[:7] == own
    assert arena.fitting(tasks["quadrotor"])[:5] == ["yaw_position", *arena.BASELINES]


def test_a_named_law_has_its_default_gains_even_where_the_scenario_has_others(monkeypatch):
    flown = []

    def noticed(scenario):
        flown.append(scenario.controller)
        raise InputError("seen")

    monkeypatch.setattr("tiltsim.studies.comparison.simulate", noticed)
    for name in ("given", "attitude_altitude"):
        compare_one(("arena/tiltrotor#step", name), {}, searches=False)
    assert [table.gains for table in flown] == ["feedforward", "ch04"]


def test_a_yaw_error_is_the_shorter_way_around():
    overrides = {"simulation.duration": 0.02, "initial.attitude": [0.0, 0.0, -3.0]}
    item = ("arena/tiltrotor#yaw_step", "geometric")
    overrides["reference.yaw"] = 3.0
    error = compare_one(item, overrides, searches=False).row["rms_yaw_error"]
    assert error == pytest.approx(2.0 * np.pi - 6.0, abs=0.02)


def test_the_command_writes_data_page_and_figure(tmp_path, capsys, monkeypatch):
    def flown(addresses, names, overrides, **_):
        for address in addresses:
            for name in names:
                task = address.partition("#")[2]
                yield Compared(row(name, task, 0.1), np.zeros(0), np.zeros(0))

    monkeypatch.setattr(arena, "compare", flown)
    options = ["--controllers", "pid,lqr", "--vehicles", "tiltrotor", "--out", str(tmp_path)]
    assert main(["arena", *options, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((tmp_path / "arena.json").read_text())
    assert printed["made"]["versions"]["mujoco"]
    assert {one["controller"] for one in printed["vehicles"]["tiltrotor"]} == {"pid", "lqr"}
    assert printed["vehicles"]["tiltrotor"][0]["score"] == pytest.approx(50.0)
    assert (tmp_path / "arena.png").stat().st_size > 10_000
    assert (tmp_path / "arena.md").read_text().startswith("# Arena")


def test_an_unknown_vehicle_is_refused():
    with pytest.raises(InputError, match="--vehicles boat: choose quadrotor, tiltrotor"):
        arena.chosen_vehicles(["boat"])
