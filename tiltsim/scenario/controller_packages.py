"""Controllers that installed packages bring, by the entry-point group ``tiltsim.controllers``.

An entry point names a law and its table, a subclass of
`tiltsim.scenario.law_controller.LawController`. An entry that cannot be used is left out with a
warning, so that a broken package does not stop flights that do not need it.
"""

import warnings
from collections.abc import Container
from contextlib import suppress
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points
from inspect import isabstract
from typing import Final, get_args

from tiltsim.scenario.controller_table import ControllerTable
from tiltsim.scenario.law_controller import LawController
from tiltsim.system.interrupts import defer_interrupts
from tiltsim.system.text import error_text, printable

GROUP: Final = "tiltsim.controllers"


def installed_controllers(built_in: Container[str]) -> dict[str, type[ControllerTable]]:
    """The tables of all installed packages by the names of their laws.

    If several packages have the same law, the first package by name is taken.
    """
    found: dict[str, type[ControllerTable]] = {}
    owners: dict[str, str] = {}
    entries = [(entry.name, _package(entry.dist), entry) for entry in _entries()]
    for name, package, entry in sorted(entries, key=lambda one: one[:2]):
        with defer_interrupts():  # so that one raised within is the package's own
            loaded = _loaded(entry, built_in)
        if name in owners:
            loaded = f"the package {owners[name]} has a controller of this name"
        if isinstance(loaded, str):
            _warn(f"the controller {name} of the package {package} is left out: {loaded}")
        else:
            found[name], owners[name] = loaded, package
    return found


def _entries() -> list[EntryPoint]:
    """Entries of all packages; a package whose list cannot be read is left out with a warning."""
    try:
        return [*entry_points(group=GROUP)]
    except Exception:
        pass
    found: dict[str, list[EntryPoint]] = {}
    for distribution in distributions():
        package = _package(distribution)
        try:
            found.setdefault(package, [*distribution.entry_points.select(group=GROUP)])
        except Exception as error:
            _warn(f"the package {package} is left out: its entry_points.txt: {error_text(error)}")
    return [entry for entries in found.values() for entry in entries]


def _package(distribution: Distribution | None) -> str:
    """The name of a package, as far as its files tell."""
    with suppress(Exception):
        assert distribution is not None
        return str(distribution.name)
    return "?"


def _warn(text: str) -> None:
    """Warn once, not in the processes that this one starts."""
    from multiprocessing import parent_process  # costs start-up time

    if parent_process() is None:
        warnings.warn(printable(text), RuntimeWarning, stacklevel=3)


def _loaded(entry: EntryPoint, built_in: Container[str]) -> type[ControllerTable] | str:
    """The table of an entry point, or why it cannot be used, whatever its code raises."""
    try:
        table = entry.load()
        if not (isinstance(table, type) and issubclass(table, LawController)):
            return f"{entry.value} is no subclass of tiltsim.LawController"
        if entry.name in built_in:
            return "tiltsim has a law of this name"
        if isabstract(table):
            return f"{entry.value} has no method {', '.join(sorted(table.__abstractmethods__))}"
        if get_args(table.model_fields["law"].annotation) != (entry.name,):
            return f'{entry.value} needs the field law: Literal["{entry.name}"]'
        table.model_json_schema()  # completes the table; tiltsim schema needs it
    except BaseException as error:
        return error_text(error)
    return table
