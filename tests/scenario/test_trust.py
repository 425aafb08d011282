"""Python code that scenario files name is executed only where the user asks for it."""

from __future__ import annotations

import json
import pickle

import pytest

import tiltsim
from tiltsim.cli import main

ASKED = "is Python code to execute; allow it with --trust or TILTSIM_TRUST=1"

LAW = """
from pathlib import Path
import tiltsim

Path(__file__).with_suffix(".ran").touch()


def law(observation):
    return tiltsim.Command(thrusts=[1.0] * 4)
"""
SCENARIO = """
simulation = {{ duration = 0.004, timestep = 0.002 }}
controller = {{ law = "python", function = {function} }}
"""
SWEEP = """
scenario = "scenario.toml"
[[axis]]
type = "list"
key = "initial.position[0]"
values = [0.0, 0.1]
"""
SWEPT_LAW = """
scenario = "beyond/setpoint_exact_decoupler#rho_0"
[[axis]]
type = "cases"
key = "law"
[axis.cases.own]
simulation = { duration = 0.004, timestep = 0.002 }
controller = { law = "python", function = "law.py:law" }
"""

ELSEWHERE = """
[set]
simulation = { duration = 0.004, timestep = 0.002 }
controller.law = "python"
controller.function = "../law.py:law"
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
values = [["python", "../law.py:law"]]
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "law.py").write_text(LAW)
    (tmp_path / "scenario.toml").write_text(SCENARIO.format(function='"law.py:law"'))
    return tmp_path


def ran(folder):
    return (folder / "law.ran").exists()


def test_check_executes_code_only_with_trust(folder, capsys, monkeypatch):
    assert main(["check", str(folder)]) == 2
    printed = capsys.readouterr().out
    assert ASKED in printed
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
    assert main(["run", str(folder / "scenario.toml"), "--quiet"]) == 0
    assert ran(folder)


@pytest.mark.parametrize("function", ["../law.py:law", "{}/law.py:law", "link.py:law", "\0.py:law"])
def test_code_elsewhere_is_not_executed(folder, function, capsys):
    inner = folder / "inner"
    inner.mkdir()
    (inner / "link.py").symlink_to(folder / "law.py")
    text = SCENARIO.format(function=json.dumps(function.format(folder)))
    (inner / "scenario.toml").write_text(text)
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


SCALAR_LAW = """
from pathlib import Path
import tiltsim

Path(__file__).with_suffix(".ran").touch()


@tiltsim.scalar
def law(observed):
    return (2.0, 2.0, 2.0, 2.0), (), ()
"""
SCALAR = """
simulation = { duration = 0.02, timestep = 0.002, engine = "python" }
vehicle = { model = "quadrotor" }
controller = { law = "scalar", function = "law.py:law" }
"""


@pytest.fixture
def scalar(tmp_path):
    """A scenario whose code is known to no other test."""
    (tmp_path / "law.py").write_text(SCALAR_LAW + f"# {tmp_path}\n")
    (tmp_path / "scenario.toml").write_text(SCALAR)
    return tmp_path


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("check", []),
        ("check", ["--jobs", "2"]),
        ("stability", []),
        ("attraction", ["--coarse", "1", "--refine", "0"]),
        ("compare", ["--controllers", "given", "--nominal", "--jobs", "1"]),
    ],
)
def test_commands_ask_before_the_flight_is_assembled(scalar, command, options, capsys):
    asked = [command, str(scalar / "scenario.toml"), *options]
    assert main(asked) == 2
    assert ASKED in "".join(capsys.readouterr())
    assert not ran(scalar)
    main([*asked, "--trust"])
    assert ASKED not in "".join(capsys.readouterr())
    assert ran(scalar)


def test_check_asks_before_it_compiles(scalar, capsys):
    keys = ["--set", "simulation.duration=1000", "--set", "simulation.engine=auto"]
    assert main(["check", str(scalar / "scenario.toml"), *keys]) == 2
    assert ASKED in capsys.readouterr().out
    assert not ran(scalar)


def test_reading_a_flight_executes_nothing(scalar):
    flown = tiltsim.simulate(scalar / "scenario.toml")
    flown.save(scalar / "flight")
    (scalar / "law.ran").unlink()
    (scalar / "law.py").write_text((scalar / "law.py").read_text() + "# now another file\n")
    flight = tiltsim.load_flight(scalar / "flight")
    assert flight.metrics() == flown.metrics()
    assert all((flight[name] == flown[name]).all() for name in flown)
    assert len(pickle.loads(pickle.dumps(flight))) == len(flight)
    for fly in (tiltsim.simulate, tiltsim.Simulation, lambda one: tiltsim.fly([one])):
        with pytest.raises(tiltsim.InputError, match=ASKED):
            fly(flight.scenario)
    assert not ran(scalar)


def test_permission_is_given_in_python_and_goes_with_the_scenario(scalar, monkeypatch):
    file = scalar / "scenario.toml"
    for uses in (tiltsim.stability, tiltsim.linearize, tiltsim.margins, lambda s: tiltsim.fly([s])):
        with pytest.raises(tiltsim.InputError, match=ASKED):
            uses(file)
    with pytest.raises(tiltsim.InputError, match=ASKED):
        tiltsim.simulate(tiltsim.load_scenario(file))
    assert not ran(scalar)
    trusted = tiltsim.load_scenario(file, trusted=True)
    for one in (
        trusted,
        trusted.replace({"vehicle.mass": 0.5}),
        pickle.loads(pickle.dumps(trusted)),
    ):
        (scalar / "law.py").write_text((scalar / "law.py").read_text() + "# again\n")
        assert [row.end.kind for row in tiltsim.fly([one])] == ["completed"]
        assert ran(scalar)
        (scalar / "law.ran").unlink()
    monkeypatch.setenv("TILTSIM_TRUST", "1")
    (scalar / "law.py").write_text((scalar / "law.py").read_text() + "# last\n")
    assert next(tiltsim.fly([file])).end.kind == "completed"
    assert ran(scalar)


def test_code_that_was_executed_once_is_still_asked_for(scalar):
    file = scalar / "scenario.toml"
    tiltsim.simulate(file)
    with pytest.raises(tiltsim.InputError, match=ASKED):
        tiltsim.stability(file)


@pytest.mark.parametrize("own", [False, True])
def test_gains_name_no_code_but_that_of_the_command_line(scalar, own, capsys):
    evil = {"law": "scalar", "function": f"{scalar}/law.py:law"}
    table = {"law": "scalar", "function": f"{scalar}/other.py:law"} if own else {"law": "pid"}
    (scalar / "other.py").write_text((scalar / "law.py").read_text())
    found = {"quadrotor": {"law" if own else "pid": {"of": table, "table": evil}}}
    made = {"made": {"date": "", "commit": ""}, "seed": 1, "flights": 1, "gains": found}
    (scalar / "gains.json").write_text(json.dumps(made))
    chosen = ["--controller", f"{scalar}/other.py:law"] if own else ["--controllers", "pid"]
    gains = ["--gains", str(scalar / "gains.json"), "--out", str(scalar / "out"), "--jobs", "1"]
    assert main(["arena", "--vehicles", "quadrotor", *chosen, *gains]) == 2
    assert ASKED in capsys.readouterr().err
    assert not ran(scalar)
