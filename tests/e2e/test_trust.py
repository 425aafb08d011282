"""Nothing that only reads or checks executes its input, or code in the working folder."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

import tiltsim
from tests.planted import MARKS, gains, plant, scenario
from tiltsim.studies.arena import vehicles

FINE = """
simulation = { duration = 0.004, timestep = 0.002, engine = "python" }
"""
WALK = """
import argparse, contextlib, io, json, os, sys
from tiltsim.__main__ import main
from tiltsim.cli import build_parser

SCENARIOS = ["numpy.toml", "python.toml", "long.toml"]
PLANTED = [*SCENARIOS, "sweep.toml", "flight", "flight2", "gains.json", "."]
EXECUTES = ["run"]  # the code of the scenario that it names
NEEDED = {"compare": ["--controllers", "given"], "arena": ["--league", "unlimited"]}
OUTPUTS = {"--out": "out", "--rerun": "out.rrd", "--junit": "out.xml", "--json": "out.json"}
OUTPUTS |= {"--plot": "out.png", "--markdown": "out.md", "--pictures": "out"}
OUTPUTS |= {"--free": "vehicle.mass"}


def arguments_of(name, parser, planted):
    # What is planted is all that is needed, and the value of each further input.
    actions = [a for a in parser._actions if a.nargs != 0 and not a.choices]
    places = [a for a in actions if not a.option_strings]
    options = {a.option_strings[-1]: a for a in actions if a.option_strings}
    needed = [planted for a in places if a.nargs != "*" or len(places) == 1]
    for option, action in options.items():
        needed += [option, OUTPUTS.get(option, planted)] if action.required else []
    needed += NEEDED.get(name, [])
    yield needed
    for option in options:
        is_file = "FILE" in str(options[option].metavar) or option in OUTPUTS
        if is_file and option not in needed:
            yield [*needed, option, OUTPUTS.get(option, planted)]


(commands,) = [a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction)]
walk = [
    [name, *arguments]
    for name, parser in commands.choices.items()
    if name not in EXECUTES
    for planted in PLANTED
    for arguments in arguments_of(name, parser, planted)
    if planted in arguments
]
# Several processes, where they are the default, check the folder once, and flights that are fine.
walk = [each + ["--jobs", "1"] * (each[0] == "check" and len(each) > 2) for each in walk]
walk.append(["check", "fine.toml", "fine2.toml", "--jobs", "2"])


def called(arguments):
    sys.argv[1:] = arguments
    with contextlib.redirect_stdout(io.StringIO()) as o, contextlib.redirect_stderr(o):
        try:
            code = main()
        except BaseException as error:
            code = repr(error)[:100]
    return arguments, code, o.getvalue(), os.path.exists(sys.argv[0] + ".ran")


if __name__ == "__main__":
    print(json.dumps([called(arguments) for arguments in walk]))
"""


RUN = """
import sys
from tiltsim.__main__ import main

sys.exit(main())
"""
SCRIPT = """
import os
from tiltsim.system.processes import in_processes

if __name__ == "__main__":
    found = [future.result() for _, future in in_processes(abs, [1, -2], 2)]
    print(sorted(found), os.environ.get("PYTHONSAFEPATH"))
"""
IS_CODE = "is Python code to execute; allow it with --trust"
REFUSED = {
    f"{command} {law}.toml{options}"
    for law in ("numpy", "python")
    for command, options in (
        ("check", ""),
        ("attraction", ""),
        ("compare", " --controllers given"),
        ("report", ""),
    )
} | {"stability numpy.toml", "sweep sweep.toml", "arena --league unlimited --gains gains.json"}


@pytest.fixture
def folders(tmp_path):
    """The working folder with everything planted, and the program's folder, both clean of marks."""
    here, program = tmp_path / "here", tmp_path / "program"
    here.mkdir()
    program.mkdir()
    mark = program / "walk.py.ran"
    (program / "walk.py").write_text(WALK)
    (program / "run.py").write_text(RUN)
    plant(here, mark)
    for name in ("fine.toml", "fine2.toml"):
        (here / name).write_text(FINE)
    law = scenario("numpy", "law.py:numpy")
    (here / "long.toml").write_text(law.replace("0.02", "1000.0"))  # worth compiling
    for name, law in (("flight", "numpy"), ("flight2", "python")):
        tiltsim.simulate(here / f"{law}.toml").save(here / name)
    evil = {"law": "numpy", "function": f"{here}/law.py:numpy"}
    (here / "gains.json").write_text(
        gains(vehicles("unlimited"), "pid", of={"law": "pid"}, table=evil)
    )
    assert mark.exists()  # as those flights were flown
    mark.unlink()
    for name in {*sys.stdlib_module_names, "numpy", "mujoco", "tiltsim", "glfw"}:
        (here / f"{name}.py").write_text(MARKS.format(mark=str(tmp_path / f"ran_{name}")))
    return here, program


def run(here, *command):
    removed = ("PYTHONSAFEPATH", "TILTSIM_TRUST", "PYTHONPATH", "DISPLAY")
    environment = {key: value for key, value in os.environ.items() if key not in removed}
    command = [sys.executable, *map(str, command)]
    return subprocess.run(
        command, cwd=here, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow(longest=True)
def test_no_command_executes_what_it_reads(folders, tmp_path):
    here, program = folders
    done = run(here, program / "walk.py")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert [argv for argv, _code, _error, ran in found if ran] == []
    assert [file.name for file in tmp_path.glob("ran_*")] == []
    named = [" ".join(argv) for argv, _code, output, _ran in found if IS_CODE in output]
    assert {argv for argv in named if argv in REFUSED} == REFUSED
    assert found[-1][1] == 0  # of flights in several processes
    assert run(here, program / "run.py", "run", "numpy.toml").returncode == 0
    assert (program / "walk.py.ran").exists()


def test_processes_of_a_script_import_nothing_from_the_working_folder(folders, tmp_path):
    here, program = folders
    (program / "script.py").write_text(SCRIPT)
    done = run(here, program / "script.py")
    assert (done.returncode, done.stdout) == (0, "[1, 2] None\n"), done.stderr
    assert [file.name for file in tmp_path.glob("ran_*")] == []
    (here / "plain.py").write_text("import smtplib\n")
    assert run(here, "plain.py").returncode == 0
    assert (tmp_path / "ran_smtplib").exists()  # where nothing keeps Python from it
