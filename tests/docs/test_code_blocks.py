"""Every code block of README and docs: TOML is valid, commands parse and run, Python runs."""

from __future__ import annotations

import ast
import json
import linecache
import re
import shlex
import tomllib
from functools import cache

import pytest

import tiltsim
from tests.docs.pages import NOTEBOOKS, PAGES, ROOT, blocks, code
from tests.docs.shell import commands
from tests.docs.test_printed import commands_with_output
from tiltsim.cli import build_parser, main
from tiltsim.errors import DONE, EXPECTATION_FAILED, VEHICLE_LOST, InputError
from tiltsim.logs.reading import LogMap
from tiltsim.scenario.loading import find_scenario_file
from tiltsim.scenario.scenario_tables import ScenarioTables
from tiltsim.studies.checking import collect
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.tables import Sweep

NAMES = [str(page.relative_to(ROOT)) for page in PAGES]
LANGUAGES = {
    "sh",
    "python",
    "toml",
    "xml",
    "yaml",
    "math",
    "{include}",
    "{toctree}",
    "{eval-rst}",
    "",
}
WITH_COMMANDS = [name for name in NAMES if code(name, "sh")]
WITH_TOML = [name for name in NAMES if code(name, "toml") and name != "docs/scenario.md"]
"""Pages with TOML but the one that is generated; tests/commands/test_schema.py has its examples."""

SAVED_AS = {
    "docs/gaits.md": {'title = "My own gait"': "my_gait.toml"},
    "docs/own_vehicle.md": {'title = "My own': "my_flight.toml", "<mujoco": "my_tiltrotor.xml"},
    "docs/own_controller.md": {"import numpy": "my_controller.py"},
    "docs/multirotor.md": {"<mujoco": "own_hexarotor.xml"},
    "docs/supervisor.md": {'title = "Six tilting arms': "arms.toml"},
}
"""Blocks that a page says to save, by their start."""

NOT_RUN = {
    "view": "opens a window; tests/views runs the viewer headless",
    "video": "takes minutes without a GPU; tests/views renders short ones",
    "check": "a step of .ci/run flies the library",
    "report": "takes minutes; tests/report makes one",
    "bench": "a step of .ci/run",
    "arena": "takes minutes; tests/studies/test_arena.py scores given flights",
    "autopilot": "needs the reader's scenario; tests/plants/test_autopilot.py writes the files",
    **dict.fromkeys(("import", "replay", "identify"), "need a log; tests/logs makes some"),
    "compare": "takes minutes; tests/studies/test_comparison.py makes short ones",
}
"""Commands that are parsed but not run, and why."""

FLOWN_ELSEWHERE = {
    "docs/environment.md": "tests/env/test_environment.py and test_vector.py",
    "docs/own_controller.md": "tests/plants/test_user_controller.py",
}
"""Pages whose Python blocks other tests execute, and judge what they fly."""

SMALL_SWEEP = """
scenario = "ch04_tracking/setpoint#rho_0_modified"
[set]
simulation = { duration = 1.0, timestep = 0.002 }
[[axis]]
type = "list"
key = "model_error.mass"
values = [0.9, 1.0, 1.1, 1.2]
"""
"""Flown in place of the sweeps of the pages, which take minutes."""

parser = cache(build_parser)


@pytest.mark.parametrize("name", NAMES)
def test_every_block_names_its_language(name):
    for block in blocks(name):
        assert block.language in LANGUAGES, f"{name}:{block.line}"
        unmarked = block.language == "" and re.search(r"^(\$ |tiltsim [a-z]+ |import )", block.code)
        assert not unmarked, f"{name}:{block.line}: code; name its language"


# --- TOML ----------------------------------------------------------------------------------------


def save_blocks(name, folder):
    """Save the blocks that a page says to save."""
    for start, file in SAVED_AS.get(name, {}).items():
        (text,) = (block.code for block in blocks(name) if block.code.startswith(start))
        functions, _, _flight = text.partition("\n\n\nscenario = ")
        (folder / file).write_text(functions)


