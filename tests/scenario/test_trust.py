"""Python code that scenario files name is executed only where the user trusts it."""

from __future__ import annotations

import pickle

import pytest

import tiltsim
from tests.planted import SWEEP, gains, plant, scenario
from tiltsim.cli import main

ASKED = "is Python code to execute; allow it with --trust or TILTSIM_TRUST=1"

SWEPT_LAW = """
scenario = "beyond/setpoint_exact_decoupler#rho_0"
[[axis]]
type = "cases"
key = "law"
[axis.cases.own]
simulation = { duration = 0.004, timestep = 0.002 }
controller = { law = "python", function = "law.py:python" }
"""

ELSEWHERE = """
[set]
simulation = { duration = 0.004, timestep = 0.002 }
controller.law = "python"
controller.function = "../law.py:python"
[[axis]]
type = "list"
key = "initial.position[0]"
values = [0.0, 0.1]
"""
LISTED_ELSEWHERE = """
[set]
simulation = { duration = 0.004, timestep = 0.002 }
[[axis]]
type = "list"
keys = ["controller.law", "controller.function"]
values = [["python", "../law.py:python"]]
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with scenarios whose code is known to no other test."""
    plant(tmp_path, tmp_path / "ran")
    return tmp_path


def ran(folder):
    return (folder / "ran").exists()


@pytest.mark.slow
def test_check_executes_code_only_with_trust(folder, capsys, monkeypatch):
    assert main(["check", str(folder)]) == 2
    printed = capsys.readouterr().out
    assert printed.count(ASKED) == 2
    assert not ran(folder)
    assert main(["check", "--trust", str(folder)]) == 0
    assert ran(folder)
    monkeypatch.setenv("TILTSIM_TRUST", "1")
    assert main(["check", str(folder)]) == 0


@pytest.mark.parametrize("text", [SWEEP, SWEPT_LAW])
def test_sweeps_execute_code_only_with_trust(folder, text, capsys):
    sweep = folder / "sweep.toml"
    sweep.write_text(text)
    command = ["sweep", str(sweep), "--jobs", "1", "--quiet", "--out", str(folder / "out")]
    assert main(command) == 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert ASKED in printed
    assert not ran(folder)
    assert main([*command, "--trust"]) == 0
    assert ran(folder)


def test_run_executes_code_beside_the_scenario_without_asking(folder):
    assert main(["run", str(folder / "python.toml"), "--quiet"]) == 0
    assert ran(folder)


@pytest.mark.parametrize(
    "function", ["../law.py:python", "{}/law.py:python", "link.py:python", "\0.py:x"]
)
def test_code_elsewhere_is_not_executed(folder, function, capsys):
    inner = folder / "inner"
    inner.mkdir()
    (inner / "link.py").symlink_to(folder / "law.py")
    (inner / "scenario.toml").write_text(scenario("python", function.format(folder)))
    assert main(["run", str(inner / "scenario.toml"), "--quiet"]) == 2
    printed = capsys.readouterr().err
    assert "controller.function" in printed
    assert "must lie in the folder of the scenario file" in printed
    assert not ran(folder)


@pytest.mark.parametrize("text", [ELSEWHERE, LISTED_ELSEWHERE])
def test_sweeps_execute_no_code_elsewhere(folder, text, capsys, monkeypatch):
    inner = folder / "inner"
    inner.mkdir()
    monkeypatch.chdir(inner)
    (inner / "sweep.toml").write_text('scenario = "ch04_tracking/setpoint#rho_0_modified"' + text)
    assert main(["sweep", "sweep.toml", "--jobs", "1", "--quiet", "--trust", "--out", "out"]) == 2
    assert "must lie in the folder of the scenario file" in capsys.readouterr().err
    assert not ran(folder)


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("check", []),
        ("check", ["--jobs", "2"]),
        ("stability", []),
        ("attraction", ["--coarse", "1", "--refine", "0"]),
        ("compare", ["--controllers", "given", "--nominal", "--jobs", "1"]),
        ("report", ["--jobs", "1"]),
        pytest.param("report", ["--jobs", "2"], marks=pytest.mark.slow),
    ],
)
def test_commands_ask_before_the_flight_is_assembled(folder, command, options, capsys, monkeypatch):
    monkeypatch.setenv("TILTSIM_TRUST", "0")  # which report sets
    monkeypatch.chdir(folder)  # where it writes
    asked = [command, str(folder / "numpy.toml"), *options]
    assert main(asked) == 2
    assert ASKED in "".join(capsys.readouterr())
    assert not ran(folder)
    main([*asked, "--trust"])
    assert ASKED not in "".join(capsys.readouterr())
    assert ran(folder)


