"""The example package: built, installed, and flown by everything that reads scenarios."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from tests.docs.pages import ROOT

FILE = """
[controller]
law = "steady"

[simulation]
duration = 6.0
timestep = 0.004
plant = "thesis"

[reference]
type = "setpoint"
position = [0.2, 0.1, 0.3]

[[disturbance]]
type = "acceleration"
value = [0.5, 0.0, 0.0]

[[expect]]
metric = "final_position_error_x"
min = -0.01
max = 0.01
"""

PYTHON = """
import tiltsim
base = tiltsim.load_scenario("steady.toml")
rows = tiltsim.fly([base.replace({"simulation.engine": "native"})] * 2, keep_samples=True)
alone = tiltsim.simulate(base.replace({"simulation.engine": "python"}))
assert all((row.flight.samples == alone.samples).all() for row in rows)
"""

COMMANDS = [
    ["run", "steady.toml", "--quiet", "--out", "flight"],
    ["check", "steady.toml"],
    ["schema", "controller.steady"],
    ["stability", "steady.toml", "--json"],
    ["run", "steady.toml", "--set", "controller.position_bandwidth=-1"],
]
RUN = f"""
import contextlib, io, json
from tiltsim.cli import main
found = []
for command in {COMMANDS}:
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        code = main(command)
    found.append([code, out.getvalue(), error.getvalue()])
print(json.dumps(found))
"""
"""Commands one after the other in one process: separate ones would each import all of tiltsim."""


def installed(name, folder):
    """Build the wheel of an example package, and install it for the processes of `run`."""
    pytest.importorskip("hatchling", reason="builds without network need the build backend")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    options = ["--no-deps", "--no-index", "--no-build-isolation"]
    wheel = [*pip, "wheel", *options, "--wheel-dir", str(folder), str(ROOT / "examples" / name)]
    subprocess.run(wheel, check=True, cwd=folder)
    (built,) = folder.glob("*.whl")
    target = [*pip, "install", *options[:2], "--target", str(folder / "site"), str(built)]
    subprocess.run(target, check=True, cwd=folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a scenario, and the package installed for the processes of `run`."""
    folder = tmp_path_factory.mktemp("package")
    installed("controller_package", folder)
    (folder / "steady.toml").write_text(FILE, encoding="utf-8")
    return folder


def run(folder, *arguments):
    environment = os.environ | {"PYTHONPATH": str(folder / "site")}
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


@pytest.mark.slow
def test_the_command_line_knows_the_law(folder):
    done = run(folder, "-c", RUN)
    assert done.returncode == 0, done.stderr
    flown, checked, schema, stability, refused = json.loads(done.stdout)
    assert flown == [0, "", ""]
    metrics = json.loads((folder / "flight" / "metrics.json").read_text())
    assert abs(metrics["final_position_error_x"]) < 0.01  # the integral removes it
    assert checked[0] == 0
    assert "attitude_bandwidth" in schema[1]
    assert "removes steady errors" in schema[1]
    found = [complex(*pole) for pole in json.loads(stability[1])["poles"]]
    for pole in np.roots(
        [0.01, 1.0, 4.5, 6.75, 3.375]
    ):  # the rotors' lag, and a triple pole at -1.5
        assert min(abs(one - pole) for one in found) < 1e-4
    assert refused[0] == 2
    assert "controller.position_bandwidth = -1" in refused[2]


@pytest.mark.slow
def test_a_package_flies_in_batches_natively_as_in_python(folder):
    done = run(folder, "-c", PYTHON)
    assert done.returncode == 0, done.stderr
