"""A sweep's definition has the digests of controllers, MJCF and tables that its scenarios name."""

from __future__ import annotations

import os
import re

import pytest

from tests.models.test_user_vehicle import TETRAHEDRON, XML
from tiltsim.errors import InputError
from tiltsim.scenario.loading import load_scenario
from tiltsim.sweeps.dataset import open_sweep_folder
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.running import run_sweep
from tiltsim.system.files import digest

LAW = """
import tiltsim

def law(observation):
    return tiltsim.Command(thrusts=[1.0] * 4)
"""
SWEEP = """
[scenario]
simulation = { duration = 0.004, timestep = 0.002 }
vehicle = { mjcf = "own.xml" }
reference = { type = "table", file = "tables/way.csv" }
[[axis]]
type = "cases"
key = "law"
cases.one.controller = { law = "python", function = "one.py:law" }
cases.two.controller = { law = "python", function = "laws/two.py:law" }
[[axis]]
type = "list"
key = "vehicle.mjcf"
values = ["own.xml", "other.xml"]
"""
FILES = (
    *("laws/two.py", "meshes/wing.obj", "one.py", "other.xml", "own.xml", "parts/moon.xml"),
    "tables/way.csv",
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a sweep of two controllers and two vehicles, which share an include."""
    vehicle = re.sub("<option .*?/>", '<include file="parts/moon.xml"/>', XML, count=1)
    mesh = '<compiler meshdir="meshes"/><asset><mesh name="wing" file="wing.obj"/></asset>'
    texts = {
        "sweep.toml": SWEEP,
        "one.py": LAW,
        "laws/two.py": LAW,
        "own.xml": vehicle,
        "other.xml": vehicle.replace("<worldbody>", f"{mesh}<worldbody>", 1),
        "parts/moon.xml": "<mujoco><option gravity='0 0 -1.62'/></mujoco>",
        "meshes/wing.obj": TETRAHEDRON,
        "tables/way.csv": "time,x,y,z\n0,0,0,0\n1,0,0,1\n",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_all_files_are_in_the_definition(folder):
    files = load_sweep(folder / "sweep.toml").files
    assert files == {str(folder / name): digest((folder / name).read_bytes()) for name in FILES}


@pytest.mark.parametrize("name", FILES)
def test_a_sweep_is_not_continued_with_another_file(folder, name):
    before = load_sweep(folder / "sweep.toml")
    with open_sweep_folder(folder / "out", SweepPoints(before)):
        pass
    with (folder / name).open("a") as file:
        file.write("\n")
    now = load_sweep(folder / "sweep.toml")
    path = str(folder / name)
    words = f'sha256 of {path} was "{before.files[path]}" and is "{now.files[path]}"'
    with pytest.raises(InputError, match=re.escape(f"contains another sweep: {words}; ")):
        run_sweep(now, folder / "out", trusted=True)


def test_rows_of_a_file_that_changes_meanwhile_are_not_kept(folder):
    definition = load_sweep(folder / "sweep.toml")
    (folder / "one.py").write_text(LAW.replace("1.0", "1.1"))
    with pytest.raises(InputError, match=r"one\.py: no longer the file with which this sweep"):
        run_sweep(definition, folder / "out", trusted=True)
    assert not list((folder / "out" / "parts").iterdir())


def test_a_sweep_given_in_python_may_name_code_anywhere(folder):
    (folder / "scenario.toml").write_text(
        "controller = { law = 'python', function = 'one.py:law' }\n"
        "simulation = { duration = 0.004, timestep = 0.002 }\n"
    )
    axis = {
        "type": "list",
        "key": "controller.function",
        "values": [f"{folder}/one.py:law", f"{folder}/laws/two.py:law"],
    }
    (folder / "elsewhere").mkdir()
    os.chdir(folder / "elsewhere")
    base = load_scenario(folder / "scenario.toml")
    files = load_sweep({"scenario": base, "axis": [axis]}).files
    assert files.keys() == {f"{folder}/one.py", f"{folder}/laws/two.py"}
