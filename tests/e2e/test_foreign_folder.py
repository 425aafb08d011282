"""A flight from a folder whose own packages have the names of this repository's folders."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.environments import new_environment

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
SETPOINT = "ch04_tracking/setpoint#rho_065_modified"
SCRIPT = f"""
import controllers
import scenarios
import tests
import tiltsim

scenario = tiltsim.load_scenario("{SETPOINT}", {{"simulation.duration": 0.2}})
flight = tiltsim.simulate(scenario)
print(flight.end.kind, len(flight), tiltsim.__file__, sep="\\n")
print(*(package.OWNER for package in (controllers, scenarios, tests)))
"""


def run(*command, cwd):
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        command, cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def pip(*words, cwd):
    """Run pip without network: the build backend comes from this environment."""
    offline = ("--no-index", "--no-deps", "--no-build-isolation", "--disable-pip-version-check")
    run(sys.executable, "-m", "pip", *words, *offline, cwd=cwd)


@pytest.fixture
def python(tmp_path):
    return new_environment(tmp_path / "venv")


@pytest.fixture
def project(tmp_path):
    """A user's project with its own packages and a script that flies."""
    folder = tmp_path / "project"
    for name in ("controllers", "scenarios", "tests"):
        (folder / name).mkdir(parents=True)
        (folder / name / "__init__.py").write_text('OWNER = "user"\n', encoding="utf-8")
    (folder / "fly.py").write_text(SCRIPT, encoding="utf-8")
    return folder


@pytest.mark.parametrize("kind", ["editable", "wheel"])
def test_a_users_packages_do_not_shadow_the_packages_of_tiltsim(kind, python, project, tmp_path):
    pytest.importorskip("hatchling", reason="builds without network need the build backend")
    if kind == "wheel":
        pip("wheel", "--wheel-dir", str(tmp_path / "dist"), str(ROOT), cwd=tmp_path)
        (wheel,) = (tmp_path / "dist").glob("tiltsim-*.whl")
        target = [str(wheel)]
    else:
        target = ["--editable", str(ROOT)]
    pip("--python", str(python), "install", "--force-reinstall", *target, cwd=tmp_path)

    end, samples, file, owners = run(python, "fly.py", cwd=project).splitlines()
    assert (end, owners) == ("completed", "user user user")
    assert int(samples) > 1
    installed = Path(file).is_relative_to(python.parents[1])
    assert installed == (kind == "wheel")
    # `python -m` also puts the current folder first on the path.
    options = ["--set", "simulation.duration=0.2", "--set", "expect=[]", "--out", "flight"]
    run(python, "-m", "tiltsim", "run", SETPOINT, "--quiet", *options, cwd=project)
    assert (project / "flight" / "flight.parquet").is_file()
