"""Arguments given in Python, as the values that a scenario file would have."""

from collections.abc import Iterator, Mapping
from os import PathLike, fsdecode
from typing import Any

from tiltsim.errors import InputError
from tiltsim.scenario.limits import MAX_DEPTH
from tiltsim.system.text import short_repr, shortened


def check_keys(name: str, mapping: object) -> None:
    """Raise `InputError` unless an argument is a dict whose keys are text."""
    if not isinstance(mapping, Mapping):
        raise InputError(f"{name} = {short_repr(mapping)}: must be a dict")
    for key in mapping:
        if not isinstance(key, str):
            raise InputError(f"{name}: key {short_repr(key)}: must be text, as 'gait.period'")


def controller_name(controller: object) -> str:
    """The name that a controller given in Python has in the scenario, or ``FILE.py:NAME`` as it is.

    Raises `InputError` if it can be no controller.
    """
    if isinstance(controller, str) and ".py:" in controller:
        return controller
    if not callable(controller):
        raise InputError(f"controller = {short_repr(controller)}: must be callable or FILE.py:NAME")
    named = controller if hasattr(controller, "__qualname__") else type(controller)
    return f"{named.__module__}.{named.__qualname__}"


def given_keys(name: str) -> set[str]:
    """The keys of a scenario that a controller, reference or gait given in Python stands for."""
    keys = ("law", "function") if name == "controller" else ("type", "file", "rows")
    return {name, *(f"{name}.{key}" for key in keys)}


def check_no_other(overrides: Mapping[str, Any], given: Mapping[str, object]) -> None:
    """Raise `InputError` if overrides name another controller, reference or gait than is given."""
    for name, value in given.items():
        for key in overrides:
            if key.partition("[")[0] not in given_keys(name):
                continue
            shown = controller_name(value) if name == "controller" else short_repr(value)
            raise InputError(
                f"{key} = {short_repr(overrides[key])}: contradicts the given {name} "
                f"{shortened(shown)}; leave one of them out"
            )


def own_title(document: Mapping[str, Any]) -> str:
    """A title for a flight with parts that were given in Python; empty if there are none."""
    controller, *tables = (document.get(name) for name in ("controller", "reference", "gait"))
    parts = []
    if isinstance(controller, Mapping) and isinstance(name := controller.get("function"), str):
        parts.append(f"controller {name.rpartition(':')[2].rpartition('.')[2]}")
    for name, table in zip(("reference", "gait"), tables, strict=True):
        if isinstance(table, Mapping) and table.get("type") == "table":
            parts.append(name)
    return f"Own {', '.join(parts)}" if parts else ""


def plain(value: Any, depth: int = 0) -> Any:
    """A copy of a document with arrays and their entries as lists and numbers, paths as text."""
    if depth > MAX_DEPTH:
        raise InputError(f"scenario: tables and lists nest more than {MAX_DEPTH} deep")
    if isinstance(value, Mapping):
        return {key: plain(item, depth + 1) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, depth + 1) for item in value]
    if isinstance(value, PathLike):
        return fsdecode(value)
    return value.tolist() if hasattr(value, "tolist") else value


def leaves(tables: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """The values of nested tables by dotted key."""
    for name, value in tables.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{before}{name}.")
        else:
            yield before + name, value
