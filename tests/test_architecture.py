"""Order of imports between rooms, and the cost of importing."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from dataclasses import is_dataclass
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import tiltsim
import tiltsim_controllers
from tiltsim.commands import gait_options, look, options
from tiltsim.folders import CONTROLLERS, ENTRANCE, FLYING, FOUNDATION, SHOWING

ROOT = Path(tiltsim.__file__).parent
PACKAGES = {"tiltsim_controllers": Path(tiltsim_controllers.__file__).parent, "tiltsim": ROOT}
FILES = {
    ".".join((name, *file.relative_to(folder).with_suffix("").parts)).removesuffix(
        ".__init__"
    ): file
    for name, folder in PACKAGES.items()
    for file in sorted(folder.rglob("*.py"))
}


def source_of(module, node):
    lines = FILES[module].read_text(encoding="utf-8").splitlines()
    return "\n".join(lines[node.lineno - 1 : node.end_lineno])


@cache
def nodes():
    """All nodes of the syntax tree of every module, the module itself first."""
    trees = {module: ast.parse(file.read_text(encoding="utf-8")) for module, file in FILES.items()}
    return {module: [*ast.walk(tree)] for module, tree in trees.items()}


def trees():
    return {module: tree for module, (tree, *_) in nodes().items()}


ORDER = {
    "tiltsim_controllers": ("__init__", *CONTROLLERS),
    "tiltsim": (*FOUNDATION, *FLYING, *SHOWING, *ENTRANCE),
}
"""Folders and root modules of each package; imports go to the same or to an earlier one."""

FLYING_PREFIXES = tuple(f"tiltsim.{folder}." for folder in FLYING)
HEAVY = {
    *("av", "casadi", "dm_control", "gymnasium", "jax", "matplotlib", "mujoco"),
    *("llvmlite", "pandas", "pyarrow", "pydantic", "rerun", "scipy"),
}

SLOW = {"email", "hashlib", "html", "numpy", "platform"}
"""Not loaded by ``tiltsim --help``: each would add 5 to 150 % to its time."""


def prescribed():
    """Argument lists of the functions that make a closed loop, as its records document them."""
    return {
        signature
        for module, found in nodes().items()
        if module.startswith(("tiltsim.closed_loop.", "tiltsim.equations."))
        for node in found
        if isinstance(node, ast.ClassDef)
        for signature in re.findall(r"``\((.*?)\) ->", source_of(module, node))
    }


def imports(module, found):
    """Every module that a module imports anywhere in its text, `TYPE_CHECKING` blocks included.

    Args:
        module: Its name.
        found: The nodes of its syntax tree.
    """
    package = module if FILES[module].name == "__init__.py" else module.rpartition(".")[0]
    for node in found:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parents, *filter(None, [node.module])])
            # ``from tiltsim.plants import plant`` imports the module tiltsim.plants.plant
            names = (f"{base}.{alias.name}" for alias in node.names)
            yield from (name if name in FILES else base for name in names)


@cache
def imported():
    return {module: {*imports(module, found)} for module, found in nodes().items()}


def place(module):
    """Position of a module in the order: of its package, then of its folder or root module."""
    package, *rest = module.split(".")
    return list(ORDER).index(package), ORDER[package].index(rest[0] if rest else "__init__")


def upward(module, names):
    """Imports of a module that go to a later folder."""
    ours = sorted(name for name in names if name in FILES)
    return [f"{module} imports {name}" for name in ours if place(name) > place(module)]


def roots(module):
    """Names of the packages that a module imports from."""
    return {name.partition(".")[0] for name in imported()[module]}


def modules_loaded_by(*steps):
    """Names of the packages that one program has loaded after each of some steps."""
    shown = "\nprint(*{name.partition('.')[0] for name in {*sys.modules} - before})\n"
    script = "import sys; before = {*sys.modules}\n" + "".join(step + shown for step in steps)
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return [set(line.split()) for line in done.stdout.splitlines()]


@cache
def classes():
    every = (node for found in nodes().values() for node in found)
    return {node.name: node for node in every if isinstance(node, ast.ClassDef)}


def overrides(class_node, name):
    """Whether a base class of ours defines a member of this name, which documents it."""
    known = classes()
    bases = [known[base.id] for base in class_node.bases if getattr(base, "id", "") in known]
    return any(
        any(
            getattr(member, "name", "") == name
            or getattr(getattr(member, "target", None), "id", "") == name  # a class attribute
            for member in base.body
        )
        or overrides(base, name)
        for base in bases
    )


def public_definitions(tree):
    """Functions, classes and their methods with public names, but not setters of properties.

    Methods that override one of a base class are not among them either.
    """
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name, node
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for member in node.body:
                if isinstance(member, ast.FunctionDef) and not member.name.startswith("_"):
                    decorators = {ast.unparse(decorator) for decorator in member.decorator_list}
                    setter = f"{member.name}.setter" in decorators
                    if not setter and not overrides(node, member.name):
                        yield f"{node.name}.{member.name}", member


def test_every_folder_and_module_has_its_place_in_the_order():
    for package, folder in PACKAGES.items():
        found = {file.stem for file in folder.glob("*.py")}
        found |= {init.parent.name for init in folder.glob("*/__init__.py")}
        assert found == set(ORDER[package])


def test_imports_go_to_the_same_or_an_earlier_folder():
    # The package itself imports its public names on first use.
    modules = [module for module in FILES if module != "tiltsim"]
    assert [line for module in modules for line in upward(module, imported()[module])] == []


def test_an_upward_import_is_noticed():
    module, text = "tiltsim.scenario.loading", "def f():\n    from tiltsim.plants import plant\n"
    assert upward(module, {*imports(module, ast.walk(ast.parse(text)))}) == [
        "tiltsim.scenario.loading imports tiltsim.plants.plant"
    ]


def test_no_modules_import_each_other():
    ours = {module: imported()[module] & (FILES.keys() - {module}) for module in FILES}
    TopologicalSorter(ours).prepare()  # raises CycleError, which names the circle


def test_few_modules_lie_directly_in_the_package():
    assert len(list(ROOT.glob("*.py"))) <= 8


def test_controllers_know_neither_mujoco_nor_the_testbed():
    modules = [module for module in FILES if module.startswith("tiltsim_controllers")]
    assert not set().union(*map(roots, modules)) & {"mujoco", "dm_control", "tiltsim", "llvmlite"}


def test_flying_needs_no_library_for_screens():
    flying = [module for module in FILES if module.startswith(FLYING_PREFIXES)]
    assert not set().union(*map(roots, flying)) & {"argparse", "av", "matplotlib", "rerun", "tqdm"}


def test_every_step_loads_only_what_it_needs(tmp_path):
    """The simulator only to fly, and no compiler for a saved flight of the engine in Python."""
    tables = {"simulation": {"duration": 0.01, "engine": "python"}}
    flight = f"tiltsim.simulate(tiltsim.parse_scenario({tables}))"
    parser, analysis, scenario, saved = modules_loaded_by(
        "import tiltsim.cli; tiltsim.cli.build_parser()",
        "import tiltsim.studies.gait_analysis, tiltsim_controllers.analysis.published_gaits, "
        "tiltsim_controllers.analysis.attainable",
        "tiltsim.load_scenario('ch04_tracking/setpoint#rho_065_modified')",
        f"{flight}.save({str(tmp_path)!r})",
    )
    assert "tiltsim" in parser
    assert not parser & (HEAVY | SLOW)
    assert not (analysis | scenario) & (HEAVY - {"pydantic"})
    assert "mujoco" in saved
    assert not saved & (HEAVY - {"mujoco", "dm_control", "pydantic", "pyarrow"})


def test_every_public_name_of_the_package_resolves():
    for name in tiltsim.__all__:
        assert getattr(tiltsim, name).__name__ == name
    assert set(tiltsim.__all__) <= set(dir(tiltsim))


def test_an_unknown_name_of_the_package_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = tiltsim.no_such_name


FOUR_ROTORS = {"ROTORS", "SPIN", "TILT_FIELDS", "ROTOR_FIELDS", "TILTROTOR_FIELDS", "four"}
"""Names that presume the four rotors of the thesis's vehicles."""