def check_toml(text, folder):
    """Validate a whole scenario, a whole sweep, or some tables of either."""
    document = tomllib.loads(text)
    if "columns" in document:
        LogMap.model_validate(document)
        return
    if {"axis", "sample", "bisect"} & document.keys():
        if "scenario" in document:
            (folder / "sweep.toml").write_text(text)
            load_sweep(folder / "sweep.toml")
        else:
            Sweep.model_validate({"scenario": "ch04_tracking/circle#fixed_modified", **document})
        return
    vehicle = document.get("vehicle", {})
    if (folder / vehicle.get("mjcf", "-")).exists():
        vehicle["mjcf"] = str(folder / vehicle["mjcf"])
    if "file" in document.get("gait", {}):  # a reader's own
        table = folder / document["gait"]["file"]
        table.write_text("time,alpha_1,alpha_2,alpha_3,alpha_4\n0,0,0,0,0\n1,0,0,0,0\n")
        document["gait"]["file"] = str(table)
    ScenarioTables.model_validate(document)
    if "title" in document:
        tiltsim.parse_scenario(document)


@pytest.mark.parametrize("name", WITH_TOML)
def test_toml_is_valid(name, tmp_path):
    save_blocks(name, tmp_path)
    for block in blocks(name):
        if block.language == "toml":
            try:
                check_toml(block.code, tmp_path)
            except Exception as error:
                error.add_note(f"{name}:{block.line}")
                raise


@pytest.mark.parametrize(
    "text",
    [
        "[gait]\ntype = 'walk'\namplitud = 0.2",
        "title = 'x'\n[controller]\ndecoupling = 'exact'",
        "[[axis]]\ntype = 'list'\nkey = 'gait.period'",
        "scenario = 'ch04_tracking/circle#no'\n[[axis]]\ntype = 'list'\nkey = 'a.b'\nvalues = [1]",
    ],
)
def test_mistakes_in_toml_are_noticed(text, tmp_path):
    with pytest.raises((ValueError, InputError), match=r"amplitud|Routh|values|no such variant"):
        check_toml(text, tmp_path)


# --- commands ------------------------------------------------------------------------------------


def check_tiltsim(arguments):
    """Parse a command, and look for the scenarios, sweeps and flights that it names."""
    parsed = parser().parse_args(arguments)
    overrides = dict(getattr(parsed, "overrides", []))
    if arguments[0] == "check":
        assert collect(parsed.paths or [str(ROOT / "scenarios")], parsed.word)
    elif arguments[0] == "sweep":
        find_scenario_file(parsed.sweep)
    elif "--controller" in arguments and hasattr(parsed, "scenario"):
        find_scenario_file(parsed.scenario.partition("#")[0])
    elif getattr(parsed, "scenario", None) and not parsed.scenario.endswith(".toml"):
        tiltsim.load_scenario(parsed.scenario, overrides)


def check_tests(arguments):
    """Look for the tests that a command names."""
    for argument in arguments:
        path, _, test = argument.partition("::")
        if path.startswith("tests"):
            assert (ROOT / path).exists(), path
            assert not test or f"def {test}(" in (ROOT / path).read_text(), argument


