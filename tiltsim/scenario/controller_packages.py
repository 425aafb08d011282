"""Controllers that installed packages bring, by the entry-point group ``tiltsim.controllers``.

An entry point names a law and its table, a subclass of
`tiltsim.scenario.scalar_controller.ScalarController`. What cannot be used is left out with a
warning, so that a broken package does not stop flights that do not need it.
"""

from __future__ import annotations

import warnings
from collections.abc import Container
from importlib.metadata import EntryPoint, entry_points
from inspect import isabstract
from typing import Final, get_args

from tiltsim.scenario.controller_table import ControllerTable
from tiltsim.scenario.scalar_controller import ScalarController

GROUP: Final = "tiltsim.controllers"


def installed_controllers(built_in: Container[str]) -> dict[str, type[ControllerTable]]:
    """The tables of all installed packages by the names of their laws."""
    found: dict[str, type[ControllerTable]] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        try:
            table = entry.load()
            mistake = _mistake(entry, table, built_in)
        except Exception as error:
            mistake = f"{type(error).__name__}: {error}"
        if mistake:
            package = entry.dist.name if entry.dist is not None else entry.value
            warnings.warn(
                f"the controller {entry.name} of the package {package} is left out: {mistake}",
                RuntimeWarning,
                stacklevel=2,
            )
        else:
            found[entry.name] = table
    return found


def _mistake(entry: EntryPoint, table: object, built_in: Container[str]) -> str:
    """What is wrong with an entry point, or nothing."""
    if not (isinstance(table, type) and issubclass(table, ScalarController)):
        return f"{entry.value} is no subclass of tiltsim.ScalarController"
    if entry.name in built_in:
        return "tiltsim has a law of this name"
    if isabstract(table):
        return f"{entry.value} has no method {', '.join(sorted(table.__abstractmethods__))}"
    if get_args(table.model_fields["law"].annotation) != (entry.name,):
        return f'{entry.value} needs the field law: Literal["{entry.name}"]'
    return ""