OF_FOUR_ROTORS = {
    *("quadrotor", "linearizing"),
    *("cross", "metrics", "user_vehicle", "vehicle_parts"),
    *("attitude_plane", "concepts", "gait_analysis", "vehicle_drawing"),
    *("attainable", "fault_tolerance", "rotorcraft", "singularity"),
}
"""The last names of modules that know these vehicles: their laws, models, tables, and figures."""


def test_modules_for_any_number_of_rotors_do_not_know_four():
    importing = {
        module
        for module, found in nodes().items()
        for node in found
        if isinstance(node, ast.ImportFrom) and FOUR_ROTORS & {name.name for name in node.names}
    }
    others = {module for module in importing if "tilt_car" not in module}
    assert {module.rpartition(".")[2] for module in others} == OF_FOUR_ROTORS
    general = ("tiltsim.closed_loop.", "tiltsim.laws.layers.", "tiltsim.laws.rotor_loop")
    assert not [module for module in importing if module.startswith(general)]


KINDS = [path.stem for path in sorted((ROOT / "scenario" / "kinds").glob("[a-z]*.py"))]
MODELS = {*KINDS, "multirotor", "quadrotor", "tiltrotor"}

ABOUT_A_KIND = {
    # declarations: tables, models, loops and laws of rotorcraft
    *("tiltsim.scenario.vehicle", "tiltsim.scenario.rotorcraft", "tiltsim.models.rotorcraft"),
    *("tiltsim.scenario.linearizing_controllers", "tiltsim.laws.linearizing"),
    *("tiltsim.laws.quadrotor", "tiltsim.models.vehicle_parts"),
    # of rotorcraft alone, or of the thesis's chapters and vehicles
    *("tiltsim.models.starters", "tiltsim.studies.multirotor_analysis", "tiltsim.studies.arena"),
    *("tiltsim.commands.gait", "tiltsim.commands.thesis", "tiltsim.views.figures.vehicle_drawing"),
    *("tiltsim.report.findings", "tiltsim.report.content"),
    *("tiltsim.report.measures", "tiltsim.report.measures.slips"),
    "tiltsim.folders",  # has a folder of this name
    "tiltsim.commands.look",  # panels in a text of help
}
"""Modules that may name a kind of vehicle, apart from the files of a kind itself."""


