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


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a scenario, and the package installed for the processes of `run`."""
    pytest.importorskip("hatchling", reason="builds without network need the build backend")
    folder = tmp_path_factory.mktemp("package")
    package = ROOT / "examples" / "controller_package"
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    options = ["--no-deps", "--no-build-isolation"]
    wheel = [*pip, "wheel", *options, "--wheel-dir", str(folder), str(package)]
    subprocess.run(wheel, check=True, cwd=folder)
    (built,) = folder.glob("*.whl")
    target = [*pip, "install", "--no-deps", "--target", str(folder / "site"), str(built)]
    subprocess.run(target, check=True, cwd=folder)
    (folder / "steady.toml").write_text(FILE, encoding="utf-8")
    return folder


def run(folder, *arguments):
    environment = os.environ | {"PYTHONPATH": str(folder / "site")}
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


@pytest.mark.slow
def test_the_command_line_knows_the_law(folder):
    flown = run(folder, "-m", "tiltsim", "run", "steady.toml", "--quiet", "--out", "flight")
    assert (flown.returncode, flown.stderr) == (0, "")
    metrics = json.loads((folder / "flight" / "metrics.json").read_text())
    assert abs(metrics["final_position_error_x"]) < 0.01  # the integral removes it
    assert run(folder, "-m", "tiltsim", "check", "steady.toml").returncode == 0
    keys = run(folder, "-m", "tiltsim", "schema", "controller.steady").stdout
    assert "attitude_bandwidth" in keys
    assert "removes steady errors" in keys
    poles = json.loads(run(folder, "-m", "tiltsim", "stability", "steady.toml", "--json").stdout)
    found = [complex(*pole) for pole in poles["poles"]]
    for pole in np.roots(
        [0.01, 1.0, 4.5, 6.75, 3.375]
    ):  # the rotors' lag, and a triple pole at -1.5
        assert min(abs(one - pole) for one in found) < 1e-4
    unknown = ["--set", "controller.position_bandwidth=-1"]
    refused = run(folder, "-m", "tiltsim", "run", "steady.toml", *unknown)
    assert refused.returncode == 2
    assert "controller.position_bandwidth = -1" in refused.stderr


@pytest.mark.slow
def test_it_flies_in_batches_natively_as_in_python(folder):
    done = run(folder, "-c", PYTHON)
    assert done.returncode == 0, done.stderr
