"""The user's Python code that scenario files name: permission, loading, errors in one line.

The permission is a property of the scenario and goes with it, also to other processes. Reading a
scenario gives none.
"""

import importlib.util
import os
import sys
import traceback
from pathlib import Path
from typing import Any, Final

from tiltsim.errors import InputError
from tiltsim.scenario.controller import OwnFunctionController
from tiltsim.scenario.messages import show
from tiltsim.scenario.scenario import Scenario
from tiltsim.system.arguments import true_or_false
from tiltsim.system.files import digest, is_file
from tiltsim.system.text import error_text

VARIABLE: Final = "TILTSIM_TRUST"
"""Environment variable that, set to 1, stands for ``--trust``."""


def is_trusted(option: bool) -> bool:
    """Whether ``--trust`` is given, or the environment variable in its place."""
    return true_or_false("trusted", option) or os.environ.get(VARIABLE) == "1"


def with_trust(scenario: Scenario, trusted: bool = True) -> Scenario:
    """The scenario with permission to execute the Python code that it names, if it is trusted."""
    if not trusted or not isinstance(scenario.controller, OwnFunctionController):
        return scenario
    allowed = scenario.model_copy()
    allowed._trusted = True
    return allowed


def require_trust(scenario: Scenario) -> None:
    """Raise `InputError` for a scenario that names a file of Python code, without permission."""
    table = scenario.controller
    if not isinstance(table, OwnFunctionController) or table.file is None:
        return
    if not scenario._trusted and scenario.own_controller is None:
        raise InputError(
            f"{scenario.address or 'scenario'}: controller.function = {show(table.function)}: is "
            f"Python code to execute; allow it with --trust or {VARIABLE}=1 "
            "(in Python: load_scenario(..., trusted=True))"
        )


def describe(error: BaseException, own_frames: int = 1) -> str:
    """An error in one line: its type, its message, and the line of the controller's code.

    The first ``own_frames`` calls of its traceback are ours.
    """
    return error_text(error) + _place(error, own_frames)


def _place(error: BaseException, own_frames: int) -> str:
    """The last line of the controller's own file, or function in a notebook, in a traceback."""
    frames = traceback.extract_tb(error.__traceback__)[own_frames:]
    if not frames:
        return ""
    last = [frame for frame in frames if frame.filename == frames[0].filename][-1]
    file = Path(last.filename)
    if not is_file(file):
        return f" (line {last.lineno} of {last.name})"
    return f" ({file.name}, line {last.lineno})"


_LIBRARIES: Final = ("numpy", "jax", "tiltsim", "tiltsim_controllers")


def users_line(error: BaseException) -> str:
    """File and line of the user's own code in the traceback of an error, as ``FILE:LINE: ``.

    Empty where no such code was called.
    """
    loaded = (sys.modules[library] for library in _LIBRARIES if library in sys.modules)
    libraries = tuple(str(Path(str(module.__file__)).parent) for module in loaded)
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not frame.filename.startswith(libraries)]
    return f"{own[-1].filename}:{own[-1].lineno}: " if own else ""


def load_function(scenario: Scenario) -> Any:
    """The callable that the file of a scenario defines under a name.

    Raises `InputError` if there is none, or the scenario may not execute code.
    """
    table = scenario.controller
    assert isinstance(table, OwnFunctionController)
    start = f'{scenario.address or "scenario"}: controller.function = "{table.function}"'
    if table.file is None:
        raise InputError(
            f"{start}: a controller that was given in Python, which no file holds; give it again "
            "as controller= to tiltsim.load_scenario or simulate, or write FILE.py:NAME"
        )
    require_trust(scenario)
    if not is_file(table.file):
        raise InputError(f"{start}: no such file")
    module = _run_file(start, table.file)
    found = getattr(module, table.attribute, None)
    if not callable(found):
        own = [
            name
            for name, value in vars(module).items()
            if callable(value) and getattr(value, "__module__", "") == module.__name__
        ]
        what = "is not callable" if hasattr(module, table.attribute) else "is not in the file"
        raise InputError(f"{start}: {table.attribute} {what}; it has {', '.join(own) or 'none'}")
    return found


def _run_file(start: str, file: Path) -> Any:
    """The module of a file, executed again for every flight."""
    spec = importlib.util.spec_from_file_location(f"tiltsim_controller_{file.stem}", file)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses and pickles look their module up
    try:
        # Compiled from its text, because cached bytecode may be older than a quick edit.
        exec(compile(file.read_bytes(), str(file), "exec"), module.__dict__)
    except SyntaxError as error:
        line = f", line {error.lineno}" if error.lineno else ""
        raise InputError(f"{start}: {error.msg} ({file.name}{line})") from None
    except (Exception, SystemExit) as error:
        raise InputError(f"{start}: raised {describe(error)}") from error
    return module


def load_law(scenario: Scenario) -> Any:
    """The function, or class of functions, of the law ``numpy``: given in Python, or in a file.

    Raises `InputError` as `load_function`.
    """
    table, function = scenario.controller, scenario.own_controller
    assert isinstance(table, OwnFunctionController)
    if function is not None and not isinstance(function, str):
        return function
    require_trust(scenario)  # though it may be loaded already
    content = table.file.read_bytes() if table.file and is_file(table.file) else b""
    known = str(table.file), table.attribute, digest(content)
    if known not in _loaded:
        _loaded[known] = load_function(scenario)
    return _loaded[known]


_loaded: Final[dict[tuple[str, str, str], Any]] = {}
"""Laws by file, name and digest of the file, since each is compiled once."""
