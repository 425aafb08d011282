"""Arguments given in Python, as the values that a scenario file would have."""

from __future__ import annotations

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


def check_one_controller(overrides: Mapping[str, Any], controller: object) -> None:
    """Raise `InputError` if overrides name another controller than the one that is given."""
    for key in ("controller", "controller.law", "controller.function"):
        if key in overrides:
            raise InputError(
                f"{key} = {short_repr(overrides[key])}: contradicts the given controller "
                f"{shortened(controller_name(controller))}; leave one of them out"
            )


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
    """The values of nested tables by dotted key, without those that are None."""
    for name, value in tables.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{before}{name}.")
        elif value is not None:
            yield before + name, value
