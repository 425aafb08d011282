"""The arena: tasks, scores, the page, the figure and the command."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest

from tiltsim.cli import main
from tiltsim.errors import InputError
from tiltsim.studies import arena, tuning
from tiltsim.studies.arena_page import arena_page, league_page, league_table
from tiltsim.studies.comparison import Compared, Entry, compare_one, controller_tables
from tiltsim.studies.multirotor_analysis import FEW_ROTORS, FLEET
from tiltsim.studies.scores import AIMS, INTERACTION, STEP, score
from tiltsim.views.figures.comparisons import arena_figure, panels_of

UNLIMITED = ["--league", "unlimited"]


def row(controller, task, position=0.0, yaw=0.0, end="completed", gains="default"):
    made = {
        "controller": controller,
        "scenario": f"arena/tiltrotor#{task}",
        "end": end,
        "refused": f"arena/tiltrotor#{task}: needs legs" if end == "refused" else None,
        "rms_position_error": position,
        "final_position_error": 0.0,
        "rms_yaw_error": yaw,
        "idle_position_error": 0.0,
        "idle_yaw_error": 0.0,
        "gains": gains,
        "world": "",
    }
    return made | {"score": score(made)}


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
    assert list(map(score, rows)) == pytest.approx(expected)
    assert score(row("pid", "circle")) == 100.0
    assert score(row("pid", "yaw_step", 0.0, 1.571 / 4)) == pytest.approx(50.0)


def test_the_scale_of_a_step_belongs_to_a_first_order_response():
    time = np.linspace(0.0, 8.0, 8001)
    assert pytest.approx(np.sqrt(np.mean(np.exp(-2.0 * time))), rel=1e-3) == STEP


def test_a_refusal_counts_as_zero_in_the_total_alone(rows):
    ranked = arena.standings(rows)
    assert [standing.controller for standing in ranked] == ["full_pose", "pid", "lqr"]
    by_name = {standing.controller: standing for standing in ranked}
    assert by_name["pid"].scores == {"step": 50.0, "circle": None}
    assert [by_name[name].total for name in ("pid", "lqr")] == [25.0, 25.0]


def test_the_page_says_first_where_a_baseline_wins(rows):
    lines = arena_page({"tiltrotor": rows}, ["Made."]).splitlines()
    assert lines[2].endswith("in 2 of 2 tasks: tiltrotor 2.")
    assert "| `circle` | 25 | - | 50 |" in lines


def test_the_page_of_controllers_without_rivals_names_no_winner(rows):
    alone, baselines = rows[2:4], [*rows[:2], *rows[4:]]
    page = arena_page({"tiltrotor": alone, "quadrotor": baselines}, ["Made."])
    assert "baseline" not in page
    assert page.startswith("# Arena\n\n## All tasks")
    both = arena_page({"tiltrotor": rows, "quadrotor": baselines}, ["Made."]).splitlines()
    assert both[2].endswith("in 2 of 2 tasks: tiltrotor 2.")


@pytest.fixture
def tuned(rows):
    """Tuning makes full_pose the best in the step, and nothing else."""
    return [
        *rows,
        row("full_pose", "step", 0.125, gains="tuned"),
        row("full_pose", "circle", 0.1, 0.2, gains="tuned"),
    ]


def test_tuned_scores_stand_beside_default_ones_and_decide_the_order(tuned):
    lines = arena_page({"tiltrotor": tuned}, ["Made."]).splitlines()
    assert lines[2].startswith("With tuned gains a baseline beats")
    assert lines[2].endswith("in 1 of 2 tasks: tiltrotor 1.")
    assert "| `step` | 33 → 67 | 50 | 0 |" in lines
    assert "| tiltrotor | 29 → 46 | 25 | 25 |" in lines


def test_the_figure_shows_every_score(tuned):
    ranked = arena.standings(tuned)
    figure = arena_figure(panels_of({"tiltrotor": ranked}))
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts == ["33 → 67", "50", "0", "25", "–", "50", "29 → 46", "25", "25"]
    many = arena_figure(panels_of({"one": ranked, "two": ranked, "three": ranked}))
    assert [len(axes.texts) for axes in many.axes] == [9, 9, 9]


def test_every_vehicle_of_the_fleet_has_tasks():
    vehicles = arena.vehicles("unlimited")
    assert list(vehicles)[:2] == ["quadrotor", "tiltrotor"]
    assert set(vehicles) == set(FLEET) - set(FEW_ROTORS)
    of = {name: {task.partition("#")[2] for task in one.tasks} for name, one in vehicles.items()}
    assert of["tiltrotor"] >= of["quadrotor"]
    assert of["tiltrotor"] >= of["hexarotor"] == of["omni_octorotor"]
    limited = {task.partition("#")[2] for task in arena.vehicles("limited")["hexarotor"].tasks}
    assert set(AIMS) <= of["tiltrotor"] | limited
    for name in ("quadrotor", "tiltrotor", "tilt_octorotor", "omni_octorotor"):
        for address in vehicles[name].tasks[::4]:
            flown = arena.entry_of(vehicles[name], address, "given", {}).scenario()
            assert flown.simulation.duration <= 10.0
    assert len(flown.vehicle.resolve().spins) == 8


def test_a_vehicle_has_the_controllers_that_fit():
    vehicles = arena.vehicles("unlimited")
    own = ["given", "attitude_altitude", "full_pose", *arena.BASELINES]
    assert arena.fitting(vehicles["tiltrotor"])[:7] == own
    assert arena.fitting(vehicles["quadrotor"])[:5] == ["yaw_position", *arena.BASELINES]
    of_fleet = ["full_pose", "attitude_force", *arena.BASELINES]
    assert arena.fitting(vehicles["hexarotor"])[:6] == of_fleet
    assert arena.fitting(vehicles["omni_octorotor"])[:7] == ["given", *of_fleet]


def test_only_the_tasks_own_controller_takes_what_a_vehicle_needs():
    octorotor = arena.vehicles("unlimited")["omni_octorotor"]
    of = [
        arena.entry_of(octorotor, octorotor.tasks[0], name, table).scenario().controller
        for name, table in controller_tables(["given", "attitude_force", "pid"]).items()
    ]
    assert [one.law for one in of] == ["attitude_force", "attitude_force", "pid"]
    assert [one.norm for one in of[:2]] == ["thrust", "speed"]


def test_a_named_law_has_its_default_gains_even_where_the_scenario_has_others():
    flown = [
        Entry("arena/tiltrotor#step", name, table, {}).scenario().controller.gains
        for name, table in controller_tables(["given", "attitude_altitude"]).items()
    ]
    assert flown == ["feedforward", "ch04"]


def test_a_yaw_error_is_the_shorter_way_around():
    overrides = {"simulation.duration": 0.02, "initial.attitude": [0.0, 0.0, -3.0]}
    overrides["reference.yaw"] = 3.0
    entry = Entry("arena/tiltrotor#yaw_step", "geometric", {"law": "geometric"}, overrides)
    error = compare_one(entry, searches=False).row["rms_yaw_error"]
    assert error == pytest.approx(2.0 * np.pi - 6.0, abs=0.02)


def flown(entries, **_):
    for entry in entries:
        task = entry.address.partition("#")[2]
        error = 0.1 if len(entry.table) < 2 else 0.05
        yield Compared(row(entry.name, task, error), np.zeros(0), np.zeros(0))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--tune", "40", "--gains", "gains.json"], "--gains: not with --tune"),
        (["--seed", "2"], "--seed: only with --tune"),
        (["--league", "interaction", "--tune", "9"], "--tune: not in the league of interaction"),
        (["--vehicles", ","], "--vehicles ,: name one at least"),
        (["--tasks", "loop"], "--tasks loop: choose circle, "),
        (["--tasks", "slide"], "--tasks slide: choose circle, "),
        (["--controllers", ""], "--controllers '': name one at least"),
    ],
)
def test_contradicting_or_empty_options_are_refused(options, message, tmp_path, capsys):
    assert main(["arena", *options, "--out", str(tmp_path / "arena")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "arena").exists()


def test_an_arena_without_a_flight_fails(tmp_path, capsys, monkeypatch):
    def refused(entries, **_):
        for one in flown(entries):
            one.row.update(end="refused", refused=f"{one.row['scenario']}: needs legs")
            yield one

    monkeypatch.setattr(arena, "fly_entries", refused)
    chosen = ["--controllers", "pid", "--vehicles", "quadrotor", "--quiet", *UNLIMITED]
    assert main(["arena", *chosen, "--out", str(tmp_path)]) == 2
    message = "tiltsim: nothing could be flown; most frequent reason (18 of 18): needs legs\n"
    assert capsys.readouterr().err == message
    assert (tmp_path / "arena.md").exists()


def test_the_command_writes_data_page_and_figure(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(arena, "fly_entries", flown)
    found = {
        tuning.Search("tiltrotor", "pid"): tuning.Tuned(
            {"law": "pid"}, {"law": "pid", "position_gain": 1.5}, {"position_gain": 1.5}, 1, 2, 40
        ),
        tuning.Search("tiltrotor", "lqr"): None,
    }
    monkeypatch.setattr(tuning, "tune_all", lambda *_, **__: iter(found.items()))
    chosen = ["--controllers", "pid,lqr", "--vehicles", "tiltrotor", *UNLIMITED]
    first, second = tmp_path / "first", tmp_path / "second"
    assert main(["arena", *chosen, "--tune", "40", "--out", str(first), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((first / "arena.json").read_text())
    assert printed["made"]["versions"]["mujoco"]
    rows = printed["vehicles"]["tiltrotor"]
    assert [(one["controller"], one["gains"]) for one in rows[:3]] == [
        ("pid", "default"),
        ("pid", "tuned"),
        ("lqr", "default"),
    ]
    assert [one["score"] for one in rows[:2]] == pytest.approx([50.0, 100.0 / 1.5])
    assert (first / "arena.png").stat().st_size > 10_000
    assert (first / "arena.md").read_text().startswith("# Arena")
    gains = first / "tuned_gains.json"
    kept = json.loads(gains.read_text())
    assert (kept["seed"], kept["flights"]) == (1, 40)
    assert kept["gains"]["tiltrotor"]["pid"]["table"]["position_gain"] == 1.5
    assert main(["arena", *chosen, "--gains", str(gains), "--out", str(second), "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["vehicles"] == printed["vehicles"]


@pytest.mark.parametrize(
    ("league", "names", "addresses"),
    [
        ("limited", ["wind", "step"], ["arena/limited#step", "arena/limited#wind"]),
        ("interaction", ["door", "slide"], ["interaction/push#slide", "interaction/door"]),
    ],
)
def test_named_tasks_alone_are_flown(league, names, addresses):
    chosen = arena.chosen_vehicles(["tilt_hexarotor"], league, names)
    assert [one.tasks for one in chosen.values()] == [tuple(addresses)]


def test_an_unknown_vehicle_is_refused():
    with pytest.raises(InputError, match="--vehicles boat: choose cant_hexarotor, "):
        arena.chosen_vehicles(["boat"], "unlimited")


def touching(task="push#hold", **changes):
    """A flight of the league of interaction without an error."""
    made = flight(scenario=f"interaction/{task}", time_in_contact=20.0)
    return made | {"rms_force_error": 0.0, "peak_force": 0.0, "final_swing": 0.0} | changes


def test_forces_impacts_swing_and_contact_count_in_their_tasks():
    for address in INTERACTION:
        assert score(touching(address.removeprefix("interaction/"))) == pytest.approx(100.0)
    idle = {"idle_position_error": 1e9}  # of which a vehicle that stays has no score
    assert score(touching(rms_force_error=0.5, **idle)) == pytest.approx(50.0)
    assert score(touching("platform", peak_force=25.0, **idle)) == pytest.approx(50.0)
    assert score(touching("carry#cable", final_swing=0.1, **idle)) == pytest.approx(50.0)
    assert score(touching("door", time_in_contact=0.5, **idle)) == pytest.approx(50.0)
    assert score(touching("carry#cable", time_in_contact=None)) == pytest.approx(100.0)


@pytest.mark.parametrize("task", ["push#hold", "push#slide", "door", "platform"])
def test_a_vehicle_that_never_touches_has_no_score(task):
    assert score(touching(task, time_in_contact=0.0)) == 0.0
    assert score(touching("push#hold", rms_force_error=None)) == 0.0  # never settled


KEYS = "push_stiffness=9.0, rotor_bandwidth=400.0, tilts='free'"
FLYERS = """
import tiltsim
from tiltsim import xp
from tiltsim_controllers.laws.outer_loop import allocated_with_tilts


