"""The user's own Python: code in files that scenarios name, and parts given as arguments.

The permission to execute code is a property of the scenario and goes with it, also to other
processes. Reading a scenario gives none.
"""

import ast
import importlib.util
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from math import ceil
from os import PathLike
from pathlib import Path
from typing import Any, Final

import numpy as np

from tiltsim.errors import InputError
from tiltsim.scenario.controller import NumpyController, OwnFunctionController
from tiltsim.scenario.documents import controller_name, given_keys
from tiltsim.scenario.gait import TableGait
from tiltsim.scenario.law_controller import LawController, is_law
from tiltsim.scenario.library import MAX_ROWS
from tiltsim.scenario.messages import show, tags_of
from tiltsim.scenario.reference import TableReference
from tiltsim.scenario.scenario import Scenario
from tiltsim.scenario.simulation_table import SimulationTable
from tiltsim.scenario.time_table import TimeTable, rows_of_columns
from tiltsim.system.arguments import is_finite, real_array, true_or_false
from tiltsim.system.files import digest, is_file
from tiltsim.system.text import error_text, short_repr
from tiltsim_controllers.mathematics.scalar import Values

VARIABLE: Final = "TILTSIM_TRUST"  # environment variable that, set to 1, stands for ``--trust``


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


_LIBRARIES: Final = ("numpy", "jax", "tiltsim", "tiltsim_controllers")


def _users_frame(error: BaseException) -> traceback.FrameSummary | None:
    """The last call in the user's own file in the traceback of an error; None without one."""
    loaded = (sys.modules[library] for library in _LIBRARIES if library in sys.modules)
    libraries = tuple(f"{Path(str(module.__file__)).parent}{os.sep}" for module in loaded)
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not frame.filename.startswith(libraries)]
    return [frame for frame in own if frame.filename == own[0].filename][-1] if own else None


def describe(error: BaseException) -> str:
    """An error in one line: its type, its message, and the line of the controller's code."""
    frame = _users_frame(error)
    if frame is None:
        return error_text(error)
    file = Path(frame.filename)
    in_file = f"{file.name}, line {frame.lineno}"
    place = in_file if is_file(file) else f"line {frame.lineno} of {frame.name}"
    return f"{error_text(error)} ({place})"


def users_line(error: BaseException) -> str:
    """File and line of the user's own code in the traceback of an error, as ``FILE:LINE: ``.

    Empty where no such code was called.
    """
    frame = _users_frame(error)
    return f"{frame.filename}:{frame.lineno}: " if frame else ""


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

SAMPLING_STEP: Final = 0.01
"""Seconds between the rows of a function of time, unless the flight is too long for that."""

TABLES: Final[dict[str, type[TimeTable]]] = {"reference": TableReference, "gait": TableGait}
"""Parts that can be given as a table over time."""

KEPT_KEYS: Final = ("roll", "pitch", "yaw", "acceleration_feedforward")
"""Keys of a reference that stay when another motion is given."""


def replace_tables(document: dict[str, Any], given: Mapping[str, object]) -> None:
    """Replace a scenario's reference and gait by tables; a function's table has no rows yet.

    Args:
        document: Changed in place.
        given: Reference and gait by name; see `tiltsim.load_scenario`.

    Raises:
        InputError: In one line: the argument, the value and the allowed values.
    """
    for name in filter(given.__contains__, TABLES):
        old, kept = document.get(name), KEPT_KEYS if name == "reference" else ()
        stays = {key: old[key] for key in kept if key in old} if isinstance(old, dict) else {}
        document[name] = _table(name, given[name]) | stays


def given_parts(**parts: object) -> dict[str, object]:
    """The arguments of `tiltsim.load_scenario` that are given; a law with its keys as its class."""
    return {
        name: type(part) if isinstance(part, LawController) else part
        for name, part in parts.items()
        if part is not None
    }


def controller_table(controller: object) -> dict[str, Any]:
    """The table of a scenario for a controller given in Python; see `tiltsim.load_scenario`."""
    if not is_law(controller):
        law = "numpy" if isinstance(controller, str) and _marks_law(controller) else "python"
        return {"law": law, "function": controller_name(controller)}
    keys: dict[str, Any] = {}
    if isinstance(controller, LawController):
        keys = controller.model_dump(mode="json", exclude_unset=True, exclude={"law"})
        controller = type(controller)
    table: dict[str, Any] = {"law": "numpy", "function": controller_name(controller)}
    if isinstance(controller, type) and issubclass(controller, LawController):
        table |= {"states": controller.states, "discrete_states": controller.discrete_states}
    table |= {name: keys.pop(name) for name in [*keys] if name in NumpyController.model_fields}
    return table | {"parameters": keys}


