"""The tables that a JSON Schema describes, and their keys, in words."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import pi
from typing import Any, Final, NamedTuple

from tiltsim.scenario.messages import UNIT

TAG_KEYS: Final = ("type", "law", "model")
"""Keys whose value decides which other keys a table has."""

PLURAL: Final = re.compile(r"^(number|whole number|list|table)")

NO_LIMIT: Final = 1e6
"""Bounds from here on only keep arithmetic from overflowing, and are left out."""


class Step(NamedTuple):
    """A part of a table's place in the file, such as ``gait`` with the tags of one of its types."""

    name: str
    tags: tuple[str, ...] = ()
    is_list: bool = False  # a list of tables
    is_named: bool = False  # tables whose names are the user's

    @property
    def written(self) -> str:
        """As in the head of the table."""
        return f"{self.name}.your-name" if self.is_named else self.name


Place = tuple[Step, ...]
"""Where a table is in the file; empty for the file itself."""


@dataclass(frozen=True)
class Key:
    """A key of a table. Values are written as in TOML."""

    name: str
    values: str  # type and allowed values
    unit: str  # "-" if it has numbers without a unit; empty if it has none
    default: str  # "required", or empty if there is none
    example: str  # empty for tables, which have their own
    meaning: str


@dataclass(frozen=True)
class KeyTable:
    """A table of the file, which may stand in several places."""

    name: str  # in the schema; empty for the file itself
    places: tuple[Place, ...]
    meaning: str
    keys: tuple[Key, ...]
    toml: str  # a scenario with this table and the keys that it requires

    def addresses(self) -> list[str]:
        """Every name by which people ask for it: ``gait``, ``gait.walk``, ``gait.run``, ..."""
        names = []
        for place in self.places:
            parts = [(step.name, *(f"{step.name}.{tag}" for tag in step.tags)) for step in place]
            names += [".".join(part) for part in product(*parts)]
        return names

    @property
    def depth(self) -> int:
        """Dots in an address with all tags."""
        place = self.places[0]
        return len(place) + sum(bool(step.tags) for step in place) - 1


def key_tables(schema: dict[str, Any]) -> list[KeyTable]:
    """The tables of a schema, each after the one that contains it; the document itself first."""
    tables: dict[str, KeyTable] = {}

    def visit(name: str, place: Place, above: str) -> None:
        table = schema["$defs"].get(name, schema)
        toml = above + _toml(table, place, table.get("examples", [{}])[0])
        if name in tables:
            known = tables[name]
            tables[name] = replace(known, places=(*known.places, place))
        else:
            tables[name] = KeyTable(name, (place,), *_contents(table), toml)
        for key, value in table["properties"].items():
            if name == "Variant" and key in schema["properties"]:
                continue  # a variant may have every key of the document
            members = list(_references(value))
            for member in members:
                tags = _tags(schema["$defs"][member]) if len(members) > 1 else ()
                step = Step(key, tags, value.get("type") == "array", "patternProperties" in value)
                visit(member, (*place, step), _needed_by(key, table, place))

    visit("", (), "")
    return list(tables.values())


def _contents(table: dict[str, Any]) -> tuple[str, tuple[Key, ...]]:
    required = table.get("required", ())
    keys = [_key(name, value, name in required) for name, value in table["properties"].items()]
    keys.sort(key=lambda key: (key.name not in TAG_KEYS, key.default != "required"))
    return table.get("description", ""), tuple(keys)


def _key(name: str, value: dict[str, Any], required: bool) -> Key:
    meaning, unit = value.get("description", ""), ""
    if has_numbers(value) and (match := UNIT.fullmatch(meaning)):
        meaning, unit = match.groups()
    default = value.get("default")
    shown = "" if isinstance(default, dict) else _written(default)
    example = _written(_example(value))
    return Key(name, _values(value), unit, "required" if required else shown, example, meaning)


def has_numbers(value: dict[str, Any]) -> bool:
    """Whether a key takes numbers that may have a unit; whole numbers count or name something."""
    parts = [*_options(value), *value.get("prefixItems", ())]
    parts += [value["items"]] if "items" in value else []
    return value.get("type") == "number" or any(map(has_numbers, parts))


def _references(value: dict[str, Any]) -> Iterator[str]:
    """Names of the tables that a key may have."""
    if "$ref" in value:
        yield value["$ref"].rpartition("/")[2]
    entries = [value["items"]] if "items" in value else []
    for option in (*_options(value), *entries, *value.get("patternProperties", {}).values()):
        yield from _references(option)