def hover(observed, target, moves=1.0, stays=1.0):
    body, reference = observed.vehicle, observed.reference
    lift = xp.array([0.0, 0.0, body.gravity]) + moves * reference.acceleration
    error, speed = target - observed.position, moves * reference.velocity - observed.velocity
    push = body.mass * (lift + 9.0 * error + 6.0 * speed)
    angular = -144.0 * observed.attitude - 24.0 * observed.body_rates
    thrusts, tilts = allocated_with_tilts(
        observed, observed.rotation.T @ push, observed.inertia @ angular
    )
    return tiltsim.Command(thrusts=stays * thrusts, tilt_angles=tilts)


@tiltsim.law
def idle(observed):
    return hover(observed, observed.position, moves=0.0)  # else the force loop moves it


@tiltsim.law
def away(observed):
    return hover(observed, observed.reference.position - xp.array([0.0, 0.3, -0.3]))


@tiltsim.law
def falls(observed):
    stays = xp.where(observed.time > 7.0, 0.0, 1.0)
    return hover(observed, observed.reference.position, stays=stays)


@tiltsim.law
def mine(observed):
    return hover(observed, observed.reference.position)
"""


@pytest.mark.slow
def test_laws_of_a_user_fly_the_league_of_interaction(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(FLYERS)
    names = ("idle", "away", "falls", "mine")
    own = [f'{one}={{law="numpy", function="own.py:{one}", {KEYS}}}' for one in names]
    chosen = [word for one in own for word in ("--controller", one)]
    command = ["arena", "--league", "interaction", "--vehicles", "tilt_hexarotor", "--quiet"]
    laws = ["--controllers", "full_pose,vectoring,pid"]
    assert main([*command, *laws, *chosen, "--jobs", "1", "--out", str(tmp_path), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["vehicles"]["tilt_hexarotor"]
    scores = {(one["controller"], one["scenario"].rpartition("/")[2]): one["score"] for one in rows}
    tasks = [address.rpartition("/")[2] for address in INTERACTION]
    assert max(scores["idle", task] for task in tasks) < 1.0
    assert max(scores["falls", task] for task in tasks if task != "platform") < 1.0
    assert scores["falls", "platform"] < 20.0 < scores["mine", "platform"]
    assert max(scores["away", task] for task in ("push#hold", "push#slide", "platform")) < 5.0
    for name in ("full_pose", "vectoring", "mine"):
        assert min(scores[name, task] for task in ("push#hold", "door", "carry#cable")) > 50.0
    assert scores["pid", "push#hold"] is None
    page = (tmp_path / "arena.md").read_text()
    assert "- `pid` in `hold`, `slide`: reference.type" in page
    assert "| `hold`: rms force error, N |" in page


def flight(**changes):
    return row("pid", "step") | {"idle_position_error": 1.0, "idle_yaw_error": 0.5} | changes


def test_neither_an_idle_vehicle_nor_a_late_crash_gains():
    assert score(flight(rms_position_error=1.0, rms_yaw_error=0.5)) == 0.0
    assert score(flight(rms_position_error=1.5, rms_yaw_error=0.5)) == 0.0
    assert score(flight()) == 100.0
    assert score(flight(rms_position_error=1e-3, end="diverged")) == 0.0
    falling = score(flight(rms_position_error=0.05, final_position_error=0.4))
    assert falling == score(flight(rms_position_error=0.4)) < 40.0


def league_rows():
    """Two tasks, two seeds, two worlds: vectoring wins the circle, pid the step by little."""
    for world, seed in itertools.product(("model error", "exact model"), (1, 2)):
        for name, step, circle in (("vectoring", 0.25, 0.01 * seed), ("pid", 0.24, 0.1)):
            for task, error in (("step", step), ("circle", circle)):
                effort = {"rms_rotor_acceleration": 500.0, "peak_rotor_speed": 419.0}
                made = row(name, task, error) | effort | {"saturated_fraction": 0.1}
                yield made | {"seed": seed, "world": world}


def test_the_page_of_the_limited_league_says_who_wins_by_how_much_and_where_not():
    rows = {"hexarotor": list(league_rows())}
    lines = league_page(rows, ["Made."]).splitlines()
    assert lines[2] == "## With a model error"
    assert "wins 1 of 2 tasks" in lines[4]
    assert lines[5].startswith("On curves, in wind and with a weak rotor the best baseline's error")
    assert " is 6.7 times as large" in lines[5]
    assert lines[6] == "Lost tasks, vehicles and points: `step` with 1, by up to 1.0."
    assert "| `circle` | 0.015 / 0.100 `pid` 50 |" in lines
    assert "| `pid` | 500 | 0.50 | 10.0 % | 0 of 4 |" in lines
    assert "## With an exact model" in lines
    table = league_table(rows).splitlines()
    assert len(table) == 17
    assert table[1].startswith("hexarotor,step,vectoring,default,model error,1,completed,50.0,0.25")


def test_the_limited_league_flies_within_limits():
    vehicles = arena.vehicles("limited")
    assert set(vehicles) == set(arena.LIMITED)
    for name, vehicle in vehicles.items():
        tables = arena.tables_of(vehicle, "limited")
        flights = arena.matches("limited", {name: vehicle}, {name: tables}, {})
        assert {one.place["seed"] for one in flights} == {1, 2, 3}
        flown = flights[0].entry.scenario()
        low, high = flown.vehicle.speeds_along_spin
        assert (low < 0.0) == (name in arena.REVERSING)
        assert high == arena.LIMITED[name]
        assert flown.vehicle.rotor_time_constant == 0.03
        assert flown.simulation.control_latency > 0.0
        assert ("geometric_free" in tables) == flown.vehicle.has_tilting_rotors


def test_tuned_gains_take_the_place_of_default_ones_in_the_limited_league():
    vehicles = {"hexarotor": arena.vehicles("limited")["hexarotor"]}
    tables = {"hexarotor": controller_tables(["pid"])}
    tuned = {"hexarotor": {"pid": {"law": "pid", "position_gain": 1.5}}}
    flights = arena.matches("limited", vehicles, tables, tuned)
    assert {one.place["gains"] for one in flights} == {"tuned"}
    assert len(flights) == 9 * (3 + 3)
