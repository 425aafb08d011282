"""The tables that a JSON Schema describes, and their keys, in words."""

import json
import re
from dataclasses import dataclass, replace
from itertools import product
from math import pi
from typing import Any, Final, NamedTuple

from tiltsim.scenario.schema import TAG_KEYS, Node

PLURAL: Final = re.compile(r"^(number|whole number|list|table)")

NO_LIMIT: Final = 1e6  # bounds from here on only keep arithmetic from overflowing, and are left out


class Step(NamedTuple):
    """A part of a table's place in the file, such as ``gait`` with the tags of one of its types."""

    name: str
    tags: tuple[str, ...] = ()
    is_list: bool = False  # a list of tables
    is_named: bool = False  # tables whose names are the user's

    @property
    def written(self) -> str:
        """As written in the head of the table."""
        return f"{self.name}.your-name" if self.is_named else self.name


Place = tuple[Step, ...]  # where a table is in the file; empty for the file itself


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

    def visit(table: Node, place: Place, above: str) -> None:
        if table.name in tables:
            known = tables[table.name]
            tables[table.name] = replace(known, places=(*known.places, place))
        else:
            toml = above + _toml(table, place, table.value.get("examples", [{}])[0])
            tables[table.name] = KeyTable(table.name, (place,), *_contents(table), toml)
        for key, node in table.properties.items():
            if table.name == "Variant" and key in schema["properties"]:
                continue  # a variant may have every key of the document
            members = node.all_tables
            for member in members:
                tags = tuple(member.kinds) if len(members) > 1 else ()
                is_list = node.value.get("type") == "array"
                step = Step(key, tags, is_list, "patternProperties" in node.value)
                visit(member, (*place, step), _needed_by(key, table, place))

    visit(Node(schema, schema["$defs"]), (), "")
    return list(tables.values())


def _contents(table: Node) -> tuple[str, tuple[Key, ...]]:
    required = table.value.get("required", ())
    keys = [_key(name, node, name in required) for name, node in table.properties.items()]
    keys.sort(key=lambda key: (key.name not in TAG_KEYS, key.default != "required"))
    return table.value.get("description", ""), tuple(keys)


def _key(name: str, node: Node, required: bool) -> Key:
    meaning, unit = node.meaning_and_unit
    if not node.has_numbers:
        meaning, unit = node.value.get("description", ""), ""
    default = node.value.get("default")
    shown = "" if isinstance(default, dict) else _written(default)
    return Key(
        name,
        _values(node),
        unit,
        "required" if required else shown,
        _written(_example(node)),
        meaning,
    )


def _example(node: Node) -> Any:
    """A value to show: as declared, or another than the default, or the default.

    None for tables, whose keys have examples.
    """
    default, choices = node.value.get("default"), node.choices
    if "examples" in node.value:
        return node.value["examples"][0]
    if isinstance(default, bool):
        return not default
    if node.all_tables and not choices:
        return None
    return next((choice for choice in choices if choice != default), default)


def _needed_by(key: str, table: Node, place: Place) -> str:
    """The part of a scenario that a table needs above it: its owner's kind, or else an example."""
    tagged = bool(place) and bool(place[-1].tags)
    example = {} if tagged else table.value.get("examples", [{}])[0]
    toml = _toml(table, place, example, without=key)
    return f"{toml}\n" if toml.count("\n") > 1 else ""


def head_of(place: Place) -> str:
    """The line that begins a table in TOML."""
    name = ".".join(step.written for step in place)
    return f"[[{name}]]" if place[-1].is_list else f"[{name}]"


def _toml(table: Node, place: Place, example: dict[str, Any], without: str = "") -> str:
    """A table as it is written, with the keys that it requires and the keys of an example."""
    if not place:
        return ""
    shown = {*table.value.get("required", ()), *example} - {without}
    values = {key: _example(node) for key, node in table.properties.items()} | example
    lines = [f"{key} = {_written(values[key])}" for key in values if key in shown]
    lines.sort(key=lambda line: not line.startswith(TAG_KEYS))
    return "\n".join([head_of(place), *lines]) + "\n"


def _written(value: Any) -> str:
    """A value as in TOML; empty for None."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_written(item)}" for key, item in value.items()) + " }"
    if isinstance(value, float):
        return str(float(f"{value:.6g}"))
    return "" if value is None else json.dumps(value)


def _values(node: Node) -> str:
    """Type and allowed values of a key in words."""
    names = [f'"{choice}"' for choice in node.choices if node.options == [node]]
    if names:
        return ", ".join(names if len(names) <= 12 else [*names[:2], "..."])
    if node.options != [node]:
        return ", or ".join(dict.fromkeys(filter(None, map(_values, node.options))))
    kind = node.value.get("type", "any value")
    if kind == "array":
        count = f"{len(node.entries)} " if "prefixItems" in node.value else ""
        return f"list of {count}" + PLURAL.sub(r"\1s", _values(node.entries[0]), count=1)
    number = {"number": "number", "integer": "whole number"}.get(kind)
    words = {"boolean": "true, false", "string": "text", "null": "", "object": "table"}
    return number + _bounds(node.value) if number else words.get(kind, kind)


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