def _options(value: dict[str, Any]) -> list[dict[str, Any]]:
    return [*value.get("anyOf", ()), *value.get("oneOf", ())]


def _tags(table: dict[str, Any]) -> tuple[str, ...]:
    tags = [_choices(table["properties"][key]) for key in TAG_KEYS if key in table["properties"]]
    return tuple(tags[0]) if tags else ()


def _choices(value: dict[str, Any]) -> list[str]:
    """The names that a key may have as its value."""
    if "const" in value:
        return [value["const"]]
    choices = list(value.get("enum", ()))
    return choices + [choice for option in _options(value) for choice in _choices(option)]


def _example(value: dict[str, Any]) -> Any:
    """A value to show: as declared, or another than the default, or the default.

    None for tables, whose keys have examples of their own.
    """
    default, choices = value.get("default"), _choices(value)
    if "examples" in value:
        return value["examples"][0]
    if isinstance(default, bool):
        return not default
    if next(_references(value), None) and not choices:
        return None
    return next((choice for choice in choices if choice != default), default)


def _needed_by(key: str, table: dict[str, Any], place: Place) -> str:
    """What a scenario needs of a table for the one under a key: its kind, or else its example."""
    tagged = bool(place) and bool(place[-1].tags)
    example = {} if tagged else table.get("examples", [{}])[0]
    example = {name: value for name, value in example.items() if name != key}
    required = [name for name in table.get("required", ()) if name != key]
    toml = _toml(table | {"required": required}, place, example)
    return f"{toml}\n" if toml.count("\n") > 1 else ""


def head_of(place: Place) -> str:
    """The line that begins a table in TOML."""
    name = ".".join(step.written for step in place)
    return f"[[{name}]]" if place[-1].is_list else f"[{name}]"


def _toml(table: dict[str, Any], place: Place, example: dict[str, Any]) -> str:
    """A table as it is written, with the keys that it requires and those of an example."""
    if not place:
        return ""
    head = head_of(place)
    shown = {*table.get("required", ()), *example}
    values = {key: _example(value) for key, value in table["properties"].items()} | example
    lines = [f"{key} = {_written(values[key])}" for key in values if key in shown]
    lines.sort(key=lambda line: not line.startswith(TAG_KEYS))
    return "\n".join([head, *lines]) + "\n"


def _written(value: Any) -> str:
    """A value as in TOML; empty for None."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_written(item)}" for key, item in value.items()) + " }"
    if isinstance(value, float):
        return str(float(f"{value:.6g}"))
    return "" if value is None else json.dumps(value)


def _values(value: dict[str, Any]) -> str:
    """Type and allowed values of a key in words."""
    if "const" in value or "enum" in value:
        names = [f'"{choice}"' for choice in _choices(value)]
        return ", ".join(names if len(names) <= 12 else [*names[:2], "..."])
    if "$ref" in value:
        return "table"
    if options := dict.fromkeys(filter(None, map(_values, _options(value)))):
        return ", or ".join(options)
    kind = value.get("type", "any value")
    if kind == "array":
        entries = value.get("prefixItems") or [value["items"]]
        count = f"{len(entries)} " if "prefixItems" in value else ""
        return f"list of {count}" + PLURAL.sub(r"\1s", _values(entries[0]), count=1)
    number = {"number": "number", "integer": "whole number"}.get(kind)
    words = {"boolean": "true, false", "string": "text", "null": "", "object": "table"}
    return number + _bounds(value) if number else words.get(kind, kind)


def _bounds(value: dict[str, Any]) -> str:
    """The bounds of a number, such as `` > 0, <= 1``."""
    signs = (
        ("minimum", ">="),
        ("exclusiveMinimum", ">"),
        ("maximum", "<="),
        ("exclusiveMaximum", "<"),
    )
    limits = [
        f"{sign} {_limit(value[key])}"
        for key, sign in signs
        if abs(value.get(key, NO_LIMIT)) < NO_LIMIT
    ]
    if {"minimum", "maximum"} <= value.keys() and len(limits) == 2:
        return f", {_limit(value['minimum'])} to {_limit(value['maximum'])}"
    return " " + ", ".join(limits) if limits else ""


def _limit(bound: float) -> str:
    """A bound, as a fraction of pi where it is one."""
    for part in (1, 2, 4):
        if abs(bound) == pi / part:
            return ("-" if bound < 0 else "") + ("pi" if part == 1 else f"pi/{part}")
    return f"{bound:g}"