JOINTS = dict.fromkeys(map(ord, "-_ "))
"""Between the words of a name, if anything; for `str.translate`, which removes them."""


def naming(text, inside):
    """Kinds that a module names: by files anywhere in the text, by models as a whole string."""
    spelled = text.lower().translate(JOINTS)
    strings = {node.value for node in inside if isinstance(node, ast.Constant)}
    return {kind for kind in KINDS if kind.translate(JOINTS) in spelled} | strings & MODELS


def test_shared_modules_name_no_kind_of_vehicle():
    """They ask the vehicle's table and the loop, and a new kind has its files alone."""
    found = {
        module
        for module, file in FILES.items()
        if naming(file.read_text("utf-8"), nodes()[module])
        and not any(kind in module for kind in KINDS)
    }
    assert found == ABOUT_A_KIND


def test_a_kind_that_a_shared_module_names_is_noticed():
    for text in ('is_fixed = vehicle.model == "quadrotor"\n', "# as of the tilt-car\n"):
        assert naming(text, ast.walk(ast.parse(text))), text


def test_every_public_definition_has_a_docstring():
    assert [module for module, tree in trees().items() if not ast.get_docstring(tree)] == []
    bare = [
        f"{module}.{name}"
        for module, tree in trees().items()
        for name, node in public_definitions(tree)
        if not ast.get_docstring(node)
    ]
    assert bare == []


def documented_arguments(docstring):
    """Names in the Args section of a docstring; several may share a line."""
    section = re.search(r"^Args:\n((?:    .*\n|\n)*)", docstring + "\n", re.MULTILINE)
    heads = re.findall(
        r"^    ([\w*, ]+)(?: \(.*?\))?:", section[1] if section else "", re.MULTILINE
    )
    return {name.strip(" *") for head in heads for name in head.split(",")}