def _marks_law(function: str) -> bool:
    """Whether ``FILE.py:NAME`` is a function marked ``@tiltsim.law``; the file is not executed."""
    file, _, name = function.rpartition(":")
    try:
        module = ast.parse(Path(file).read_bytes() if is_file(file) else b"")
    except (OSError, ValueError, SyntaxError, RecursionError):  # its execution reports it
        return False
    marks = (
        ast.unparse(mark).rpartition(".")[2]
        for node in module.body
        if isinstance(node, ast.FunctionDef) and node.name == name
        for mark in node.decorator_list
    )
    return "law" in marks


def drop_what_own_controllers_ignore(
    document: Mapping[str, Any], overrides: Mapping[str, Any]
) -> None:
    """Drop the feed-forward key, which user controllers ignore, unless overrides give it."""
    law, reference = document["controller"]["law"], document.get("reference")
    is_given = "reference.acceleration_feedforward" in overrides
    if law in ("python", "numpy") and isinstance(reference, dict) and not is_given:
        reference.pop("acceleration_feedforward", None)


def kept_functions(
    source: object, overrides: Mapping[str, Any], given: Mapping[str, object]
) -> dict[str, Any]:
    """The functions and controllers of a scenario by name: new ones, and its source's if kept.

    Args:
        source, overrides: See `tiltsim.load_scenario`.
        given: Its other arguments.
    """
    keys = {key.partition("[")[0] for key in overrides}
    own = source._own if isinstance(source, Scenario) else {}
    kept = {n: part for n, part in own.items() if n not in given and not given_keys(n) & keys}
    return kept | {name: part for name, part in given.items() if callable(part)}


def sample_functions(document: Mapping[str, Any], own: Mapping[str, Any]) -> None:
    """Sample functions of time over the flight, into the rows of their tables.

    Args:
        document: A scenario's, changed in place.
        own: The functions by name, from `kept_functions`.
    """
    simulation = document.get("simulation")
    duration = simulation.get("duration") if isinstance(simulation, Mapping) else None
    if not is_finite(duration) or duration <= 0.0:  # is refused where all is checked
        duration = SimulationTable.model_fields["duration"].default
    # A flight of less than ten steps is sampled beyond its end.
    span = max(duration, 10 * SAMPLING_STEP)
    for name in filter(own.__contains__, TABLES):
        table = document.get(name)
        rows = table.get("rows") if isinstance(table, Mapping) else None
        if isinstance(rows, list) and (not rows or rows[-1][0] != span):
            columns = TABLES[name].columns_of_width(1 + _size_of(own[name]))
            rows[:] = _samples(name, own[name], len(columns) - 1, span)


def _size_of(function: Callable[[float], Any]) -> int:
    """Number of values that a function of time returns; 0 if it returns no vector."""
    try:
        values = real_array(function(0.0))
    except Exception:
        return 0
    return values.size if values.ndim == 1 else 0


def _table(name: str, value: Any) -> dict[str, Any]:
    """The table of a scenario for an argument."""
    kind = value.get("type") if isinstance(value, Mapping) else value
    if isinstance(kind, str) and kind in tags_of(Scenario, (name,))[1]:
        hint = f'override {{"{name}.type": "{kind}"}} for one of the built-in types'
        raise InputError(f"{name} = {short_repr(value)}: must be your own {name}; {hint}")
    if isinstance(value, str | PathLike):
        return {"type": "table", "file": value}
    if callable(value):
        return {"type": "table", "rows": [], "hold": False}
    if not (isinstance(value, Mapping) or hasattr(value, "columns")):
        raise InputError(
            f"{name} = {short_repr(value)}: must be a function of time, the name of a CSV or "
            f"Parquet file, or a table with the columns {', '.join(TABLES[name].columns)}"
        )
    try:
        return {"type": "table", "rows": rows_of_columns(value, TABLES[name].columns_among)}
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _samples(
    name: str, function: Callable[[float], Any], size: int, span: float
) -> Iterator[Values]:
    """Rows of a function of time in even steps."""
    steps = min(MAX_ROWS - 1, ceil(span / SAMPLING_STEP))
    for time in np.linspace(0.0, span, steps + 1).tolist():
        try:
            returned = function(time)
        except Exception as error:
            what = " ".join(f"{type(error).__name__}: {error}".split())
            raise InputError(f"{name}({time:g}) raised {what}") from error
        try:
            values = real_array(returned)
        except (TypeError, ValueError):
            values = np.array(np.nan)
        if values.shape != (size,) or not np.isfinite(values).all():
            shown = short_repr(returned)
            pose = ", or 6 with roll, pitch and yaw" if name == "reference" and size == 3 else ""
            raise InputError(f"{name}({time:g}) = {shown}: must be {size} finite numbers{pose}")
        yield (time, *values.tolist())