def test_check_asks_before_it_compiles(folder, capsys):
    keys = ["--set", "simulation.duration=1000", "--set", "simulation.engine=auto"]
    assert main(["check", str(folder / "numpy.toml"), *keys]) == 2
    assert ASKED in capsys.readouterr().out
    assert not ran(folder)


def test_reading_a_flight_executes_nothing(folder):
    flown = tiltsim.simulate(folder / "numpy.toml")
    flown.save(folder / "flight")
    (folder / "ran").unlink()
    (folder / "law.py").write_text((folder / "law.py").read_text() + "# now another file\n")
    flight = tiltsim.load_flight(folder / "flight")
    assert flight.metrics() == flown.metrics()
    assert all((flight[name] == flown[name]).all() for name in flown)
    assert len(pickle.loads(pickle.dumps(flight))) == len(flight)
    for fly in (tiltsim.simulate, tiltsim.Simulation, lambda one: tiltsim.fly([one])):
        with pytest.raises(tiltsim.InputError, match=ASKED):
            fly(flight.scenario)
    assert not ran(folder)


def test_permission_is_given_in_python_and_goes_with_the_scenario(folder, monkeypatch):
    file = folder / "numpy.toml"
    for uses in (tiltsim.stability, tiltsim.linearize, tiltsim.margins, lambda s: tiltsim.fly([s])):
        with pytest.raises(tiltsim.InputError, match=ASKED):
            uses(file)
    with pytest.raises(tiltsim.InputError, match=ASKED):
        tiltsim.simulate(tiltsim.load_scenario(file))
    assert not ran(folder)
    trusted = tiltsim.load_scenario(file, trusted=True)
    for one in (
        trusted,
        trusted.replace({"vehicle.mass": 0.5}),
        pickle.loads(pickle.dumps(trusted)),
    ):
        (folder / "law.py").write_text((folder / "law.py").read_text() + "# again\n")
        assert [row.end.kind for row in tiltsim.fly([one])] == ["completed"]
        assert ran(folder)
        (folder / "ran").unlink()
    monkeypatch.setenv("TILTSIM_TRUST", "1")
    (folder / "law.py").write_text((folder / "law.py").read_text() + "# last\n")
    assert next(tiltsim.fly([file])).end.kind == "completed"
    assert ran(folder)


def test_code_that_was_executed_once_still_needs_trust(folder):
    file = folder / "numpy.toml"
    tiltsim.simulate(file)
    with pytest.raises(tiltsim.InputError, match=ASKED):
        tiltsim.stability(file)


@pytest.mark.parametrize("own", [False, True])
def test_gains_name_no_code_but_the_command_lines(folder, own, capsys):
    evil = {"law": "numpy", "function": f"{folder}/law.py:numpy"}
    table = {"law": "numpy", "function": f"{folder}/other.py:numpy"} if own else {"law": "pid"}
    (folder / "other.py").write_text((folder / "law.py").read_text())
    tuned = gains(["quadrotor"], "numpy" if own else "pid", of=table, table=evil)
    (folder / "gains.json").write_text(tuned)
    chosen = ["--controller", f"{folder}/other.py:numpy"] if own else ["--controllers", "pid"]
    options = ["--gains", str(folder / "gains.json"), "--out", str(folder / "out"), "--jobs", "1"]
    assert (
        main(["arena", "--league", "unlimited", "--vehicles", "quadrotor", *chosen, *options]) == 2
    )
    assert ASKED in capsys.readouterr().err
    assert not ran(folder)
