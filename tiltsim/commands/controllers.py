"""Controllers that the command line names, with gains of their own."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tiltsim.errors import InputError
from tiltsim.scenario.override_keys import parse_override
from tiltsim.studies.comparison import controller_tables


def chosen_controllers(arguments: argparse.Namespace) -> dict[str, Mapping[str, Any]]:
    """The tables of ``--controllers`` and ``--controller``, by name."""
    chosen = controller_tables(names(arguments.controllers))
    for text in arguments.controller:
        name, table = _own(text)
        if name in chosen:
            raise InputError(f"--controller {text}: {name} is there twice; choose another name")
        chosen[name] = table
    return chosen


def names(text: str) -> list[str]:
    """What an option lists."""
    return list(dict.fromkeys(filter(None, (name.strip() for name in text.split(",")))))


def _own(text: str) -> tuple[str, dict[str, Any]]:
    """Name and table of ``NAME={law = ..., KEY = VALUE, ...}`` or ``FILE.py:FUNCTION``."""
    if "=" not in text and ".py:" in text:
        return text.rpartition(":")[2], {"law": "scalar", "function": _absolute(text)}
    name, table = parse_override(text) if "=" in text else (text, None)
    if not isinstance(table, dict) or not isinstance(table.get("law"), str):
        raise InputError(
            f'--controller {text}: write NAME={{law="pid", KEY=VALUE, ...}} or FILE.py:FUNCTION'
        )
    if isinstance(table.get("function"), str):
        table["function"] = _absolute(table["function"])
    return name, table


def _absolute(function: str) -> str:
    """Of this folder, as the scenario's files are elsewhere."""
    file, colon, name = function.rpartition(":")
    return f"{Path(file).resolve()}{colon}{name}" if file else function
