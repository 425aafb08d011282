"""Python code that scenario files name is executed only where the user asks for it."""

from __future__ import annotations

import json

import pytest

from tiltsim.cli import main

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
    assert "is Python code to execute; allow it with --trust or TILTSIM_TRUST=1" in printed
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
    assert "allow it with --trust or TILTSIM_TRUST=1" in printed
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
