"""The workflow of docs/ci.md: its files exist, and its shell steps run."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.docs.pages import ROOT, code
from tests.environments import new_environment
from tiltsim.engines.machine_code import code_folder

yaml = pytest.importorskip("yaml")

WORKFLOW = yaml.safe_load(code("docs/ci.md", "yaml")[0])
CHECK = WORKFLOW["jobs"]["check"]
STEPS = {step.get("name", step.get("uses")): step for step in CHECK["steps"]}
SHARDS = CHECK["strategy"]["matrix"]["shard"]

SCENARIO = """
[[variant]]
name = "a"
[[variant]]
name = "b"
[[variant]]
name = "c"
[simulation]
duration = 0.01
"""

OFFLINE = {
    "PIP_NO_INDEX": "1",
    "PIP_NO_DEPS": "1",
    "PIP_FORCE_REINSTALL": "1",
    "PIP_NO_BUILD_ISOLATION": "0",  # pip reads it as the value of its opposite
    "PIP_DISABLE_PIP_VERSION_CHECK": "1",
}


def test_ci_names_files_and_folders_of_a_clone(monkeypatch):
    setup = next(step["with"] for name, step in STEPS.items() if "setup-python" in name)
    assert (ROOT / setup["cache-dependency-path"]).is_file()
    assert (ROOT / WORKFLOW["env"]["SCENARIOS"]).is_dir()
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    cached = Path(STEPS["Cache compiled code"]["with"]["path"]).expanduser()
    assert cached == code_folder().parent
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    python = f"Programming Language :: Python :: {setup['python-version']}"
    assert python in project["classifiers"]


def test_every_machine_flies_its_own_shard():
    assert [*range(1, len(SHARDS) + 1)] == SHARDS
    written = re.findall(r"--(?:junit|json) (\S+)", STEPS["Check"]["run"])
    assert STEPS["Keep the results"]["with"]["path"].split() == written


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A clone with three scenarios, and the environment that its steps run in."""
    folder = tmp_path_factory.mktemp("checkout")
    for file in ROOT.iterdir():
        if not file.name.startswith("."):
            (folder / file.name).symlink_to(file)
    (folder / "mine").mkdir()
    (folder / "mine" / "three.toml").write_text(SCENARIO)
    python = new_environment(folder / ".venv")
    path = os.pathsep.join([str(python.parent), os.environ["PATH"]])
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return folder, {**kept, **OFFLINE, "PATH": path, "SCENARIOS": "mine"}


def run_step(name, checkout, shard):
    """Run a step as GitHub's runner does, with its expressions filled in."""
    folder, environment = checkout
    values = {"matrix.shard": shard, "strategy.job-total": len(SHARDS)}
    script = re.sub(r"\$\{\{ (\S+) \}\}", lambda found: str(values[found[1]]), STEPS[name]["run"])
    subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script],
        cwd=folder,
        env=environment,
        check=True,
    )


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the steps are for a Linux machine")
def test_shell_steps_of_ci_fly_every_scenario_once(checkout):
    pytest.importorskip("hatchling", reason="builds without network need the build backend")
    folder, _ = checkout
    run_step("Install", checkout, 1)
    assert (folder / ".venv" / "bin" / "tiltsim").is_file()
    flown, cases = [], 0
    for shard in SHARDS:
        run_step("Check", checkout, shard)
        document = json.loads((folder / "check.json").read_text())
        flown += [entry["address"] for entry in document["scenarios"]]
        cases += len(ElementTree.parse(folder / "junit.xml").getroot()[0])
    assert flown == [f"mine/three.toml#{name}" for name in "abc"]
    assert cases == 3