def test_every_public_function_documents_its_arguments():
    """From four arguments on; a signature that a record prescribes is documented there.

    Options that several commands share are documented where they are declared.
    """
    bare = []
    kinds = {**vars(options)}
    kinds |= {**vars(gait_options), **vars(look)}
    options_of_commands = [getattr(kind, "__metadata__", ()) for kind in kinds.values()]
    shared = {name for name, found in zip(kinds, options_of_commands) if found and found[0].help}
    shared |= {name for name, kind in kinds.items() if is_dataclass(kind)}
    for module, tree in trees().items():
        for name, node in public_definitions(tree):
            if isinstance(node, ast.FunctionDef):
                arguments = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
                kept = [a for a in arguments if getattr(a.annotation, "id", "") not in shared]
                names = [a.arg for a in kept if a.arg not in {"self", "cls"}]
                missing = {*names} - documented_arguments(ast.get_docstring(node))
                if len(names) >= 4 and missing and not prescribed() & {", ".join(names)}:
                    bare.append(f"{module}.{name}: {', '.join(sorted(missing))}")
    assert bare == []


def test_the_page_on_the_architecture_lists_all_folders_in_their_order():
    page = (ROOT.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE) == [*CONTROLLERS, *FLYING, *SHOWING]
    paths = set(re.findall(r"`((?:tiltsim|controllers|tests)/[a-z_/]+(?:\.py)?)`", page))
    assert [path for path in sorted(paths) if not (ROOT.parent / path).exists()] == []


POSIX_ONLY = {
    *("fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"),
    *(f"os.O_{flag}" for flag in ("CLOEXEC", "DIRECTORY", "NOFOLLOW", "NONBLOCK")),
    *("os.chown", "os.chroot", "os.fork", "os.forkpty", "os.getloadavg", "os.mkfifo", "os.nice"),
    *("os.getegid", "os.geteuid", "os.getgid", "os.getgroups", "os.getuid", "os.setuid"),
    *("os.getpgid", "os.getpgrp", "os.killpg", "os.setpgid", "os.setsid", "os.wait"),
    *("os.pread", "os.pwrite", "os.sched_getaffinity", "os.sysconf", "os.uname"),
    *("signal.alarm", "signal.pthread_sigmask", "signal.setitimer", "signal.sigwait"),
    *("signal.SIG_BLOCK", "signal.SIG_SETMASK", "signal.SIG_UNBLOCK", "signal.SIGALRM"),
    *("signal.SIGCHLD", "signal.SIGCONT", "signal.SIGHUP", "signal.SIGKILL", "signal.SIGPIPE"),
    *("signal.SIGQUIT", "signal.SIGSTOP", "signal.SIGUSR1", "signal.SIGUSR2"),
    *("/dev/", "/etc/", "/proc/", "/sys/", "/tmp"),
}
"""Modules, attributes and beginnings of paths that Windows does not have."""

GUARDED = {
    "tiltsim.engines.machine_code": {"os.getuid"},
    "tiltsim.report.making": {"/proc/"},
    "tiltsim.studies.benchmark": {"/proc/", "resource"},
    "tiltsim.system.files": {"fcntl", "os.O_NOFOLLOW"},
    "tiltsim.system.processes": {
        "signal.SIG_BLOCK",
        "signal.SIG_SETMASK",
        "signal.pthread_sigmask",
    },
}
"""Where they are used, with an alternative in the same function."""


def test_posix_features_are_guarded():
    found = {}
    for module, (tree, *inside) in nodes().items():
        used = imported()[module] & POSIX_ONLY
        for node in inside:
            if isinstance(node, ast.Attribute):
                used |= {ast.unparse(node)} & POSIX_ONLY
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                used |= {name for name in POSIX_ONLY if "/" in name and node.value.startswith(name)}
        if used:
            found[module] = used
        top_level = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
        at_the_top = {*imports(module, top_level)}
        assert not at_the_top & POSIX_ONLY, module
    assert found == GUARDED


def test_modules_and_functions_fit_the_reader():
    """Modules of at most 400 lines, functions of at most 80."""
    modules = {name: len(file.read_text("utf-8").splitlines()) for name, file in FILES.items()}
    functions = {
        f"{module}.{node.name}": node.end_lineno - node.lineno + 1
        for module, found in nodes().items()
        for node in found
        if isinstance(node, ast.FunctionDef)
    }
    assert [name for name, lines in modules.items() if lines > 400] == []
    assert [name for name, lines in functions.items() if lines > 80] == []
