"""Changes of a document: values by dotted key, as in ``--set``, and tables merged into others."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any, Final

from tiltsim.errors import InputError
from tiltsim.scenario.controller import DEFAULT_LAW
from tiltsim.scenario.limits import MAX_DEPTH, check_limits
from tiltsim.scenario.messages import show
from tiltsim.scenario.schema import share_keys
from tiltsim.scenario.table import Table

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
