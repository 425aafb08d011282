"""Documents: arguments of Python as values of a file, values by dotted key, merged tables."""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike, fsdecode
from typing import Any, Final

from tiltsim.errors import InputError
from tiltsim.scenario.controller import DEFAULT_LAW
from tiltsim.scenario.library import MAX_DEPTH, check_limits
from tiltsim.scenario.messages import show
from tiltsim.scenario.schema import share_keys
from tiltsim.scenario.table import Table
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


KIND_KEYS: Final = {"type": None, "law": DEFAULT_LAW}
"""Keys that decide which other keys a table may have, with their defaults."""


def split_key(key: str) -> list[str | int]:
    """A dotted key as names and positions: ``gait.angles[1]`` is ``gait``, ``angles``, ``1``."""
    steps: list[str | int] = []
    if key.count(".") + key.count("[") > MAX_DEPTH:
        raise InputError(f"{key[:60]}...: a key of more than {MAX_DEPTH} names and positions")
    for name in key.split("."):
        plain, *positions = name.split("[")
        steps.append(plain)
        for position in positions:
            if re.fullmatch(r"[0-9]{1,9}\]", position) is None:
                raise InputError(
                    f"{key}: entries of lists count from 0, and are written NAME[0], NAME[1], ..."
                )
            steps.append(int(position[:-1]))
    return steps


def value_at(document: Any, key: str) -> Any:
    """The value of a dotted key in tables and lists, all of them for ''; None if there is none."""
    for step in split_key(key) if key else ():
        if isinstance(step, int):
            known = isinstance(document, list | tuple) and step < len(document)
        else:
            known = isinstance(document, dict) and step in document
        if not known:
            return None
        document = document[step]
    return document


def with_value(document: Any, path: Sequence[str | int], value: Any) -> Any:
    """A copy of tables and lists with another value at a path; it shares everything else."""
    if not path:
        return value
    step, *rest = path
    changed = list(document) if isinstance(step, int) else dict(document)
    changed[step] = with_value(document[step] if rest else None, rest, value)  # type: ignore[index]
    return tuple(changed) if isinstance(document, tuple) else changed


def refuse_replaced(given: Sequence[tuple[str, Any]], address: str) -> None:
    """Raise `InputError` if a value replaces the whole table or list of which another is a part."""
    paths = [split_key(key) for key, _ in given]
    for i, (path, (key, value)) in enumerate(zip(paths, given)):
        for inner, (part, _) in zip(paths[:i], given):
            if len(inner) > len(path) and inner[: len(path)] == path:
                raise InputError(
                    f"{address}: {key} = {show(value)}: would replace {part}, which is also given; "
                    "give one of them"
                )


def parse_override(text: str) -> tuple[str, Any]:
    """Split ``KEY=VALUE``; the value is read as TOML, or as a string if it is not TOML.

    Raises `InputError` if the key or the equals sign is missing.
    """
    key, equals, value = text.partition("=")
    key, value = key.strip(), value.strip()
    if not equals or not key:
        raise InputError(f"--set {text}: write KEY=VALUE, for example controller.decoupler=exact")
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except ValueError:  # TOMLDecodeError, or an integer with too many digits
        return key, value
    except RecursionError:
        raise InputError(f"--set {key}: lists and tables nest too deep") from None
    check_limits(parsed, f"--set {key}")
    return key, parsed


def merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A document with changes, table by table; a table with other keys replaces the old one."""
    merged = dict(base)
    for key, value in changes.items():
        old = merged.get(key)
        if isinstance(old, dict) and isinstance(value, dict):
            other_kind = any(
                tag in value and has_other_keys(old.get(tag, default), value[tag])
                for tag, default in KIND_KEYS.items()
            )
            merged[key] = value if other_kind else merge(old, value)
        else:
            merged[key] = value
    return merged


def has_other_keys(old: object, new: object) -> bool:
    """Whether a table has other keys for another of its kinds, as a walk has for a trot."""
    return old != new and not share_keys(Table, old, new)
