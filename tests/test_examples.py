"""The short examples run, each in a separate folder, and print the results that they promise."""

from __future__ import annotations

import ast
import re
import runpy

import pytest

from tests.docs.pages import ROOT

EXAMPLES = ROOT / "examples"

PRINTED = {
    "first_flight": r"completed after 40 s, at most 7\.0 mm from the path",
    "scenario_in_python": r"exact +error at the end: -?0\.0000, -?0\.0000, 0\.0158 m",
    "own_vehicle": r"completed \[ 0\.3 -0\.2  0\.2\] m",
    "own_law": r"fleet/hexarotor#hover: .* 0\.01 mm from the set point",
    "csv_reference": r"largest distance from the path: 1\.19\d mm",
    "wind": r"cant_hexarotor: completed, .* leans by 0\.0000 rad",
    "rotor_fault": r"known after 0\.02 s: completed, up to 0\.015 m off, 0\.0000 m at the end",
    "monte_carlo": r"100% of 256 flights completed",
    "controllers": r"geometric: completed, at most 0\.3 mm off",
    "gait_analysis": r"0\.0 +1\.571 +100%",
    "singularity_margins": r"amplitude 0\.7 rad: completed, smallest margin 1\.034 rad",
    "stability": r"stable: True\n.*altitude: 1\.021 rad/s",
    "linear_system": r"real parts from -31\.\d+ to -0\.0\d",
    "identify": r"assumed: rms position error 0\.268\d m\nidentified: .* 0\.048\d m",
    "optimal_control": r"after 0\.8 s at 0\.95\d m, accelerations up to 12\d\d\d rad/s\^2",
    "predictive_control": r"predictive: .* error 0\.37\d m.*\nvectoring: .* error 0\.39\d m",
    "learning": r"actions \(6,\), best score [1-9]\d*\.\d",
}
"""Text that each prints."""

SLOW = {"identify", "first_flight", "stability", "csv_reference", "controllers", "learning", "wind"}
SLOW |= {"monte_carlo", "predictive_control"}
"""Examples that take more than 3 s."""

NEEDS = {"learning": "gymnasium", "optimal_control": "casadi", "predictive_control": "casadi"}
"""Packages that not every installation has."""

SHORT = sorted(
    file.stem for file in EXAMPLES.glob("*.py") if len(file.read_text().splitlines()) < 60
)


def test_every_short_example_is_run_and_listed():
    assert sorted(PRINTED) == SHORT
    page = (ROOT / "docs" / "examples.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| \[`(\w+)\.py`\]", page, re.MULTILINE)) == {*SHORT}


@pytest.mark.parametrize("name", SHORT)
def test_every_short_example_begins_with_its_purpose(name):
    documented = ast.get_docstring(ast.parse((EXAMPLES / f"{name}.py").read_text()))
    assert documented
    assert documented.endswith(".")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] if n in SLOW else []) for n in PRINTED]
)
def test_every_short_example_runs(name, tmp_path, monkeypatch, capsys):
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    source = (EXAMPLES / f"{name}.py").read_text()
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert re.search(PRINTED[name], capsys.readouterr().out)
    for drawn in re.findall(r'savefig\("(\S+)"\)', source):
        assert (tmp_path / drawn).stat().st_size > 10_000
