"""Which part may know which, and what importing costs."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import controllers
import tiltsim

PACKAGES = {
    "controllers": Path(controllers.__file__).parent,
    "tiltsim": Path(tiltsim.__file__).parent,
}
FILES = {
    ".".join((name, *file.relative_to(folder).with_suffix("").parts)).removesuffix(
        ".__init__"
    ): file
    for name, folder in PACKAGES.items()
    for file in sorted(folder.rglob("*.py"))
}
TREES = {module: ast.parse(file.read_text(encoding="utf-8")) for module, file in FILES.items()}

CORE = (
    *("model", "simulation", "scenario", "metrics", "flight", "plants", "engine", "loop"),
    *("loops", "controller_tables"),
)
SCREENS = ("__main__", "cli", "commands", "figures", "report", "rerun_stream", "video")
"""First letters of the modules that show flights; nothing that computes them may need one."""

HEAVY = {"av", "mujoco", "numba", "matplotlib", "rerun", "pyarrow", "dm_control", "pydantic"}

in_every_module = pytest.mark.parametrize("module", TREES)


def imports(module):
    """Every module that a module imports anywhere in its text, `TYPE_CHECKING` blocks included."""
    package = module if FILES[module].name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parents, *filter(None, [node.module])])
            yield base
            # ``from tiltsim import model`` imports the module tiltsim.model
            yield from (name for a in node.names if (name := f"{base}.{a.name}") in TREES)


def shows(module):
    package, _, rest = module.partition(".")
    return package == "tiltsim" and rest.startswith(SCREENS)


def reachable(module):
    """All modules of ours that a module leads to, itself included."""
    seen, waiting = set(), [module]
    while waiting:
        this = waiting.pop()
        if this in TREES and this not in seen:
            seen.add(this)
            waiting.extend(imports(this))
    return seen


def modules_loaded_by(code):
    script = f"import sys\n{code}\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def public_definitions(tree):
    """Functions, classes and their methods with public names, but not setters of properties."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name, node
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for member in node.body:
                if isinstance(member, ast.FunctionDef) and not member.name.startswith("_"):
                    decorators = {ast.unparse(decorator) for decorator in member.decorator_list}
                    if f"{member.name}.setter" not in decorators:
                        yield f"{node.name}.{member.name}", member


def test_the_core_modules_named_here_exist():
    assert {f"tiltsim.{name}" for name in CORE} <= set(TREES)
    assert shows("tiltsim.cli")
    assert shows("tiltsim.commands.run")


@pytest.mark.parametrize("module", [name for name in TREES if name.startswith("controllers")])
def test_controllers_know_neither_mujoco_nor_the_testbed(module):
    roots = {name.partition(".")[0] for name in imports(module)}
    assert not roots & {"mujoco", "dm_control", "tiltsim", "numba"}


@pytest.mark.parametrize("name", CORE)
def test_the_core_leads_to_no_screen(name):
    assert sorted(filter(shows, reachable(f"tiltsim.{name}"))) == []


@pytest.mark.parametrize("name", CORE)
def test_the_core_needs_no_library_for_screens(name):
    roots = {
        imported.partition(".")[0]
        for module in reachable(f"tiltsim.{name}")
        for imported in imports(module)
    }
    assert not roots & {"argparse", "av", "matplotlib", "rerun", "tqdm"}


@in_every_module
def test_only_the_command_line_knows_commands(module):
    if module in {"tiltsim.__main__", "tiltsim.cli"} or module.startswith("tiltsim.commands"):
        return
    assert not [name for name in imports(module) if name.startswith("tiltsim.c") and shows(name)]


@pytest.mark.parametrize(
    "code",
    ["import tiltsim", "import tiltsim.cli", "import tiltsim.cli; tiltsim.cli.build_parser()"],
)
def test_importing_is_cheap(code):
    loaded = modules_loaded_by(code)
    assert "tiltsim" in loaded
    assert not loaded & HEAVY


def test_reading_a_scenario_does_not_load_the_simulator():
    code = "import tiltsim; tiltsim.load_scenario('ch04_tracking/setpoint#rho_065_modified')"
    assert not modules_loaded_by(code) & (HEAVY - {"pydantic"})


def test_every_public_name_of_the_package_resolves():
    for name in tiltsim.__all__:
        assert getattr(tiltsim, name).__name__ == name
    assert set(tiltsim.__all__) <= set(dir(tiltsim))


def test_an_unknown_name_of_the_package_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = tiltsim.no_such_name


@in_every_module
def test_every_public_definition_has_a_docstring(module):
    assert ast.get_docstring(TREES[module]), "the module has none"
    bare = [name for name, node in public_definitions(TREES[module]) if not ast.get_docstring(node)]
    assert bare == []