def check_pip(arguments):
    """Look for the extras that a command names."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for named in re.findall(r"\[([\w,]+)\]", shlex.join(arguments)):
        assert set(named.split(",")) <= extras["optional-dependencies"].keys()


def check_mutation(arguments):
    """Look for the module that a command names."""
    option, module = arguments
    assert option == "--only"
    assert (ROOT / "controllers" / "tiltsim_controllers" / f"{module}.py").exists()


def check_python(arguments):
    """Look for a script, or pass on to the module."""
    if arguments[0] == "-m":
        CHECKS[arguments[1]](arguments[2:])
    else:
        assert (ROOT / arguments[0]).exists()


CHECKS = {
    "tiltsim": check_tiltsim,
    "pytest": check_tests,
    "pip": check_pip,
    "tests.mutation": check_mutation,
    "python": check_python,
    "python3": check_python,
    **dict.fromkeys(("venv", "sphinx", "ruff", "mypy", "git", "dask", "rerun"), lambda _: None),
}
"""How the arguments of each program are checked; others may not stand in a page."""


@pytest.mark.parametrize("name", WITH_COMMANDS)
def test_commands_are_valid(name, tmp_path, capsys):
    for block in blocks(name):
        if block.language == "sh":
            for program, *arguments in commands(block.code, tmp_path):
                try:
                    CHECKS[program](arguments)
                except (Exception, SystemExit) as error:
                    shown = f"{name}:{block.line}: {program} {shlex.join(arguments)}"
                    pytest.fail(f"{shown}: {error} {capsys.readouterr().err}")


def test_commands_are_those_that_bash_would_run(tmp_path):
    block = "for n in a b; do\n  tiltsim run x#$n --out 'o n'  # comment\ndone | head > f && mypy"
    run = [["tiltsim", "run", f"x#{n}", "--out", "o n"] for n in "ab"]
    assert sorted(commands(block, tmp_path)) == [["head"], ["mypy"], *run]


@pytest.mark.parametrize(
    "command",
    [
        "tiltsim run ch04_tracking/setpoint#no",
        "tiltsim gait --figures margin",
        "tiltsim run ch04_tracking/setpoint#rho_0_modified --set gait.angle=1",
        "tiltsim check ch04_trackin",
        "pip install '.[tests]'",
        "python -m pytest tests/docs/test_links.py::test_no",
        "curl https://example.org",
    ],
)
def test_wrong_commands_are_noticed(command, tmp_path, capsys):
    ((program, *arguments),) = commands(command, tmp_path)
    with pytest.raises((Exception, SystemExit)):
        CHECKS[program](arguments)


def test_notebooks_are_stored_without_outputs():
    for notebook in NOTEBOOKS:
        for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
            assert not cell.get("outputs"), notebook.name
            assert cell.get("execution_count") is None, notebook.name


def test_readers_import_public_modules_only():
    sources = {notebook.name: "" for notebook in NOTEBOOKS}
    for notebook in NOTEBOOKS:
        for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
            sources[notebook.name] += "".join(cell["source"]) + "\n"
    sources |= {file.name: file.read_text(encoding="utf-8") for file in ROOT.glob("examples/*.py")}
    sources |= {name: "\n".join(code(name, "python")) for name in NAMES}
    for name, text in sources.items():
        modules = re.findall(r"^ *(?:from|import) (tiltsim\.[\w.]+)", text, re.MULTILINE)
        assert {*modules} <= {"tiltsim.env"}, name


# --- Python, and running it all ------------------------------------------------------------------


def test_python_is_valid():
    for name in NAMES:
        for block in code(name, "python"):
            ast.parse(block, name)


def run_command(call, folder):
    """Run what a page shows, or a small stand-in."""
    program, *arguments = call
    if program != "tiltsim" or arguments[0] in NOT_RUN or tuple(call) in commands_with_output():
        return
    if arguments[0] == "sweep":
        if "--out" not in arguments:
            return
        (folder / "small.toml").write_text(SMALL_SWEEP)
        out = arguments[arguments.index("--out") + 1]
        arguments = ["sweep", "small.toml", "--jobs", "1", "--out", out]
    elif arguments[0] == "run" and not arguments[1].endswith(".toml"):
        # Compiling would take longer; `tiltsim check` flies the library to the end.
        arguments += ["--set", "simulation.duration=0.5"]
    elif arguments[0] == "stability" and "--sweep" in arguments:  # at few points, with long steps
        arguments = [re.sub("(=[^:]+:[^:]+).*", r"\1:2", one) for one in arguments]
        arguments += ["--set", "simulation.timestep=0.0025"]
    elif arguments[0] == "attraction":  # of few flights, as short ones are refused
        arguments += ["--coarse", "2", "--refine", "0"]
    also = EXPECTATION_FAILED if arguments[0] == "map" else VEHICLE_LOST
    assert main(arguments) in {DONE, also}, shlex.join(call)


def run_python(text, names):
    """Execute a block, unless polars reads it: no test installs that, and pandas does the same."""
    if "import polars" not in text:
        for package in re.findall(r"^import (\w+)", text, re.MULTILINE):
            pytest.importorskip(package)
        lines = text.splitlines(keepends=True)
        linecache.cache["<block>"] = len(text), None, lines, "<block>"  # as notebooks do
        exec(compile(text, "<block>", "exec"), names)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in NAMES if code(n, "sh") or code(n, "python")])
def test_pages_run(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mjcf").symlink_to(ROOT / "mjcf")
    (tmp_path / "docs" / "pictures").mkdir(parents=True)  # where a page draws its own
    names = {"__name__": "page"}
    save_blocks(name, tmp_path)
    for block in blocks(name):
        if block.language == "sh":
            for call in commands(block.code, tmp_path):
                run_command(call, tmp_path)
        elif block.language == "python" and name not in FLOWN_ELSEWHERE:
            run_python(block.code, names)
