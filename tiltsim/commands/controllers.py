"""Controllers that the command line names, with their gains."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tiltsim.commands.declaring import mistakes_in
from tiltsim.scenario.controller import CONTROLLERS
from tiltsim.scenario.documents import parse_override
from tiltsim.scenario.messages import choose
from tiltsim.studies.comparison import controller_tables
from tiltsim.system.files import is_file


def chosen_controllers(laws: Sequence[str], own: Sequence[str]) -> dict[str, Mapping[str, Any]]:
    """The tables of ``--controllers`` and ``--controller``, by name. Raises `InputError`."""
    chosen = controller_tables(laws)
    for text in own:
        with mistakes_in(f"--controller {text}"):
            name, table = _own(text)
            if name in chosen:
                raise ValueError(f"{name} is there twice; choose another name")
            chosen[name] = table
    return chosen


def _own(text: str) -> tuple[str, dict[str, Any]]:
    """Name and table of ``NAME={law = ..., KEY = VALUE, ...}`` or ``FILE.py:FUNCTION``.

    Raises ValueError for a law or key that does not exist: no vehicle would take it.
    """
    if "=" not in text and ".py:" in text:
        return text.rpartition(":")[2], {"law": "numpy", "function": _absolute(text)}
    name, table = parse_override(text) if text.find("=") > 0 else (text, None)
    if not isinstance(table, dict) or not isinstance(table.get("law"), str):
        raise ValueError('write NAME={law="pid", KEY=VALUE, ...} or FILE.py:FUNCTION')
    law = table["law"]
    if law not in CONTROLLERS:
        raise ValueError(f"law: {choose(law, CONTROLLERS)}")
    known = CONTROLLERS[law].model_fields
    for key in table:
        if key not in known:
            raise ValueError(f"{key}: {choose(key, known)}")
    if isinstance(table.get("function"), str):
        table["function"] = _absolute(table["function"])
    return name, table


def _absolute(function: str) -> str:
    """A function of a file of the working folder, for scenarios of other folders."""
    file, colon, name = function.rpartition(":")
    if file and not is_file(Path(file)):
        raise ValueError(f"{file}: no such file")
    return f"{Path(file).resolve()}{colon}{name}" if file else function
