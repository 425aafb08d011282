"""Controllers that the command line names, with gains of their own."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tiltsim.errors import InputError
from tiltsim.scenario.controller import CONTROLLERS
from tiltsim.scenario.messages import choose
from tiltsim.scenario.override_keys import parse_override
from tiltsim.studies.comparison import controller_tables
from tiltsim.system.files import is_file


def chosen_controllers(arguments: argparse.Namespace) -> dict[str, Mapping[str, Any]]:
    """The tables of ``--controllers`` and ``--controller``, by name."""
    chosen = controller_tables(names("--controllers", arguments.controllers))
    for text in arguments.controller:
        name, table = _own(text)
        if name in chosen:
            raise InputError(f"--controller {text}: {name} is there twice; choose another name")
        chosen[name] = table
    return chosen


def names(option: str, text: str | None) -> list[str]:
    """What an option lists, nothing without it. Raises `InputError` for an empty list."""
    if text is None:
        return []
    listed = list(dict.fromkeys(filter(None, (name.strip() for name in text.split(",")))))
    if not listed:
        raise InputError(f"{option} {text!r}: name one at least")
    return listed


def _own(text: str) -> tuple[str, dict[str, Any]]:
    """Name and table of ``NAME={law = ..., KEY = VALUE, ...}`` or ``FILE.py:FUNCTION``."""
    if "=" not in text and ".py:" in text:
        return text.rpartition(":")[2], {"law": "scalar", "function": _absolute(text, text)}
    name, table = parse_override(text) if text.find("=") > 0 else (text, None)
    if not isinstance(table, dict) or not isinstance(table.get("law"), str):
        raise InputError(
            f'--controller {text}: write NAME={{law="pid", KEY=VALUE, ...}} or FILE.py:FUNCTION'
        )
    _check(text, table)
    if isinstance(table.get("function"), str):
        table["function"] = _absolute(table["function"], text)
    return name, table


def _check(text: str, table: Mapping[str, Any]) -> None:
    """Raise `InputError` for a law or key that does not exist: no vehicle would take it."""
    law = table["law"]
    if law not in CONTROLLERS:
        raise InputError(f"--controller {text}: law: {choose(law, CONTROLLERS)}")
    known = [*CONTROLLERS[law].model_fields]
    for key in table:
        if key not in known:
            raise InputError(f"--controller {text}: {key}: {choose(key, known)}")


def _absolute(function: str, text: str) -> str:
    """Of this folder, as the scenario's files are elsewhere."""
    file, colon, name = function.rpartition(":")
    if file and not is_file(Path(file)):
        raise InputError(f"--controller {text}: {file}: no such file")
    return f"{Path(file).resolve()}{colon}{name}" if file else function
